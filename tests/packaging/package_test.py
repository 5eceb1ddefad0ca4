#!/usr/bin/env python3
"""Makes the Debian package and looks into it: program and udev rule where they belong, dependencies named.

usage: package_test.py BUILD SOURCE VERSION
"""
import os
import shutil
import subprocess
import sys
import tempfile

SKIPPED = 77  # Exit status that ctest takes for "not run".


def run(*words):
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout


def complaints(package, source, version):
    held = {}
    for line in run("dpkg-deb", "--contents", package).splitlines():
        mode, owner, size, _, _, path = line.split(None, 5)
        held[path.removeprefix(".")] = (mode, owner, int(size))
    for path, mode in (("/usr/bin/scatter", "-rwxr-xr-x"),
                       ("/usr/lib/udev/rules.d/60-openscatter.rules", "-rw-r--r--")):
        if path not in held:
            yield f"{path} is missing; there are: {' '.join(sorted(held))}"
        elif held[path][:2] != (mode, "root/root"):
            yield f"{path} is {' '.join(held[path][:2])}, expected {mode} root/root"
    strangers = [path for path in held if not path.startswith("/usr/") and path not in ("/", "/usr")]
    if strangers:
        yield f"files outside /usr: {' '.join(strangers)}"
    fields = dict(line.split(": ", 1) for line in run("dpkg-deb", "--field", package).splitlines()
                  if ": " in line and not line.startswith(" "))
    for name, value in (("Package", "openscatter"), ("Version", version)):
        if fields.get(name) != value:
            yield f"{name} is {fields.get(name)}, expected {value}"
    needed = fields.get("Depends", "")
    if "libc6" not in needed:
        yield f"the dependencies do not name the C library: {needed}"
    with tempfile.TemporaryDirectory() as folder:
        run("dpkg-deb", "--control", package, folder)
        for script in ("postinst", "postrm"):
            if not os.access(os.path.join(folder, script), os.X_OK):
                yield f"{script} is missing or cannot be run"
            else:
                run("sh", "-n", os.path.join(folder, script))
        run("dpkg-deb", "--extract", package, folder)
        rule = os.path.join("lib/udev/rules.d/60-openscatter.rules")
        with open(os.path.join(folder, "usr", rule), encoding="utf-8") as inside, \
             open(os.path.join(source, "tools/packaging/udev/60-openscatter.rules"), encoding="utf-8") as ours:
            text = ours.read()
            if inside.read() != text:
                yield "the rule in the package is not that of the sources"
        carried = run(os.path.join(folder, "usr/bin/scatter"), "doctor", "--udev-rule")
        if carried != text:
            yield "scatter doctor --udev-rule prints another rule than the package holds"


def main(build, source, version):
    lacking = [tool for tool in ("dpkg-deb", "dpkg-shlibdeps", "cpack") if shutil.which(tool) is None]
    if lacking:
        print(f"skipped: {' '.join(lacking)} not found; packages are made on Debian (apt-get install dpkg-dev)")
        return SKIPPED
    with tempfile.TemporaryDirectory() as folder:
        made = subprocess.run(["cpack", "--config", os.path.join(build, "CPackConfig.cmake"), "-B", folder],
                              capture_output=True, text=True)
        packages = [name for name in os.listdir(folder) if name.endswith(".deb")]
        if made.returncode != 0 or len(packages) != 1:
            print(made.stdout + made.stderr)
            print(f"cpack gave {len(packages)} packages, expected 1")
            return 1
        architecture = run("dpkg", "--print-architecture").strip()
        found = list(complaints(os.path.join(folder, packages[0]), source, version))
        if packages[0] != f"openscatter_{version}_{architecture}.deb":
            found.append(f"the package is named {packages[0]}")
    for complaint in found:
        print(complaint)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
