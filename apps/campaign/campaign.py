# SPDX-License-Identifier: GPL-2.0-or-later
"""A campaign: what is flown, as the Snakefile beside it asks."""
import itertools
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
