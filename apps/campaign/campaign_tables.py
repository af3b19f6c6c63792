# SPDX-License-Identifier: GPL-2.0-or-later
"""The tables of a campaign, with their statistics."""
import csv
import json
import math
import os
import random
import statistics

from scipy import stats


def wilson(k, n, z=1.959964):
    """95 % interval of a share (Wilson 1927)."""
    if n == 0:
        return None, None
    p, d = k / n, 1 + z * z / n
    middle, half = (p + z * z / (2 * n)) / d, z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / d
    return max(0.0, middle - half), min(1.0, middle + half)


def bootstrap_median(values, draws=2000, seed=1):
    """95 % interval of a median, flights drawn with replacement."""
    values = sorted(v for v in values if v is not None)
    if not values:
        return None, None, None
    if len(values) < 2:
        return values[0], None, None
    rng = random.Random(seed)
    drawn = sorted(statistics.median(rng.choices(values, k=len(values))) for _ in range(draws))
    return statistics.median(values), drawn[int(0.025 * draws)], drawn[int(0.975 * draws)]


def ratio_interval(rows, part, whole, draws=2000, seed=1):
    """Share over all trunks with a 95 % interval: whole flights are drawn, since trunks of one flight go together."""
    pairs = [(r[part], r[whole]) for r in rows if r[whole]]
    total = sum(n for _, n in pairs)
    if not total:
        return None, None, None
    value = sum(k for k, _ in pairs) / total
    if len(pairs) < 2:
        return (value, *wilson(sum(k for k, _ in pairs), total))
    rng = random.Random(seed)
    drawn = []
    for _ in range(draws):
        some = rng.choices(pairs, k=len(pairs))
        drawn.append(sum(k for k, _ in some) / max(1, sum(n for _, n in some)))
    drawn.sort()
    return value, drawn[int(0.025 * draws)], drawn[int(0.975 * draws)]


def dig(value, *path):
    for key in path:
        if not isinstance(value, dict) or value.get(key) is None:
            return None
        value = value[key]
    return value


SUMMARY = ["run", "stratum", "value", "measure", "estimate", "low", "high", "flights"]
COMPARE = ["a", "b", "measure", "pairs", "effect", "low", "high", "test", "p"]
FAILURES = ["run", "flight", "status", "log"]
MEASURES = {  # column: where it stands in evaluation.json
    "position_median_m": ("trunks", "all", "position_m", "xy_yaw", "median"),
    "position_rmse_m": ("trunks", "all", "position_m", "xy_yaw", "rmse"),
    "radius_rmse_m": ("trunks", "all", "radius_m", "rmse"),
    "radius_bias_m": ("trunks", "all", "radius_m", "bias"),
    "nees_half": ("trunks", "all", "nees_half"),
    "ate_m": ("trajectory", "smoothed", "ate", "xy_yaw", "rmse_m"),
    "ate_scaled_m": ("trajectory", "smoothed", "ate", "xy_yaw_scale", "rmse_m"),
    "ate_odometry_m": ("trajectory", "odometry", "ate", "xy_yaw", "rmse_m"),
    "scale": ("trajectory", "smoothed", "scale"),
}


def write_csv(path, rows, columns):
    with open(path, "w", newline="", encoding="utf-8") as out:
        table = csv.DictWriter(out, columns, extrasaction="ignore")
        table.writeheader()
        table.writerows(rows)


def collect(campaign, paths):
    flights, trunks, failures = [], [], []
    for path in paths:
        with open(path, encoding="utf-8") as text:
            result = json.load(text)
        run, flight = path.split("/")[-2], os.path.splitext(os.path.basename(path))[0]
        row = {"run": run, "flight": flight, "ok": int(result["ok"]), "cpu_s": result.get("cpu_s"), **campaign.flights.get(flight, {})}
        if not result["ok"]:
            failures.append({"run": run, "flight": flight, "log": result["log"],
                             "status": result.get("track_status", result.get("servo_status"))})
        evaluation = result.get("evaluation")
        if evaluation:
            everything = dig(evaluation, "trunks", "all") or {}
            row.update(expected=everything.get("expected"), found=everything.get("found"), matches=everything.get("matches"),
                       confirmed=dig(evaluation, "trunks", "confirmed"), frames=evaluation.get("frames"),
                       duplicates=dig(evaluation, "trunks", "duplicates"))
            row.update({name: dig(evaluation, *where) for name, where in MEASURES.items()})
            for kind in ("matched", "missed", "false_positives"):
                for trunk in dig(evaluation, "trunks", kind) or []:
                    trunk = trunk if isinstance(trunk, dict) else {"map": trunk}
                    trunks.append({"run": run, "flight": flight, "kind": kind, **trunk})
        each = dig(result, "servo", "each")
        if each:
            row.update({k: v for k, v in each[0].items() if k != "seed" and not isinstance(v, (dict, list))})
        flights.append(row)
    return flights, trunks, failures


def columns_of(rows):
    return list(dict.fromkeys(column for row in rows for column in row))


def summaries(campaign, flights):
    """Medians and shares with intervals: all flights, and by stratum."""
    rows = []
    for run in [*campaign.runs, *("servo-" + name for name in campaign.servo)]:
        flown = [f for f in flights if f["run"] == run and f["ok"]]
        strata = [("all", "", flown)]
        for key in campaign.strata:
            for value in sorted({str(f[key]) for f in flown if key in f}):
                strata.append((key, value, [f for f in flown if str(f.get(key)) == value]))
        for key, value, some in strata:
            add = lambda name, found: rows.append(dict(zip(SUMMARY, (run, key, value, name, *found, len(some)))))
            judged = [f for f in some if f.get("expected") is not None]
            if judged:
                add("recall", ratio_interval(judged, "found", "expected"))
                add("precision", ratio_interval([f for f in judged if f["confirmed"]], "matches", "confirmed"))
                for name in MEASURES:
                    add(name, bootstrap_median([f.get(name) for f in judged]))
            if some and "success" in some[0]:
                k = sum(bool(f["success"]) for f in some)
                add("succeeded", (k / len(some), *wilson(k, len(some))))
                for name in ("bearing rms [deg]", "distance rms [-]", "least clearance [m]", "mean speed [m/s]"):
                    if any(f.get(name) is not None for f in some):
                        add(name, bootstrap_median([f.get(name) for f in some]))
    return rows


def comparisons(campaign, flights, trunks):
    """The same seeds through two runs: Wilcoxon's signed ranks by flight, McNemar's exact test by trunk."""
    rows = []
    by = {(f["run"], f["flight"]): {**f, "precision": f["matches"] / f["confirmed"] if f.get("confirmed") else None}
          for f in flights if f["ok"]}
    found = {}
    for t in trunks:
        if t["kind"] == "matched" and t.get("expected") or t["kind"] == "missed":
            found[(t["run"], t["flight"], t.get("truth"))] = t["kind"] == "matched"
    for a, b in campaign.pairs:
        names = [f for f in [*campaign.flights, *campaign.logs] if (a, f) in by and (b, f) in by]
        only_a = only_b = 0
        for (run, flight, truth), is_found in found.items():
            other = found.get((b, flight, truth)) if run == a else None
            if other is not None:
                only_a, only_b = only_a + (is_found and not other), only_b + (other and not is_found)
        p = stats.binomtest(only_b, only_a + only_b).pvalue if only_a + only_b else None
        rows.append({"a": a, "b": b, "measure": "trunks found", "pairs": only_a + only_b, "effect": only_b - only_a,
                     "test": "McNemar", "p": p})
        for name in ("precision", *MEASURES):
            pairs = [(by[a, f].get(name), by[b, f].get(name)) for f in names]
            steps = [y - x for x, y in pairs if x is not None and y is not None]
            if not steps:
                continue
            p = stats.wilcoxon(steps).pvalue if any(steps) else 1.0
            effect, low, high = bootstrap_median(steps)
            rows.append({"a": a, "b": b, "measure": name, "pairs": len(steps), "effect": effect, "low": low, "high": high,
                         "test": "Wilcoxon", "p": p})
    return rows


class Tables:
    flights, trunks, summary, compare, failures = (name + ".csv" for name in ("flights", "trunks", "summary", "compare", "failures"))


def write_tables(campaign, paths, output):
    flights, trunks, failures = collect(campaign, paths)
    write_csv(output.flights, flights, columns_of(flights) or ["run"])
    write_csv(output.trunks, trunks, columns_of(trunks) or ["run"])
    write_csv(output.failures, failures, FAILURES)
    write_csv(output.summary, summaries(campaign, flights), SUMMARY)
    write_csv(output.compare, comparisons(campaign, flights, trunks), COMPARE)
