#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Puts the figures of campaigns and comparisons into the documentation, or says where the two differ.

A page marks the place with <!-- campaign NAME RUN... --> ... <!-- end -->; the figures come from data/results/NAME.csv,
the summary.csv of the campaign config/campaign/NAME.yaml. <!-- compare TABLE SEQUENCE... -->, with TABLE one of prior,
trackers, basin and faults, shows data/results/compare/SEQUENCE.json, which --compare makes of the compare.json that `bole compare`
has written. With --check nothing is written: status 1 where a page differs."""
import argparse
import csv
import glob
import json
import os
import re
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
NAMES = {"recall": "recall", "precision": "precision", "position_median_m": "position error, median of the flights [m]",
         "position_rmse_m": "position RMSE [m]", "radius_rmse_m": "radius RMSE [m]", "radius_bias_m": "radius bias [m]", "nees_half": "NEES/2 of trunks",
         "ate_m": "ATE after x, y, yaw [m]", "ate_odometry_m": "... of the odometry [m]"}
MARK = re.compile(r"(<!-- (campaign|compare) (\S+) ([^>]*?) -->\n).*?(<!-- end -->)", re.S)


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


def comparison(kind, sequences):
    found = []
    for name in sequences:
        with open(os.path.join(ROOT, "data/results/compare", name + ".json"), encoding="utf-8") as text:
            found.append(json.load(text))
    figure = lambda v, digits: "-" if v is None else f"{v:.{digits}f}"
    lines = []
    if kind == "prior":  # the trackers that are helped by odometry, on one sequence
        lines += ["| | frames until it is lost | right | wrong in silence | position RMSE, all frames [m] | median ms |", "|---|" + "---|" * 5]
        for row in found[0]["trackers"]:
            if row["help"] == "prior":
                lines.append(f"| `{row['tracker']}` | {row['frames_until_loss']} of {row['frames']} | {row['frames_right']} | "
                             f"{row['silent_failures']} | {figure(row['position_rmse_all_frames_m'], 3)} | {figure(row['median_ms'], 1)} |")
    elif kind == "trackers":
        lines.append("| | " + " | ".join(f"{d['name']} ({d['frames'] - 1})" for d in found) + " |")
        lines.append("|---|" + "---|" * len(found))
        for i, row in enumerate(found[0]["trackers"]):
            cells = [d["trackers"][i] for d in found]
            lines.append(f"| `{row['tracker']}` {row['help']} | " + " | ".join(
                f"{c['frames_until_loss']} ({figure(c['position_rmse_all_frames_m'], 3)}) {c['silent_failures']}, "
                f"{figure(c['median_ms'], 1)}" for c in cells) + " |")
        lines.append("| cost on the same trunks, true pose set every frame: EDGE, ours [ms] | " + " | ".join(
            ", ".join(figure(c["median_ms"], 1) for c in d["cost_on_the_same_trunks"]) for d in found) + " |")
    elif kind == "basin":
        steps = found[0]["basin"][0]["steps_px"]
        lines.append("| | " + " | ".join(f"{s:g} px" for s in steps) + " |")
        lines.append("|---|" + "---|" * len(steps))
        for i, row in enumerate(found[0]["basin"]):
            pairs = [d["basin"][i]["pairs"] for d in found]
            shares = [sum(d["basin"][i]["success"][k] * n for d, n in zip(found, pairs)) / sum(pairs) for k in range(len(steps))]
            lines.append(f"| `{row['tracker']}`, {'forest' if row['clutter'] else 'plain'} | " + " | ".join(
                f"{s:.3f}" for s in shares) + " |")
    else:
        faults = list(dict.fromkeys(row["fault"] for row in found[0]["faults"]))
        trackers = list(dict.fromkeys(row["tracker"] for row in found[0]["faults"]))
        lines.append("| silent, recovered (slowest) | " + " | ".join(faults) + " |")
        lines.append("|---|" + "---|" * len(faults))
        for tracker in trackers:
            cells = []
            for fault in faults:
                rows = [r for d in found for r in d["faults"] if r["tracker"] == tracker and r["fault"] == fault]
                slowest = max((r["slowest_recovery_frames"] or 0) for r in rows)
                cells.append(f"{sum(r['silent_failures'] for r in rows)}, {sum(r['recovered'] for r in rows)} of "
                             f"{sum(r['runs'] for r in rows)}" + (f" ({slowest})" if slowest else ""))
            lines.append(f"| `{tracker}` | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


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
        new = MARK.sub(lambda m: m.group(1) + (table if m.group(2) == "campaign" else comparison)(
            m.group(3), m.group(4).split()) + m.group(5), old)
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
