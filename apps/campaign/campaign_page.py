# SPDX-License-Identifier: GPL-2.0-or-later
"""The page of a campaign: its tables with plots."""
import base64
import glob
import html
import io
import os
import re

import matplotlib
from campaign_tables import COMPARE, FAILURES, SUMMARY, collect, comparisons, summaries, wilson

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"]  # Okabe and Ito


def drawn(draws, width, height):
    """SVG of what each of \p draws puts onto axes of its own, with a legend of what the first named; None where nothing was
    drawn."""
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
            mine = [t for t in trunks if t["run"] == run and t.get(key) is not None and (t["kind"] == "missed" or t.get("expected"))]
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
            mine = [t for t in trunks if t["run"] == run and t["kind"] != "missed" and t.get("probability") is not None]
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
                    if t["run"] == run and t["kind"] == "matched" and t.get(error) is not None]
            mine = [(k, e) for k, e in mine if k is not None]
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
    if value is None:
        return "-"
    value = float(value)
    return f"{value:.3f}" if abs(value) < 10 else f"{value:.0f}"


def cost(campaign):
    """What this campaign took, and what 100,000 flights of its kind would: one row each, from the jobs' logs."""
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
    text = lambda value: number(value) if isinstance(value, float) else "-" if value is None else str(value)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(text(row.get(c)))}</td>" for c in columns) + "</tr>" for row in rows)
    return f"<table><tr>{head}</tr>{body}</table>"


def write_page(campaign, path):
    flights, trunks, failures = collect(campaign, campaign.flown())
    runs = [r for r in campaign.runs if any(f["run"] == r for f in flights)]
    parts = [f"<h1>{html.escape(campaign.name)}</h1>",
             f"<p>{len(flights)} of {len(campaign.results())} results, {len(failures)} failed. "
             f"Intervals hold 95 %; whole flights are drawn anew for them, since trunks of one flight go together.</p>"]
    summary = summaries(campaign, flights)
    wide = [{**row, "interval": f"{number(row['low'])} to {number(row['high'])}"} for row in summary if row["stratum"] == "all"]
    parts += ["<h2>All flights</h2>", as_table(wide, ["run", "measure", "estimate", "interval", "flights"])]
    parts += ["<h2>Compared, the same seeds</h2>", as_table(comparisons(campaign, flights, trunks), COMPARE)]
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
                                              SUMMARY)]
    bill = cost(campaign)
    if bill:
        parts += ["<h2>Cost</h2>", as_table(bill, list(bill[0]))]
    if failures:
        parts += ["<h2>Failed</h2>", as_table(failures, FAILURES)]
    style = ("body{font:15px/1.5 system-ui,sans-serif;margin:2em auto;max-width:72em;padding:0 1em}table{border-collapse:collapse;font-size:13px}"
             "td,th{border-bottom:1px solid #ccc;padding:.2em .8em;text-align:left}img{max-width:100%}")
    text = (f'<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
            f"<title>{html.escape(campaign.name)}</title><style>{style}</style></head><body>{''.join(parts)}</body></html>")
    with open(path + ".partial", "w", encoding="utf-8") as out:
        out.write(text)
    os.replace(path + ".partial", path)
