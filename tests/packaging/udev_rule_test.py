#!/usr/bin/env python3
"""Reads the udev rule as udev does: every line a list of KEY OPERATOR "VALUE", every GOTO with its LABEL, a number below
that of the rule that acts on the tag uaccess, and the numbers of protocol/usb_identity.h. Where udevadm can verify rules
(systemd 254 and later), it does.

usage: udev_rule_test.py SOURCE
"""
import os
import re
import shutil
import subprocess
import sys

# systemd's rules.d/73-seat-late.rules.in runs the builtin uaccess on devices that have the tag by then.
ACTS_ON_TAG = 73
PAIR = re.compile(r'\s*([A-Z_]+(?:\{[^}]*\})?)(==|!=|\+=|-=|:=|=)"([^"]*)"\s*(,|$)')
MATCHES = {"ACTION", "SUBSYSTEM", "ENV", "ATTR", "ATTRS"}
ASSIGNS = {"GOTO", "LABEL", "MODE", "TAG", "ENV"}


def pairs_of(line):
    at = 0
    while at < len(line):
        match = PAIR.match(line, at)
        if match is None:
            raise ValueError(f"cannot be read from here on: {line[at:]}")
        yield match.group(1), match.group(2), match.group(3)
        at = match.end()
        if match.group(4) == "," and not line[at:].strip():
            raise ValueError("ends with a comma")


def number(text, name):
    return int(re.search(rf"{name} = (0x[0-9A-Fa-f]+);", text).group(1), 16)


def complaints(path, identity):
    if int(os.path.basename(path).split("-")[0]) >= ACTS_ON_TAG:
        yield f"{os.path.basename(path)} does not sort before {ACTS_ON_TAG}-seat-late.rules, so its tag has no effect"
    labels, gotos, rules = set(), set(), []
    with open(path, encoding="utf-8") as file:
        for row, line in enumerate(file.read().splitlines(), 1):
            if not line or line.startswith("#"):
                continue
            try:
                pairs = list(pairs_of(line))
            except ValueError as error:
                yield f"line {row}: {error}"
                continue
            for key, operator, value in pairs:
                name = key.split("{")[0]
                if name not in (MATCHES if operator in ("==", "!=") else ASSIGNS):
                    yield f"line {row}: {key}{operator} is nothing that udev knows"
                labels |= {value} if key == "LABEL" else set()
                gotos |= {value} if key == "GOTO" else set()
            rules.append({key + operator: value for key, operator, value in pairs})
    if gotos - labels:
        yield f"no LABEL for {' '.join(gotos - labels)}"
    vendor, product, dfu = (f"{number(identity, name):04x}" for name in ("kVendorId", "kProductId", "kDfuProductId"))
    for subsystem, prefix, products in (("usb", "ATTR", [product, dfu]), ("hidraw", "ATTRS", [product])):
        fitting = [rule for rule in rules if rule.get("SUBSYSTEM==") == subsystem]
        if len(fitting) != 1:
            yield f"{len(fitting)} rules for {subsystem}, expected 1"
            continue
        rule = fitting[0]
        found = (rule.get(prefix + "{idVendor}=="), rule.get(prefix + "{idProduct}==", "").split("|"))
        if found != (vendor, products):
            yield f"{subsystem}: matches {found}, expected {(vendor, products)}"
        if (rule.get("TAG+="), rule.get("MODE=")) != ("uaccess", "0660"):
            yield f"{subsystem}: gives no access to whoever sits at the computer, or to others as well: {rule}"
        if subsystem == "usb" and rule.get("ENV{ID_MM_DEVICE_IGNORE}=") != "1":
            yield "usb: ModemManager is not told to leave instruments alone"


def verified(path):
    """What udevadm says against it; nothing where it cannot verify."""
    if shutil.which("udevadm") is None:
        return []
    if "verify" not in subprocess.run(["udevadm", "--help"], capture_output=True, text=True).stdout:
        return []
    done = subprocess.run(["udevadm", "verify", path], capture_output=True, text=True)
    return [] if done.returncode == 0 else [done.stdout + done.stderr]


def main(source):
    path = os.path.join(source, "tools/packaging/udev/60-openscatter.rules")
    with open(os.path.join(source, "protocol/usb_identity.h"), encoding="utf-8") as file:
        found = list(complaints(path, file.read())) + verified(path)
    for complaint in found:
        print(complaint)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
