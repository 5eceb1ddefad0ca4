#!/usr/bin/env python3
"""Formatting, include rule, file sizes and clang-tidy over the product's sources.

usage: lint.py --build FOLDER [--all] [--plugin FILE]

FOLDER is a configured build folder (its compile_commands.json says how each file is compiled). A
file that clang-tidy passed is not checked again until it, a header of ours that it reaches, its
compile command, the checks or clang-tidy itself change; --all forgets that. The plugin (tidy_scope.cpp)
keeps the checks out of system headers, whose findings nobody sees.
"""
import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

ROOT = os.path.realpath(os.path.join(os.path.dirname(__file__), "..", ".."))
FORMAT, TIDY = "clang-format-19", "clang-tidy-19"
PRODUCT = ("protocol/", "firmware/", "host_sdk/", "simulator/", "tools/")
INCLUDE = re.compile(rb'^\s*#\s*include\s*"([^"]+)"', re.MULTILINE)
NOISE = re.compile(r"^\d+ warnings? (generated|treated as errors?)|^Suppressed |^Use -header-filter|^\s*$")


def tracked(*patterns):
    listing = subprocess.run(["git", "ls-files", "-z", "--", *patterns], cwd=ROOT, capture_output=True, check=True)
    names = [name for name in listing.stdout.decode().split("\0") if name]
    return [name for name in names if os.path.exists(os.path.join(ROOT, name))]


def check_format():
    files = tracked("*.h", "*.cpp")
    result = subprocess.run([FORMAT, "--dry-run", "-Werror", *files], cwd=ROOT, capture_output=True, text=True)
    if result.returncode == 0:
        print(f"format: {len(files)} files kept")
        return True
    wrong = sorted(set(re.findall(r"^(\S+?):\d+:\d+: error:", result.stderr, re.MULTILINE)))
    for name in wrong:
        print(f"{name}: not formatted")
    print(f"format: {len(wrong)} files; remedy: {FORMAT} -i {' '.join(wrong)}")
    return False


def check_script(*command):
    return subprocess.run([sys.executable, *command], cwd=ROOT).returncode == 0


def read(name):
    with open(os.path.join(ROOT, name), "rb") as file:
        return file.read()


def headers_of_ours(name, seen):
    """Every header of the repository that this file reaches, itself included."""
    if name in seen or not os.path.exists(os.path.join(ROOT, name)):
        return
    seen.add(name)
    for target in INCLUDE.findall(read(name)):
        headers_of_ours(target.decode(), seen)


def key_of(entry, name, common):
    digest = hashlib.sha256(common)
    digest.update(entry["command"].encode())
    reached = set()
    headers_of_ours(name, reached)
    for header in sorted(reached):
        digest.update(header.encode() + b"\0" + read(header))
    return digest.hexdigest()


def tidy(build, plugin, name):
    # The compiler's own warnings are g++'s business (-Werror in the build); here only the checks count.
    command = [TIDY, "--quiet", "-p", build, "--extra-arg=-Wno-everything", os.path.join(ROOT, name)]
    if plugin:
        command.insert(1, "--load=" + os.path.abspath(plugin))
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    lines = [line for line in (result.stdout + result.stderr).splitlines() if not NOISE.match(line)]
    text = "\n".join(lines).replace(ROOT + "/", "")
    return result.returncode == 0, text


def check_tidy(build, everything, plugin):
    with open(os.path.join(build, "compile_commands.json"), encoding="utf-8") as file:
        commands = json.load(file)
    ours = set(tracked("*.cpp"))
    entries = {}
    for entry in commands:
        name = os.path.relpath(os.path.realpath(entry["file"]), ROOT)
        if name in ours and name.startswith(PRODUCT):
            entries.setdefault(name, entry)
    version = subprocess.run([TIDY, "--version"], capture_output=True, check=True).stdout
    common = version + read(".clang-tidy")
    passed_folder = os.path.join(build, "tidy_passed")
    os.makedirs(passed_folder, exist_ok=True)
    keys = {name: key_of(entry, name, common) for name, entry in entries.items()}
    waiting = [n for n in sorted(entries) if everything or not os.path.exists(os.path.join(passed_folder, keys[n]))]
    # Long files first, so that no core waits for one of them at the end.
    waiting.sort(key=lambda name: -len(read(name)))
    failed = 0
    begin = time.monotonic()
    with ThreadPoolExecutor(max_workers=os.cpu_count() or 2) as pool:
        for name, (good, text) in zip(waiting, pool.map(lambda n: tidy(build, plugin, n), waiting)):
            if good:
                open(os.path.join(passed_folder, keys[name]), "w").close()
            else:
                failed += 1
                print(text, flush=True)
    # Keys of older versions of the files are of no more use.
    for old in set(os.listdir(passed_folder)) - set(keys.values()):
        os.remove(os.path.join(passed_folder, old))
    seconds = time.monotonic() - begin
    print(f"clang-tidy: {len(entries)} files, {len(waiting)} checked in {seconds:.0f} s, {failed} with complaints")
    return failed == 0


def main():
    parser = argparse.ArgumentParser(description="Checks style and structure of the tree.")
    parser.add_argument("--build", required=True, help="configured build folder")
    parser.add_argument("--all", action="store_true", help="check files again that passed before")
    parser.add_argument("--plugin", help="shared library for clang-tidy to load")
    options = parser.parse_args()
    good = [
        check_format(),
        check_script("tests/structure/include_rule.py", ROOT),
        check_script("tests/structure/file_sizes.py", ROOT),
        subprocess.run(["bash", "-n", "run"], cwd=ROOT).returncode == 0,
        check_tidy(os.path.abspath(options.build), options.all, options.plugin),
    ]
    print("lint: passed" if all(good) else "lint: failed")
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main())
