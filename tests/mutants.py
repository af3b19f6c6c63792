#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Mutation testing: would the tests notice if an operator were another one?

Takes operators of geometry, summary, smoothing and tracking at random, changes one at a time in a copy of the sources,
builds the library anew and runs the tests of the stage, then those of the stages above. A mutant that no test fails
survives: it is listed with its line, to be looked at. Mutants that do not compile are not counted.

  tests/mutants.py --count 100 --seed 1 -o mutants.csv        (half a minute a mutant)"""
import argparse
import csv
import math
import os
import random
import re
import shutil
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
STAGES = ("geometry", "summary", "smoothing", "tracking")
LATER = ("map", "mbt", "detection", "pipeline")  # they use these stages: asked when the stage's own tests pass
CHANGES = [(r" \+ ", " - "), (r" - ", " + "), (r" \* ", " / "), (r" / ", " * "), (r" \+= ", " -= "), (r" -= ", " += "),
           (r" < ", " >= "), (r" > ", " <= "), (r" <= ", " < "), (r" >= ", " > "), (r" == ", " != "), (r" != ", " == "),
           (r" && ", " || "), (r" \|\| ", " && "), (r"std::min\b", "std::max"), (r"std::max\b", "std::min"),
           (r"std::sin\b", "std::cos"), (r"std::cos\b", "std::sin"), (r"\bif \((?!const|auto)", "if (!("),
           (r"\btrue\b", "false"), (r"\bfalse\b", "true"), (r"(?<=[(= ])-(?=[a-zA-Z(])", "")]
NOT_CODE = re.compile(r"^\s*(//|#|\*|using |namespace |template|static_assert|assert)|throw |fmt::format|std::string")


def mutants_of(path):
    """(path, line number, line, mutated line) for every operator that can be changed."""
    with open(path, encoding="utf-8") as text:
        lines = text.read().split("\n")
    for number, line in enumerate(lines):
        code = line.split("//")[0]
        if NOT_CODE.search(code) or '"' in code:
            continue
        for pattern, other in CHANGES:
            for hit in re.finditer(pattern, code):
                changed = code[: hit.start()] + other + code[hit.end():]
                if other == "if (!(":  # the condition ends where its parenthesis does
                    depth, end = 1, hit.end()
                    while end < len(code) and depth:
                        depth += {"(": 1, ")": -1}.get(code[end], 0)
                        end += 1
                    if depth:
                        continue
                    changed = code[: hit.start()] + "if (!(" + code[hit.end(): end] + ")" + code[end:]
                yield path, number, line, changed


def run(command, timeout, **kwargs):
    try:
        return subprocess.run(command, timeout=timeout, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **kwargs).returncode
    except subprocess.TimeoutExpired:
        return -1


def build(folder, *targets):
    return run(["cmake", "--build", folder, "--target", *targets], 3600) == 0


def fails(folder, name):
    """Whether the tests of a stage notice something; an endless loop is noticed, too."""
    return run([f"./test_{name}", "--gtest_fail_fast", "--gtest_brief=1"], 300, cwd=folder) != 0


def killer_of(folder, stage):
    """The test program that notices, "" when none does."""
    return next((name for name in (stage, *LATER) if fails(folder, name)), "")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=40, help="mutants")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--least", type=float, default=0.85, help="share that must be noticed, else status 1")
    parser.add_argument("--folder", default=os.path.join(ROOT, "build/mutants"), help="for the copy and its build")
    parser.add_argument("-o", "--output", help="table of all mutants (CSV)")
    arguments = parser.parse_args()

    source, binary = os.path.join(arguments.folder, "source"), os.path.join(arguments.folder, "build")
    shutil.rmtree(source, ignore_errors=True)
    os.makedirs(source)
    archive = subprocess.run(["git", "-C", ROOT, "archive", "HEAD"], check=True, stdout=subprocess.PIPE).stdout
    subprocess.run(["tar", "-x", "-C", source], check=True, input=archive)
    tests = [f"test_{name}" for name in (*STAGES, *LATER)]
    launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
    if run(["cmake", "-S", source, "-B", binary, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
            "-DCMAKE_CXX_FLAGS_RELEASE=-O1", "-DBOLE_BUILD_TESTS=ON", *launcher], 600) or not build(binary, *tests):
        sys.exit(f"{arguments.folder}: the sources as they are do not build")
    for name in (*STAGES, *LATER):
        if fails(binary, name):
            sys.exit(f"test_{name} fails on the sources as they are")

    found = []
    for stage in STAGES:
        folder = os.path.join(source, "src", stage)
        for name in sorted(os.listdir(folder)):
            if name.endswith(".cpp"):
                found += [(stage, *mutant) for mutant in mutants_of(os.path.join(folder, name))]
    random.Random(arguments.seed).shuffle(found)
    rows = []
    for stage, path, number, line, changed in found:
        if len(rows) == arguments.count:
            break
        with open(path, encoding="utf-8") as text:
            original = text.read()
        lines = original.split("\n")
        lines[number] = changed
        with open(path, "w", encoding="utf-8") as text:
            text.write("\n".join(lines))
        compiles = build(binary, "bole_library")
        killer = killer_of(binary, stage) if compiles else ""
        with open(path, "w", encoding="utf-8") as text:
            text.write(original)
        if not compiles:
            continue
        rows.append([os.path.relpath(path, source), number + 1, line.strip(), changed.strip(), killer])
        print(f"{len(rows)} {'killed by test_' + killer if killer else 'SURVIVED'}: {rows[-1][0]}:{number + 1}: {changed.strip()}",
              flush=True)
    build(binary, "bole_library")
    killed = sum(1 for row in rows if row[4])
    share, n = killed / len(rows), len(rows)
    error = math.sqrt(share * (1 - share) / n)
    print(f"{killed} of {n} mutants noticed ({share:.2f} +- {error:.2f}), of {len(found)} that there are")
    if arguments.output:
        with open(arguments.output, "w", encoding="utf-8", newline="") as out:
            writer = csv.writer(out)
            writer.writerow(["file", "line", "code", "mutant", "noticed_by"])
            writer.writerows(rows)
    return 0 if share >= arguments.least else 1


if __name__ == "__main__":
    sys.exit(main())
