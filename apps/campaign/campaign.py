# SPDX-License-Identifier: GPL-2.0-or-later
"""A campaign: what is flown, and the tables and the page that are made of it. Used by the Snakefile beside it."""
import base64
import html
import io
import itertools
import json
import math
import os
import random
import shlex
import sys

KEYS = {"name", "bole", "keep_flights", "flights", "logs", "runs", "servo", "compare", "strata"}
ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def fail(text):
    sys.exit("campaign: " + text)


def seeds_of(value, key):
    """1-20, 7 or [1, 5, 9]."""
    if isinstance(value, int):
        return [value]
    if isinstance(value, list) and all(isinstance(v, int) for v in value):
        return value
    parts = str(value).split("-")
    if len(parts) == 2 and all(p.isdigit() for p in parts) and int(parts[0]) <= int(parts[1]):
        return list(range(int(parts[0]), int(parts[1]) + 1))
    return fail(f"{key} = {value!r}, must be a number, FIRST-LAST or a list of numbers")


class Campaign:
    """Flights by name, each with its seed and settings; runs (presets, binaries, commits) that each flight goes through."""

    def __init__(self, config):
        unknown = set(config) - KEYS
        if unknown:
            fail(f"unknown key {sorted(unknown)[0]!r}, known are {', '.join(sorted(KEYS))}")
        self.name = str(config.get("name", "campaign"))
        self.bole_path = os.environ.get("BOLE") or config.get("bole") or os.path.join(ROOT, "build/release/bole")
        self.keep_flights = bool(config.get("keep_flights", False))
        self.runs = config.get("runs") or {"default": {}}
        self.runs = {name: run or {} for name, run in self.runs.items()}
        self.strata = config.get("strata", ["light", "density", "path"])
        self.pairs = config.get("compare") or [list(self.runs)[:1] + [n] for n in list(self.runs)[1:]]
        for pair in self.pairs:
            for run in pair:
                if run not in self.runs:
                    fail(f"compare names {run!r}, which is no run; runs are {', '.join(self.runs)}")
        self.flights = {}
        if config.get("flights"):
            self._lay_out(config["flights"])
        self.logs = {}
        for path in config.get("logs") or []:
            name = os.path.basename(path.rstrip("/")).replace("%", "")
            self.logs[name] = os.path.abspath(os.path.expanduser(path))
        self.servo, self.swept = {}, {}
        for name, task in (config.get("servo") or {}).items():
            if "task" not in task or "seeds" not in task:
                fail(f"servo.{name} must name a task and seeds")
            sweep = task.get("sweep")
            if sweep is None:
                self.servo[name] = task
                continue
            for option, values in sweep.items():
                if not isinstance(values, list):
                    fail(f"servo.{name}.sweep.{option} must be a list of values")
                for value in values:
                    run = f"{name}-{option}-{value}"
                    self.servo[run] = {**task, "arguments": [*task.get("arguments", []), "--" + option, value]}
                    self.swept.setdefault(option, {}).setdefault(name, []).append((value, "servo-" + run))

    def _lay_out(self, flights):
        """Every combination of the lists comes equally often, in an order drawn once: fewer seeds than combinations are a fair
        sample of them."""
        flights = dict(flights)
        seeds = seeds_of(flights.pop("seeds", 1), "flights.seeds")
        lists = {key: value if isinstance(value, list) else [value] for key, value in flights.items()}
        combinations = list(itertools.product(*lists.values())) or [()]
        random.Random(1).shuffle(combinations)
        for index, seed in enumerate(seeds):
            values = dict(zip(lists, combinations[index % len(combinations)]))
            self.flights[f"{seed:06d}"] = {"seed": seed, **values}

    # what the Snakefile asks
    def binary(self, run):
        run = self.runs.get(run, {})
        if "commit" in run:
            return os.path.abspath(os.path.join("builds", run["commit"], "bole"))
        return os.path.abspath(run.get("bole", self.bole_path))

    def build_of(self, run):
        commit = self.runs[run].get("commit")
        return [f"builds/{commit}/bole"] if commit else []

    def simulate_command(self, flight):
        words = [os.path.abspath(self.bole_path), "simulate"]
        for key, value in self.flights[flight].items():
            if key == "scene":
                value = os.path.join(ROOT, os.path.expanduser(value))
            if value is True:
                words.append("--" + key)
            elif value not in (None, False):
                words += ["--" + key, str(value)]
        return shlex.join(words)

    def input_of(self, flight):
        return [] if flight in self.logs else "flights/" + flight

    def source_of(self, flight):
        return shlex.quote(self.logs.get(flight, "flights/" + flight))

    def track_arguments(self, run):
        run = self.runs[run]
        words = (["--config", run["config"]] if run.get("config") else []) + [w for s in run.get("set", []) for w in ("--set", s)]
        return shlex.join(words + [str(w) for w in run.get("arguments", [])])

    def servo_arguments(self, name, flight):
        task = self.servo[name]
        words = [task["task"], "--seed", str(int(flight)), "--runs", "1"] + [str(w) for w in task.get("arguments", [])]
        return shlex.join(words)

    def results(self):
        wanted = [f"results/{run}/{flight}.json" for run in self.runs for flight in [*self.flights, *self.logs]]
        for name, task in self.servo.items():
            wanted += [f"results/servo-{name}/{seed:06d}.json" for seed in seeds_of(task["seeds"], f"servo.{name}.seeds")]
        return wanted

    def flown(self):
        return [path for path in self.results() if os.path.exists(path)]


def read(config):
    return Campaign(dict(config))


# --- statistics ---------------------------------------------------------------------------------------------------


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
    median = lambda v: v[len(v) // 2] if len(v) % 2 else 0.5 * (v[len(v) // 2 - 1] + v[len(v) // 2])
    if len(values) < 2:
        return values[0], None, None
    rng = random.Random(seed)
    drawn = sorted(median(sorted(rng.choices(values, k=len(values)))) for _ in range(draws))
    return median(values), drawn[int(0.025 * draws)], drawn[int(0.975 * draws)]


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


# --- tables -------------------------------------------------------------------------------------------------------


def dig(value, *path):
    for key in path:
        if not isinstance(value, dict) or value.get(key) is None:
            return None
        value = value[key]
    return value


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
    import csv

    with open(path, "w", newline="", encoding="utf-8") as out:
        table = csv.writer(out)
        table.writerow(columns)
        for row in rows:
            table.writerow(["" if row.get(c) is None else row.get(c) for c in columns])


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
    columns = []
    for row in rows:
        columns += [c for c in row if c not in columns]
    return columns


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
            add = lambda name, found: rows.append(dict(zip(
                ("run", "stratum", "value", "measure", "estimate", "low", "high", "flights"), (run, key, value, name, *found, len(some)))))
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
    from scipy import stats

    rows = []
    by = {(f["run"], f["flight"]): f for f in flights if f["ok"]}
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
            value = (lambda f: f["matches"] / f["confirmed"] if f.get("confirmed") else None) if name == "precision" else (lambda f: f.get(name))
            pairs = [(value(by[a, f]), value(by[b, f])) for f in names]
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
    write_csv(output.failures, failures, ["run", "flight", "status", "log"])
    write_csv(output.summary, summaries(campaign, flights), ["run", "stratum", "value", "measure", "estimate", "low", "high", "flights"])
    write_csv(output.compare, comparisons(campaign, flights, trunks), ["a", "b", "measure", "pairs", "effect", "low", "high", "test", "p"])


# --- the page -----------------------------------------------------------------------------------------------------

COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"]  # Okabe and Ito


def drawn(draws, width, height):
    """SVG of what each of \p draws puts onto axes of its own, with a legend of what the first named; None where nothing was
    drawn."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(draws), figsize=(width, height), layout="constrained", squeeze=False)
    for draw, place in zip(draws, axes[0]):
        draw(place)
    if axes[0][0].get_legend_handles_labels()[1]:
        axes[0][0].legend()
    out = io.BytesIO()
    figure.savefig(out, format="svg")
    plt.close(figure)
    return out.getvalue() if any(place.has_data() for place in axes[0]) else None


def embedded(svg):
    return '<img alt="" src="data:image/svg+xml;base64,' + base64.b64encode(svg).decode() + '">' if svg else ""


def picture(draw, width=6.4, height=3.6):
    return embedded(drawn([draw], width, height))


def plot_shares(axes, colour, label, shares, marks_only=False):
    """Shares k of n at x with their 95 % intervals; \p shares: (x, k, n), of which those with n = 0 say nothing."""
    shares = [(x, k / n, *wilson(k, n)) for x, k, n in shares if n]
    if shares:
        x, y, low, high = zip(*shares)
        reach = [[max(0, v - l) for v, l in zip(y, low)], [max(0, h - v) for v, h in zip(y, high)]]
        axes.errorbar(x, y, reach, color=colour, marker="o", capsize=3, label=label, linestyle="none" if marks_only else "-")


def recall_by(trunks, runs, key, edges, label):
    def draw(axes):
        for colour, run in zip(COLOURS, runs):
            mine = [t for t in trunks if t["run"] == run and t.get(key) not in (None, "") and (t["kind"] == "missed" or t.get("expected") in (True, "True"))]
            shares = []
            for low, high in zip(edges, edges[1:]):
                some = [t for t in mine if low <= float(t[key]) < high]
                shares.append((0.5 * (low + high), sum(t["kind"] == "matched" for t in some), len(some)))
            plot_shares(axes, colour, run, shares)
        axes.set(xlabel=label, ylabel="recall (95 % interval)", ylim=(0, 1.05))

    return picture(draw)


def reliability(trunks, runs):
    """Share of the confirmed trunks that are some, by the probability that they were written with."""
    def draw(axes):
        for colour, run in zip(COLOURS, runs):
            mine = [t for t in trunks if t["run"] == run and t["kind"] != "missed" and t.get("probability") not in (None, "")]
            edges = [0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 1.001]
            shares = []
            for low, high in zip(edges, edges[1:]):
                some = [t for t in mine if low <= float(t["probability"]) < high]
                mean = sum(float(t["probability"]) for t in some) / max(1, len(some))
                shares.append((mean, sum(t["kind"] == "matched" for t in some), len(some)))
            plot_shares(axes, colour, run, shares, marks_only=True)
        if axes.has_data():
            axes.plot([0.4, 1], [0.4, 1], color="0.6", linestyle="--")
        axes.set(xlabel="probability that was written", ylabel="share that is right (95 %)", xlim=(0.4, 1.02), ylim=(0, 1.05))

    return picture(draw)


def errors_by(trunks, flights, runs, key, error, label):
    """Absolute errors of matched trunks against a number of the trunk, or by a word of the flight."""
    settings = {f["flight"]: f for f in flights}

    def draw(axes):
        ticks = []
        for index, (colour, run) in enumerate(zip(COLOURS, runs)):
            mine = [(t.get(key, settings.get(t["flight"], {}).get(key)), abs(float(t[error]))) for t in trunks
                    if t["run"] == run and t["kind"] == "matched" and t.get(error) not in (None, "")]
            mine = [(k, e) for k, e in mine if k not in (None, "")]
            if not mine:
                continue
            if isinstance(mine[0][0], str):
                ticks = sorted({k for k, _ in mine})
                for i, name in enumerate(ticks):
                    axes.boxplot([[e for k, e in mine if k == name]], positions=[i + 0.25 * index], widths=0.2, showfliers=False,
                                 boxprops={"color": colour}, medianprops={"color": colour})
            else:
                axes.plot([float(k) for k, _ in mine], [e for _, e in mine], ".", color=colour, label=run)
        if ticks:
            axes.set_xticks(range(len(ticks)), ticks)
        axes.set(xlabel=label, ylabel=error.replace("_m", " [m]").replace("_", " "))

    return picture(draw)


UNITS = {"latency": "latency of the video [s]", "gust": "gusts [m/s$^2$]", "density": "trunks a m$^2$", "speed": "speed [m/s]"}


def sweep(campaign, flights, option):
    """Draws the share of the runs that succeed against an option that was swept, a curve a task."""
    def draw(axes):
        for colour, (name, runs) in zip(COLOURS, campaign.swept[option].items()):
            shares = []
            for value, run in runs:
                some = [bool(f["success"]) for f in flights if f["run"] == run and f["ok"] and "success" in f]
                shares.append((value, sum(some), len(some)))
            plot_shares(axes, colour, name, shares)
        axes.set(xlabel=UNITS.get(option, option), ylabel="share that succeeded (95 %)", ylim=(0, 1.05))

    return draw


def sweeps(campaign, flights):
    """SVG of all that was swept, side by side."""
    return drawn([sweep(campaign, flights, option) for option in campaign.swept], 4.2 * len(campaign.swept), 3.2)


def spread(flights, runs, name, label, honest=None):
    def draw(axes):
        data = [[float(f[name]) for f in flights if f["run"] == run and f.get(name) is not None] for run in runs]
        if not any(data):
            return
        axes.boxplot([d or [float("nan")] for d in data], vert=False)
        axes.set_yticks(range(1, len(runs) + 1), runs)
        axes.set_xlabel(label)
        if honest is not None:
            axes.axvline(honest, color=COLOURS[2], linestyle="--")

    return picture(draw, height=1.2 + 0.5 * len(runs))


def number(value):
    if value is None or value == "":
        return "-"
    value = float(value)
    return f"{value:.3f}" if abs(value) < 10 else f"{value:.0f}"


def cost(campaign):
    """What this campaign took, and what 100,000 flights of its kind would: one row each, from the jobs' logs."""
    import glob
    import re

    spent = {"simulated": [], "flown": []}
    for path in glob.glob("logs/*.txt"):
        with open(path, encoding="utf-8", errors="replace") as text:
            times = [float(t) for t in re.findall(r"^# status -?\d+, cpu_s ([0-9.]+)$", text.read(), re.M)]
        if times:
            spent["simulated" if os.path.basename(path).startswith("simulate-") else "flown"].append(sum(times))
    flown = campaign.flown()
    sizes = [os.path.getsize(p) for p in flown]
    flights = len({os.path.basename(p) for p in flown})
    if not spent["flown"] or not sizes:
        return []
    hours = sum(map(sum, spent.values())) / 3600
    bytes_ = sum(sizes)
    rows = []
    for n, name in ((flights, f"these {flights} flights"), (100000, "100,000 flights")):
        scale = n / flights
        rows.append({"": name, "core hours": f"{hours * scale:.2f}" if n == flights else f"{hours * scale:.0f}",
                     "results [MB]": f"{bytes_ * scale / 1e6:.0f}", "on 1,000 cores [h]": f"{hours * scale / 1000:.2f}"})
    return rows


def as_table(rows, columns):
    head = "".join(f"<th>{html.escape(c)}</th>" for c in columns)
    body = ""
    for row in rows:
        cells = ""
        for c in columns:
            value = row.get(c)
            cells += f"<td>{html.escape(number(value) if isinstance(value, float) else '-' if value is None else str(value))}</td>"
        body += f"<tr>{cells}</tr>"
    return f"<table><tr>{head}</tr>{body}</table>"


def write_page(campaign, path):
    flights, trunks, failures = collect(campaign, campaign.flown())
    runs = [r for r in campaign.runs if any(f["run"] == r for f in flights)]
    parts = [f"<h1>{html.escape(campaign.name)}</h1>",
             f"<p>{len(flights)} of {len(campaign.results())} results, {len(failures)} failed. "
             f"Intervals hold 95 %; whole flights are drawn anew for them, since trunks of one flight go together.</p>"]
    summary = summaries(campaign, flights)
    wide = []
    for row in summary:
        if row["stratum"] == "all":
            wide.append({**row, "estimate": row["estimate"], "interval": f"{number(row['low'])} to {number(row['high'])}"})
    parts += ["<h2>All flights</h2>", as_table(wide, ["run", "measure", "estimate", "interval", "flights"])]
    parts += ["<h2>Compared, the same seeds</h2>", as_table(comparisons(campaign, flights, trunks),
                                                            ["a", "b", "measure", "pairs", "effect", "low", "high", "test", "p"])]
    parts += ["<h2>Pictures</h2>",
              recall_by(trunks, runs, "min_range_m", [0, 1, 2, 3, 4, 5, 6, 7, 8], "nearest range [m]"),
              recall_by(trunks, runs, "bearing_change_deg", [3, 5, 8, 12, 20, 30, 45, 60, 90], "change of bearing [degrees]"),
              reliability(trunks, runs),
              errors_by(trunks, flights, runs, "radius_m", "radius_error_m", "radius [m]"),
              errors_by(trunks, flights, runs, "light", "radius_error_m", "light"),
              errors_by(trunks, flights, runs, "min_range_m", "position_error_m", "nearest range [m]"),
              spread(flights, runs, "nees_half", "NEES/2 of trunks by flight (1 is honest)", 1),
              spread(flights, runs, "position_median_m", "median position error by flight [m]"),
              spread(flights, runs, "radius_rmse_m", "radius RMSE by flight [m]"),
              spread(flights, runs, "ate_m", "ATE after x, y, yaw [m]")]
    curves = sweeps(campaign, flights) if campaign.swept else None
    if curves:
        with open("sweeps.svg", "wb") as svg:
            svg.write(curves)
        parts += ["<h2>Sweeps</h2>", embedded(curves)]
    parts += ["<h2>By stratum</h2>", as_table([r for r in summary if r["stratum"] != "all" and r["measure"] in
                                               ("recall", "precision", "position_median_m", "radius_rmse_m", "nees_half", "succeeded")],
                                              ["run", "stratum", "value", "measure", "estimate", "low", "high", "flights"])]
    bill = cost(campaign)
    if bill:
        parts += ["<h2>Cost</h2>", as_table(bill, list(bill[0]))]
    if failures:
        parts += ["<h2>Failed</h2>", as_table(failures, ["run", "flight", "status", "log"])]
    style = ("body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:72em;padding:0 1em}table{border-collapse:collapse;font-size:13px}"
             "td,th{border-bottom:1px solid #ccc;padding:.2em .8em;text-align:left}img{max-width:100%}")
    text = (f'<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
            f"<title>{html.escape(campaign.name)}</title><style>{style}</style></head><body>{''.join(parts)}</body></html>")
    with open(path + ".partial", "w", encoding="utf-8") as out:
        out.write(text)
    os.replace(path + ".partial", path)
