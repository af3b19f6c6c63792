# SPDX-License-Identifier: GPL-2.0-or-later
"""Tree trunks from the video of a small drone: a map, a trajectory, and the runs that `bole track` wrote.

    import bole
    source = bole.open("data/park-forward")
    pipeline = bole.Pipeline(source, {"stages.saliency": False})
    for frame in source:
        report = pipeline.process(frame)
    pipeline.finish()
    print(pipeline.trunks()["x"], pipeline.trajectory()[-1])

    run = bole.read_run("run")   # tables of pandas where it is installed, dicts of lists where not
"""
import csv as _csv
import json as _json
import os as _os

from ._bole import Frame, Pipeline, Report, Source, __version__, open, options  # noqa: A004

__all__ = ["Frame", "Pipeline", "Report", "Run", "Source", "__version__", "open", "options", "read_run"]

_file = __builtins__["open"] if isinstance(__builtins__, dict) else __builtins__.open


def _number(text):
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text


def _table(path):
    """A CSV with `#` comments: a DataFrame, or a dict of lists without pandas."""
    try:
        import pandas

        return pandas.read_csv(path, comment="#")
    except ImportError:
        with _file(path, newline="", encoding="utf-8") as lines:
            rows = list(_csv.reader(line for line in lines if not line.startswith("#")))
        return {name: [_number(row[i]) for row in rows[1:]] for i, name in enumerate(rows[0])}


class Run:
    """What `bole track` left in a folder: trunks, hypotheses, timing (tables), trajectory (n x 8, as
    Pipeline.trajectory()) and summary (a dict)."""

    def __init__(self, folder):
        import numpy

        self.folder = folder
        with _file(_os.path.join(folder, "summary.json"), encoding="utf-8") as text:
            self.summary = _json.load(text)
        self.trunks = _table(_os.path.join(folder, "trunks.csv"))
        self.hypotheses = _table(_os.path.join(folder, "hypotheses.csv"))
        self.timing = _table(_os.path.join(folder, "timing.csv"))
        self.trajectory = numpy.loadtxt(_os.path.join(folder, "trajectory.tum"), ndmin=2)

    def __repr__(self):
        return f"<bole.Run {self.folder}: {len(self.trunks['id'])} trunks, {len(self.trajectory)} poses>"


def read_run(folder):
    """The Run in a folder. Raises FileNotFoundError where there is none."""
    return Run(folder)
