#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Puts a campaign's figures into the documentation, or says where the two differ.

A page marks the place with <!-- campaign NAME RUN --> ... <!-- end -->; the figures come from data/results/NAME.csv, the
summary.csv of the campaign config/campaign/NAME.yaml. With --check nothing is written: status 1 where a page differs."""
import argparse
import csv
import glob
import os
import re
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
NAMES = {"recall": "recall", "precision": "precision", "position_median_m": "position error, median of the flights [m]",
         "position_rmse_m": "position RMSE [m]", "radius_rmse_m": "radius RMSE [m]", "radius_bias_m": "radius bias [m]", "nees_half": "NEES/2 of trunks",
         "ate_m": "ATE after x, y, yaw [m]", "ate_odometry_m": "... of the odometry [m]"}
MARK = re.compile(r"(<!-- campaign (\S+) ([^>]*?) -->\n).*?(<!-- end -->)", re.S)


def table(name, runs):
    path = os.path.join(ROOT, "data/results", name + ".csv")
    with open(path, encoding="utf-8") as text:
        rows = [r for r in csv.DictReader(text) if r["stratum"] == "all"]
    lines = ["| | " + " | ".join(runs) + " |", "|---|" + "---|" * len(runs)]
    flights = {r["run"]: r["flights"] for r in rows}
    lines.append("| flights | " + " | ".join(flights.get(run, "-") for run in runs) + " |")
    for measure, label in NAMES.items():
        cells = []
        for run in runs:
            found = [r for r in rows if r["run"] == run and r["measure"] == measure and r["estimate"]]
            digits = 2 if measure in ("recall", "precision", "nees_half") else 3
            number = lambda v: f"{float(v):.{digits}f}"
            cells.append(f"{number(found[0]['estimate'])} [{number(found[0]['low'])}, {number(found[0]['high'])}]" if found and found[0]["low"]
                         else number(found[0]["estimate"]) if found else "-")
        if any(c != "-" for c in cells):
            lines.append(f"| {label} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    is_check = parser.parse_args().check
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
