#!/usr/bin/env python3
"""Fails when a source file is longer than 500 lines and does not say why it is one file.

The first comment of a longer file must hold the words "one file because".

usage: file_sizes.py ROOT
"""
import os
import sys

LIMIT = 500
SKIPPED = {".git", "build", "out", "__pycache__"}


def first_comment(lines):
    words = []
    for line in lines:
        text = line.strip()
        if not text.startswith(("//", "#!", "# ", "/*", "*", '"""')) and text:
            break
        words.append(text.lstrip("/#* "))
    return " ".join(words)


def main(root):
    complaints = []
    for folder, names, files in os.walk(root):
        names[:] = [n for n in names if n not in SKIPPED]
        for name in files:
            if not name.endswith((".h", ".cpp", ".c", ".py")):
                continue
            path = os.path.join(folder, name)
            with open(path, encoding="utf-8") as file:
                lines = file.readlines()
            if len(lines) > LIMIT and "one file because" not in first_comment(lines).lower():
                complaints.append(f"{os.path.relpath(path, root)}: {len(lines)} lines; split it by noun, or begin it "
                                  'with a comment that says "one file because ..."')
    for complaint in sorted(complaints):
        print(complaint)
    print(f"file sizes: {len(complaints)} too long" if complaints else "file sizes: kept")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
