#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Puts the figures of comparisons into the documentation, or says where the two differ.

A page marks the place with <!-- compare TABLE SEQUENCE... --> ... <!-- end -->, with TABLE one of prior and trackers; the
figures come from data/results/compare/SEQUENCE.json, which --compare makes of the compare.json that `bole compare` has
written. With --check nothing is written: status 1 where a page differs."""
import argparse
import glob
import json
import os
import re
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
MARK = re.compile(r"(<!-- compare (\S+) ([^>]*?) -->\n).*?(<!-- end -->)", re.S)


def figure(value, digits):
    return "-" if value is None else f"{value:.{digits}f}"


def row_of(cells):
    return "| " + " | ".join(cells) + " |"


def prior(found):
    """The trackers that are helped by odometry, on one sequence."""
    yield "| | frames until it is lost | right | wrong in silence | position RMSE, all frames [m] | median ms |"
    yield "|---|" + "---|" * 5
    for row in found[0]["trackers"]:
        if row["help"] == "prior":
            yield row_of([f"`{row['tracker']}`", f"{row['frames_until_loss']} of {row['frames']}", str(row["frames_right"]),
                          str(row["silent_failures"]), figure(row["position_rmse_all_frames_m"], 3), figure(row["median_ms"], 1)])


def trackers(found):
    yield "| | " + " | ".join(f"{d['name']} ({d['frames'] - 1})" for d in found) + " |"
    yield "|---|" + "---|" * len(found)
    for i, row in enumerate(found[0]["trackers"]):
        yield row_of([f"`{row['tracker']}` {row['help']}"] + [
            f"{c['frames_until_loss']} ({figure(c['position_rmse_all_frames_m'], 3)}) {c['silent_failures']}, {figure(c['median_ms'], 1)}"
            for c in (d["trackers"][i] for d in found)])
    yield row_of(["cost on the same trunks, true pose set every frame: EDGE, ours [ms]"] + [
        ", ".join(figure(c["median_ms"], 1) for c in d["cost_on_the_same_trunks"]) for d in found])


def table(kind, sequences):
    found = []
    for name in sequences:
        with open(os.path.join(ROOT, "data/results/compare", name + ".json"), encoding="utf-8") as text:
            found.append(json.load(text))
    return "\n".join({"prior": prior, "trackers": trackers}[kind](found)) + "\n"


def keep_comparison(paths):
    """compare.json without what no table shows: errors of each frame and the sweeps of settings."""
    os.makedirs(os.path.join(ROOT, "data/results/compare"), exist_ok=True)
    for path in paths:
        name = os.path.basename(os.path.dirname(os.path.abspath(path)))
        with open(path, encoding="utf-8") as text:
            kept = {k: v for k, v in json.load(text).items() if k != "sweeps"}
        for tracker in kept["trackers"]:
            tracker.pop("errors", None)
        with open(os.path.join(ROOT, "data/results/compare", name + ".json"), "w", encoding="utf-8") as out:
            json.dump({"name": name, **kept}, out, indent=1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--compare", nargs="+", default=[], metavar="FOLDER/compare.json",
                        help="first keep these comparisons, by the names of their folders")
    arguments = parser.parse_args()
    is_check = arguments.check
    keep_comparison(arguments.compare)
    stale = []
    for page in [os.path.join(ROOT, "README.md"), *sorted(glob.glob(os.path.join(ROOT, "src/doc/*.md")))]:
        with open(page, encoding="utf-8") as text:
            old = text.read()
        new = MARK.sub(lambda m: m.group(1) + table(m.group(2), m.group(3).split()) + m.group(4), old)
        if new != old:
            stale.append(os.path.relpath(page, ROOT))
            if not is_check:
                with open(page, "w", encoding="utf-8") as out:
                    out.write(new)
    if stale:
        print(("differs from data/results: " if is_check else "written: ") + ", ".join(stale))
    return 1 if is_check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
