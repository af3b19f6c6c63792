#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Runs the tutorials as they are printed, and compares the page of options and the README with what the command prints.
Every other command that a page prints is held against the help of the command: its name and its options must exist.
Each page's `sh` blocks run in one shell, in a folder that has data/ as the sources
have; a `cpp` block before them is built against the build tree as ./tutorial. `py` blocks run in one
Python (skipped without the module). Blocks without a language are not run.

usage: tutorials.py BUILD_FOLDER SOURCE_FOLDER [PAGE...]"""
import glob
import os
import re
import subprocess
import sys
import tempfile

CMAKE = """cmake_minimum_required(VERSION 3.24)
project(tutorial CXX)
find_package(bole REQUIRED)
add_executable(tutorial tutorial.cpp)
target_link_libraries(tutorial PRIVATE bole::bole)
"""


def run(command, folder, environment):
    done = subprocess.run(command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
                          timeout=500)
    return done.returncode, done.stdout


def compile_program(text, folder, build, environment):
    program = os.path.join(folder, "program")
    os.makedirs(program)
    for name, content in (("CMakeLists.txt", CMAKE), ("tutorial.cpp", text)):
        with open(os.path.join(program, name), "w", encoding="utf-8") as out:
            out.write(content)
    for command in (["cmake", "-S", ".", "-B", "build", "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", f"-Dbole_DIR={build}"],
                    ["cmake", "--build", "build"]):
        status, output = run(command, program, environment)
        if status != 0:
            return status, output
    os.symlink("program/build/tutorial", os.path.join(folder, "tutorial"))
    return 0, ""


def text_of(path):
    with open(path, encoding="utf-8") as text:
        return text.read()


def timeless(text):
    return re.sub(r"[0-9.]+ ms", "some ms", text)


def check_readme(build, source, environment):
    """The README's first block without a language is what the commands of `./setup.sh demo` print, but for the time. Its
    second one, which maps a video walk.mp4, is run on the overlay of that flight."""
    commands = re.findall(r"^  (\./bole .*)$", text_of(os.path.join(source, "setup.sh")), re.M)
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", text_of(os.path.join(source, "README.md")), re.S | re.M)
    block, own_video = [text for language, text in blocks if not language][:2]
    with tempfile.TemporaryDirectory(prefix="bole-demo-") as folder:
        os.symlink(os.path.join(source, "data"), os.path.join(folder, "data"))
        os.symlink(os.path.join(build, "bole"), os.path.join(folder, "bole"))
        status, printed = run(["sh", "-e", "-c", "\n".join(commands)], folder, environment)
        if status != 0 or timeless(printed) != timeless(block):
            print(f"README.md: FAILED, `./setup.sh demo` prints\n{printed}")
            return 1
        os.rename(os.path.join(folder, "run/overlay.mp4"), os.path.join(folder, "walk.mp4"))
        status, printed = run(["sh", "-e", "-c", own_video], folder, environment)
    if status in (0, 3) and "report.html" in printed:  # 3: the overlay is a video of lines too, and need not be trusted
        return 0
    print(f"README.md: FAILED, `{own_video.strip()}` ends with {status} and prints\n{printed}")
    return 1


def commands_of(text):
    """The commands of bole that a page prints, in its blocks and between backticks: name and arguments."""
    blocks = re.findall(r"^```\w*\n(.*?)^```$|^((?: {4}\S.*\n)+)", text, re.S | re.M)
    spans = re.findall(r"`([^`\n]+)`", re.sub(r"^```.*?^```$", "", text, flags=re.S | re.M))
    for line in [line for pair in blocks for part in pair for line in part.split("\n")] + spans:
        for command in re.split(r" && | \|\|? | *; *|\$ ", line.split(" # ")[0].replace(" |", " | ")):
            words = re.match(r"(?:\S*/)?bole ([a-z][a-z-]+)( .*)?$", command.strip())
            if words:
                yield words.group(1), (words.group(2) or "").split()


def options_of(command, source, environment):
    """The exit status of a command's help, and the options that it and the commands below it name."""
    status, text = run(["bole", *command, "--help"], source, environment)
    known = set(re.findall(r"(?<![\w-])-{1,2}[a-z][\w-]*", text))
    below = re.findall(r"^  ([a-z]\S*) ", text.partition("\nSubcommands:\n")[2], re.M)
    for name in below:
        known |= options_of([*command, name], source, environment)[1]
    return status, known


def check_commands(source, environment):
    """Every command of bole that any page prints exists, and so do its options."""
    helps, failed = {}, 0
    pages = [os.path.join(source, p) for p in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "models/README.md")]
    for page in pages + sorted(glob.glob(os.path.join(source, "src/doc/*.md"))):
        for name, words in commands_of(text_of(page)):
            if name not in helps:
                helps[name] = options_of([name], source, environment)
            status, known = helps[name]
            for word in [name, *words]:
                option = word.split("=")[0]
                if status != 0 or (re.match(r"-{1,2}[a-z]", option) and option not in known):
                    print(f"{os.path.basename(page)}: FAILED, `bole {name}` knows no `{option}`")
                    failed += 1
    return failed


def main():
    build, source = (os.path.abspath(p) for p in sys.argv[1:3])
    pages = sys.argv[3:] or sorted(glob.glob(os.path.join(source, "src/doc/tutorial-*.md")))
    environment = dict(os.environ, PATH=build + ":" + os.environ["PATH"], PYTHONPATH=build + "/python")
    failed = check_readme(build, source, environment) + check_commands(source, environment)
    if run(["bole", "options", "--markdown"], source, environment)[1] not in text_of(os.path.join(source, "src/doc/options.md")):
        print("options.md: FAILED, it is not what `bole options --markdown` prints")
        failed += 1
    for page in pages:
        blocks = re.findall(r"^```(sh|cpp|py)\n(.*?)^```$", text_of(page), re.S | re.M)
        with tempfile.TemporaryDirectory(prefix="bole-tutorial-") as folder:
            os.symlink(os.path.join(source, "data"), os.path.join(folder, "data"))
            shell, python, status, output = "set -eu\n", "", 0, ""
            for language, text in blocks:
                if language == "cpp":
                    status, output = compile_program(text, folder, build, environment)
                elif language == "py":
                    python += text
                else:
                    shell += text
            if python and not os.path.isdir(os.path.join(build, "python")):
                print(f"{os.path.basename(page)}: skipped, pybind11-dev is not installed")
                continue
            if python and status == 0:
                status, output = run(["/usr/bin/python3", "-c", python], folder, environment)
            if status == 0:
                status, output = run(["bash", "-c", shell], folder, environment)
            print(f"{os.path.basename(page)}: {'passed' if status == 0 else 'FAILED'}, {len(blocks)} blocks", flush=True)
            if status != 0:
                failed += 1
                print(output)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
