#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Runs one flight of a campaign and leaves one small file: the result, or why there is none.

A job that fails is a result too: it must not stop the others. So this program ends with 0 unless it was itself
interrupted; what a command printed stands in the log, its exit status in the result."""
import argparse
import json
import os
import subprocess
import sys
import tempfile
import time


def run(command, log):
    began = os.times()
    with open(log, "a", encoding="utf-8") as out:
        out.write("$ " + " ".join(command) + "\n")
        out.flush()
        status = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT, check=False).returncode
    used = os.times()
    cpu_s = used.children_user + used.children_system - began.children_user - began.children_system
    with open(log, "a", encoding="utf-8") as out:
        out.write(f"\n# status {status}, cpu_s {cpu_s:.2f}\n")
    return status


def write_atomically(path, value):
    os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
    with tempfile.NamedTemporaryFile("w", dir=os.path.dirname(path) or ".", delete=False, encoding="utf-8") as out:
        json.dump(value, out)
    os.replace(out.name, path)


def load(path):
    try:
        with open(path, encoding="utf-8") as text:
            return json.load(text)
    except (OSError, ValueError):
        return None


def track(arguments, command):
    """bole track and bole evaluate into a folder that goes again; exit status 3 (not to be trusted) is a result."""
    with tempfile.TemporaryDirectory(prefix="bole-campaign-") as folder:
        flown = os.path.join(folder, "run")
        status = run([arguments.bole, "track", arguments.track, "-o", flown, "--no-video", *command], arguments.log)
        result = {"track_status": status, "summary": load(os.path.join(flown, "summary.json"))}
        has_truth = os.path.exists(os.path.join(arguments.track, "trees.csv"))
        if status in (0, 3) and has_truth:
            result["evaluate_status"] = run([arguments.bole, "evaluate", flown, arguments.track], arguments.log)
            result["evaluation"] = load(os.path.join(flown, "evaluation.json"))
        result["ok"] = status in (0, 3) and (not has_truth or result.get("evaluation") is not None)
        return result


def servo(arguments, command):
    with tempfile.TemporaryDirectory(prefix="bole-campaign-") as folder:
        status = run([arguments.bole, "servo", *command, "--no-video", "-o", folder], arguments.log)
        tables = [name for name in os.listdir(folder) if name.endswith(".json")]
        result = {"servo_status": status, "servo": load(os.path.join(folder, sorted(tables)[0])) if tables else None}
        result["ok"] = status in (0, 3) and result["servo"] is not None
        return result


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--log", required=True)
    parser.add_argument("--json")
    parser.add_argument("--folder", help="what a simulation writes")
    parser.add_argument("--track", help="the flight to be tracked")
    parser.add_argument("--servo", action="store_true")
    parser.add_argument("--bole")
    parser.add_argument("command", nargs="*")
    arguments = parser.parse_args()
    os.makedirs(os.path.dirname(arguments.log) or ".", exist_ok=True)
    open(arguments.log, "w", encoding="utf-8").close()
    began = time.time()
    if arguments.folder:
        status = run(arguments.command, arguments.log)
        if status != 0:
            os.makedirs(arguments.folder, exist_ok=True)  # an empty flight: what reads it says that it failed
        return 0 if status >= 0 else 128 - status
    result = servo(arguments, arguments.command) if arguments.servo else track(arguments, arguments.command)
    used = os.times()
    result.update(log=arguments.log, command=arguments.command, wall_s=round(time.time() - began, 2),
                  cpu_s=round(used.children_user + used.children_system, 2))
    write_atomically(arguments.json, result)
    return 0


if __name__ == "__main__":
    sys.exit(main())
