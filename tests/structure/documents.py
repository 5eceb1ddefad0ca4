#!/usr/bin/env python3
"""Fails when a document lies: a link to nothing, or a program that differs from the one that is built.

A fenced block that follows a line `<!-- file: PATH -->` must equal that file, comments of the first
lines included; the tests build and run the file.

usage: documents.py ROOT
"""
import os
import re
import sys

SKIPPED = {".git", "build", "out", "__pycache__"}
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
QUOTED = re.compile(r"<!-- file: (\S+) -->\n```\w*\n(.*?)```", re.DOTALL)


def documents(root):
    for folder, names, files in os.walk(root):
        names[:] = sorted(n for n in names if n not in SKIPPED)
        for name in sorted(files):
            if name.endswith(".md"):
                yield os.path.join(folder, name)


def heading_anchors(path):
    with open(path, encoding="utf-8") as file:
        for line in file:
            if line.startswith("#"):
                text = re.sub(r"[^\w\- ]", "", line.lstrip("#").strip().lower())
                yield text.replace(" ", "-")


def check(root):
    complaints = []
    for path in documents(root):
        name = os.path.relpath(path, root)
        with open(path, encoding="utf-8") as file:
            text = file.read()
        prose = re.sub(r"```.*?```", lambda m: "\n" * m.group(0).count("\n"), text, flags=re.DOTALL)
        prose = re.sub(r"`[^`\n]*`", "", prose)
        for number, line in enumerate(prose.splitlines(), 1):
            for link in LINK.findall(line):
                if re.match(r"[a-z]+:", link):
                    continue
                target, _, anchor = link.partition("#")
                full = os.path.normpath(os.path.join(os.path.dirname(path), target)) if target else path
                if not os.path.exists(full):
                    complaints.append(f"{name}:{number}: {target} does not exist")
                elif anchor and full.endswith(".md") and anchor not in heading_anchors(full):
                    complaints.append(f"{name}:{number}: {target} has no heading #{anchor}")
        for source, block in QUOTED.findall(text):
            full = os.path.join(root, source)
            if not os.path.exists(full):
                complaints.append(f"{name}: {source} does not exist")
                continue
            with open(full, encoding="utf-8") as file:
                if file.read() != block:
                    complaints.append(f"{name}: the program shown is not {source}; copy it anew")
    return complaints


def main(root):
    complaints = check(root)
    for complaint in complaints:
        print(complaint)
    print(f"documents: {len(complaints)} complaints" if complaints else "documents: kept")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
