#!/usr/bin/env python3
"""Fails when an include crosses a line that the architecture does not allow.

The table below is the architecture's list of arrows (docs/README.md): a folder may include its own
headers, those of the folders named in its row, and what those may include in turn.

usage: include_rule.py [ROOT]       checks the tree, prints file:line and the broken rule
       include_rule.py --self-test  proves on a made-up tree that each kind of breach is caught
"""
import os
import re
import sys
import tempfile

ARROWS = {
    "protocol": [],
    "firmware/ports": ["protocol"],
    "firmware/image": ["firmware/ports"],
    "firmware/core": ["firmware/ports", "firmware/image"],
    "firmware/core/usb": ["firmware/core"],
    "firmware/boot": ["firmware/core"],
    "firmware/crypto": ["firmware/ports", "firmware/keys"],
    "firmware/keys": ["protocol"],
    "firmware/backplane": ["protocol"],
    "firmware/boards": ["firmware/core", "firmware/boot", "firmware/crypto", "firmware/backplane"],
    "host_sdk/error": [],
    "host_sdk/simd": [],
    "host_sdk/memory": [],
    "host_sdk/reflectance": ["host_sdk/error", "host_sdk/memory"],
    "host_sdk/reflectance/models": ["host_sdk/reflectance"],
    "host_sdk/reflectance/search": ["host_sdk/reflectance"],
    "host_sdk/reflectance/fitting": ["host_sdk/reflectance/models"],
    "host_sdk/reflectance/estimators": ["host_sdk/reflectance/search", "host_sdk/reflectance/fitting"],
    "host_sdk/images": ["host_sdk/error"],
    "host_sdk/formats": ["host_sdk/reflectance/models", "host_sdk/images"],
    "host_sdk/firmware_files": ["host_sdk/error", "protocol"],
    "host_sdk/device": ["host_sdk/error", "protocol", "host_sdk/firmware_files"],
    "host_sdk/device/usb": ["host_sdk/device"],
    "host_sdk/measurement": ["host_sdk/device", "host_sdk/reflectance", "host_sdk/simd"],
    "host_sdk/c_api": ["host_sdk/measurement", "host_sdk/formats", "host_sdk/reflectance/estimators"],
    "host_sdk/python": ["host_sdk/c_api"],
    "simulator/random": [],
    "simulator/corrosion": ["simulator/random", "host_sdk/error", "host_sdk/simd"],
    "simulator/samples": ["simulator/corrosion", "simulator/random", "host_sdk/formats"],
    "simulator/bench": ["simulator/samples", "simulator/random", "protocol"],
    "simulator/faults": ["simulator/random", "host_sdk/error", "firmware/ports"],
    "simulator/usb": ["simulator/faults", "firmware/core/usb"],
    "simulator/instrument": ["simulator/bench", "simulator/faults", "simulator/usb", "firmware/core", "firmware/core/usb",
                             "firmware/boot", "firmware/crypto"],
    "simulator/usbip": ["simulator/instrument"],
    "simulator/emulator": ["simulator/instrument", "firmware/backplane", "host_sdk/firmware_files"],
    # Tools and the documents' examples stand on everything; "*" is every row above. A tool includes another only
    # where its row says so.
    "tools/plot": ["*"],
    "tools/render": ["*"],
    "tools/sim_scheme": ["*"],
    "tools/scatter": ["*", "tools/plot", "tools/render", "tools/sim_scheme"],
    "tools/studio": ["*", "tools/plot", "tools/render", "tools/sim_scheme"],
    "docs/examples": ["*", "tools/sim_scheme"],
    "tests": ["*", "tools/plot", "tools/render", "tools/sim_scheme", "tools/scatter"],
}

# The wire and the firmware run without an operating system and without a heap.
FREESTANDING = ("protocol", "firmware/ports", "firmware/image", "firmware/core", "firmware/core/usb", "firmware/boot", "firmware/backplane",
                "firmware/keys", "firmware/boards")
HOSTED = set(
    "iostream ostream istream sstream fstream iomanip locale regex string vector map set unordered_map "
    "unordered_set list deque queue stack memory functional any thread mutex shared_mutex condition_variable "
    "future chrono filesystem random stdexcept exception system_error cstdio stdio.h ctime time.h "
    "unistd.h fcntl.h pthread.h memory_resource".split()
)
# Slow to compile; a header that another room's sources reach and that includes one makes them all pay.
HEAVY = ("nlohmann/", "CLI/", "Eigen/", "ceres/", "spdlog/", "OpenEXR/", "tbb/", "oneapi/")

# Headers whose very purpose is a slow one; only .cpp files and tests may include them.
WRAPPERS = ("host_sdk/images/exr_stream.h",)

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
SKIPPED = {".git", "build", "out", "__pycache__"}


def room_of(path):
    """The row of ARROWS that holds this path, or None."""
    parts = path.split("/")
    for depth in (3, 2, 1):
        room = "/".join(parts[:depth])
        if len(parts) > depth and room in ARROWS:
            return room
    return None


def reachable(room):
    base = {name for name in ARROWS if not name.startswith(("tools/", "tests", "docs/"))}
    seen, waiting = set(), [room]
    while waiting:
        current = waiting.pop()
        if current in seen:
            continue
        seen.add(current)
        for target in ARROWS[current]:
            if target == "*":
                seen |= base
            else:
                waiting.append(target)
    return seen


def sources(root):
    for folder, names, files in os.walk(root):
        names[:] = sorted(n for n in names if n not in SKIPPED)
        for name in sorted(files):
            if name.endswith((".h", ".cpp", ".c")):
                yield os.path.relpath(os.path.join(folder, name), root).replace(os.sep, "/")


def includes_of(root, path):
    with open(os.path.join(root, path), encoding="utf-8") as text:
        for number, line in enumerate(text, 1):
            match = INCLUDE.match(line)
            if match:
                yield number, match.group(1), match.group(2)


def public_headers(root):
    """Headers that sources of another room reach; a room's own tests do not make a header public."""
    waiting = [target for path in sources(root) if room_of(path) != "tests"
               for _, _, target in includes_of(root, path) if room_of(target) not in (None, room_of(path))]
    public = set()
    while waiting:
        header = waiting.pop()
        if header not in public and os.path.exists(os.path.join(root, header)):
            public.add(header)
            waiting += [target for _, _, target in includes_of(root, header) if room_of(target)]
    return public


def breaches_of(root, path, allowed, public):
    room = room_of(path)
    if room is None:
        yield 1, "this folder has no row in tests/structure/include_rule.py"
        return
    for number, quote, target in includes_of(root, path):
        target_room = room_of(target)
        ours = target_room is not None and os.path.exists(os.path.join(root, target))
        if quote == '"' and not ours:
            yield number, f'"{target}" is no header of ours; our includes are written from the repository\'s root'
        elif ours and target_room not in allowed[room]:
            yield number, f"{room} may not include {target_room}: {target}"
        elif ours and "/internal/" in target and not path.startswith(target.split("/internal/")[0] + "/"):
            yield number, f"{target} is internal to {target.split('/internal/')[0]}"
        elif not ours and room in FREESTANDING and target in HOSTED:
            yield number, f"<{target}> needs a heap or an operating system; {room} has neither"
        elif target in WRAPPERS and path.endswith(".h") and room != "tests":
            yield number, f"{target} is too heavy for a header; include it in the .cpp"
        elif not ours and path in public and path not in WRAPPERS and target.startswith(HEAVY):
            yield number, f"<{target}> is too heavy for a header that other folders include; include it in the .cpp"


def check(root):
    allowed = {room: reachable(room) for room in ARROWS}
    public = public_headers(root)
    found = []
    for path in sources(root):
        for number, why in breaches_of(root, path, allowed, public):
            found.append(f"{path}:{number}: {why}")
    return found


def self_test():
    """Each entry: file, its one line, a word that the complaint must hold (None: allowed)."""
    cases = [
        ("protocol/a.h", "#include <cstdint>", None),
        ("firmware/core/a.cpp", '#include "protocol/a.h"', None),
        ("simulator/instrument/a.cpp", '#include "host_sdk/reflectance/a.h"', None),
        ("tools/scatter/a.cpp", '#include "simulator/instrument/a.h"', None),
        ("tests/unit/a.cpp", '#include "tools/plot/a.h"', None),
        ("host_sdk/reflectance/a.h", "// header", None),
        ("simulator/instrument/a.h", "// header", None),
        ("tools/plot/a.h", "// header", None),
        ("host_sdk/formats/a.h", "// header", None),
        ("host_sdk/device/internal/a.h", "// header", None),
        ("host_sdk/device/b.cpp", '#include "host_sdk/device/internal/a.h"', None),
        ("protocol/b.cpp", '#include "firmware/core/b.h"', "may not include"),
        ("firmware/core/b.h", '#include <vector>', "heap"),
        ("host_sdk/device/a.cpp", '  #  include "simulator/instrument/a.h"', "may not include"),
        ("host_sdk/device/c.cpp", '#include <host_sdk/reflectance/a.h>', "may not include"),
        ("host_sdk/measurement/a.cpp", '#include "host_sdk/formats/a.h"', "may not include"),
        ("host_sdk/measurement/b.cpp", '#include "host_sdk/device/internal/a.h"', "internal"),
        ("host_sdk/reflectance/c.h", "#include <nlohmann/json.hpp>", "heavy"),
        ("host_sdk/reflectance/d.h", '#include "host_sdk/reflectance/c.h"', None),
        ("host_sdk/formats/d.cpp", '#include "host_sdk/reflectance/d.h"', None),
        ("host_sdk/images/exr_stream.h", "#include <OpenEXR/ImfIO.h>", None),
        ("host_sdk/formats/e.cpp", '#include "host_sdk/images/exr_stream.h"', None),
        ("host_sdk/formats/e.h", '#include "host_sdk/images/exr_stream.h"', "too heavy for a header"),
        ("host_sdk/formats/private.h", "#include <nlohmann/json.hpp>", None),
        ("tests/unit/p.cpp", '#include "host_sdk/formats/private.h"', None),
        ("simulator/bench/a.cpp", '#include "tools/plot/a.h"', "may not include"),
        ("simulator/bench/b.cpp", '#include "sensor.h"', "repository's root"),
        ("tools/plot/b.cpp", '#include "tests/unit/t.h"', "may not include"),
        ("tests/unit/t.h", "// header", None),
        ("utils/a.h", "// header", "no row"),
    ]
    with tempfile.TemporaryDirectory() as root:
        for path, line, _ in cases:
            os.makedirs(os.path.dirname(os.path.join(root, path)), exist_ok=True)
            with open(os.path.join(root, path), "w", encoding="utf-8") as file:
                file.write(line + "\n")
        found = check(root)
    wrong = []
    for path, line, word in cases:
        complaints = [text for text in found if text.startswith(path + ":")]
        if word is None and complaints:
            wrong.append(f"allowed but refused: {complaints[0]}")
        if word is not None and not any(word in text for text in complaints):
            wrong.append(f"forbidden but not caught: {path}: {line}")
    return wrong


def main(arguments):
    if arguments == ["--self-test"]:
        complaints = self_test()
    else:
        here = os.path.dirname(os.path.abspath(__file__))
        complaints = check(arguments[0] if arguments else os.path.join(here, "..", ".."))
    for complaint in complaints:
        print(complaint)
    print(f"include rule: {len(complaints)} breaches" if complaints else "include rule: kept")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
