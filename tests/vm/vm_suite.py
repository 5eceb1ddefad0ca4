#!/usr/bin/env python3
"""The USB tests on a real kernel: a stock Debian kernel in QEMU, with simulated instruments on its own bus.

usage: vm_suite.py --build FOLDER --kernel FOLDER --firmware FOLDER --work FOLDER [TEST...]

Each TEST is the beginning of a name in guest/tests; all without one. Exit status 0: every promise was kept, 1: not,
77: this machine cannot run them (the reason is printed).
"""
import argparse
import glob
import os
import shutil
import subprocess
import sys
import time

import initramfs
import kernel
from console import follow

HERE = os.path.dirname(os.path.realpath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
# USB/IP, HID, and the folder shared with the host. hidraw is part of hid or built in.
MODULES = ("vhci-hcd", "usbhid", "hid-generic", "virtio_pci", "9pnet_virtio", "9p")
TOOLS = ("/bin/udevadm", "/usr/bin/dfu-util", "/usr/sbin/usbip", "/usr/bin/setpriv")
UDEV_RULES = ("50-udev-default.rules", "73-seat-late.rules")
GCONV = "/usr/lib/x86_64-linux-gnu/gconv"
# A PVH boot without what only a real machine needs; the kernel's warnings go to the console. Time is the HPET's: on a
# busy host the calibration of the others goes wrong by a factor.
APPEND = (
    "console=ttyS0 loglevel=5 panic=-1 oops=panic nokaslr mitigations=off nopti no_timer_check clocksource=hpet "
    "tsc=unstable "
    "random.trust_cpu=on rcupdate.rcu_cpu_stall_suppress=1 nowatchdog"
)


def need_tools():
    for tool, package in (
        ("qemu-system-x86_64", "qemu-system-x86"),
        ("/bin/busybox", "busybox-static"),
        ("/bin/udevadm", "udev"),
        ("/usr/bin/dfu-util", "dfu-util"),
        ("/usr/sbin/usbip", "usbip"),
        ("dpkg-deb", "dpkg"),
    ):
        if shutil.which(tool) is None:
            raise kernel.Unavailable(f"{tool} is not there; install the package {package}")


def kernel_package(folder):
    packages = sorted(glob.glob(os.path.join(folder, "*.deb")), key=os.path.getmtime)
    if not packages:
        raise kernel.Unavailable("the kernel package could not be fetched; ./run test --vm fetches it from the apt sources")
    return packages[-1]


def stripped(program, folder):
    """A copy without symbols, made again when the program is newer."""
    copy = os.path.join(folder, os.path.basename(program))
    if not os.path.exists(copy) or os.path.getmtime(copy) < os.path.getmtime(program):
        subprocess.run(["strip", "-o", copy, program], check=True)
    return copy


def test_names():
    return sorted(os.listdir(os.path.join(HERE, "guest", "tests")))


def make_archive(options, modules):
    """Everything that the guest has."""
    archive = initramfs.Archive()
    for path in ("dev", "proc", "sys", "run", "tmp", "out", "root", "var"):
        archive.folder(path)
    archive.copy("/bin/busybox", "bin/busybox", 0o755)
    archive.copy(os.path.join(HERE, "guest", "init"), "init", 0o755)
    archive.copy(os.path.join(HERE, "guest", "steps"), "steps", 0o644)
    for name in test_names():
        archive.copy(os.path.join(HERE, "guest", "tests", name), f"tests/{name}", 0o644)
    for number, (name, data) in enumerate(modules):
        archive.put(f"modules/{number:02}-{name}.ko", data)
    # Users that rules and tests name; user 1000 is nobody in particular.
    archive.put("etc/passwd", b"root:x:0:0::/root:/bin/sh\nuser:x:1000:1000::/tmp:/bin/sh\n")
    archive.copy("/etc/group", "etc/group")
    archive.put("etc/nsswitch.conf", b"passwd: files\ngroup: files\nhosts: files\n")
    archive.put("etc/hosts", b"127.0.0.1 localhost\n")
    for tool in TOOLS:
        archive.program(tool, "usr/bin/" + os.path.basename(tool))
    archive.link("usr/bin/systemd-udevd", "udevadm")
    for name in UDEV_RULES:
        archive.copy(f"/usr/lib/udev/rules.d/{name}", f"usr/lib/udev/rules.d/{name}")
    archive.folder("etc/udev/rules.d")
    # The commands that programs print for users begin with it.
    archive.put("usr/bin/sudo", b'#!/bin/sh\nexec "$@"\n', 0o755)
    # hidapi's libusb backend converts strings by iconv.
    for name in ("gconv-modules", "UTF-16.so"):
        archive.copy(os.path.join(GCONV, name), f"{GCONV}/{name}")
    copies = os.path.join(options.work, "stripped")
    os.makedirs(copies, exist_ok=True)
    archive.folder("programs")
    archive.program(os.path.join(options.build, "bin", "scatter"), "bin/scatter",
                    stripped(os.path.join(options.build, "bin", "scatter"), copies))
    for program in sorted(glob.glob(os.path.join(options.build, "bin", "vm_*"))):
        name = os.path.basename(program)
        archive.program(program, f"programs/{name}", stripped(program, copies))
    for name in ("openscatter_next.scfw", "openscatter_next.dfu"):
        archive.copy(os.path.join(options.firmware, name), f"firmware/{name}")
    for extra in options.extra:
        source, _, path = extra.partition("=")
        archive.program(source, path)
    return archive


def boot(vmlinux, archive_path, shared, accelerator, words):
    # Two processors, as every computer has that measures: on one, checking a frame keeps the instrument waiting.
    command = [
        "qemu-system-x86_64", "-nodefaults", "-no-user-config", "-display", "none", "-no-reboot",
        "-cpu", "qemu64,+rdrand,+ssse3,+sse4.1,+sse4.2,+popcnt", "-smp", "2", "-m", "1024", "-serial", "stdio",
        "-accel", accelerator,
        "-kernel", vmlinux, "-initrd", archive_path, "-append", " ".join([APPEND, *words]),
        "-virtfs", f"local,path={shared},mount_tag=out,security_model=none",
    ]  # fmt: skip
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


def compare_measurement(options, shared):
    """Problem, or None: the frames that came over USB against those of an instrument in one process with its host."""
    there = os.path.join(shared, "usb_measurement.scat")
    if not os.path.exists(there):
        return None
    folder = os.path.join(options.work, "in_process")
    shutil.rmtree(folder, ignore_errors=True)
    programs = os.path.join(options.build, "bin")
    uri = "sim:?seed=3&profile=binned&sample=ggx:alpha=0.2,f0=0.04,albedo=0.3"
    # A home of its own: no calibration of this computer's is used or added to.
    environment = {**os.environ, "HOME": os.path.join(options.work, "home"), "XDG_DATA_HOME": ""}
    subprocess.run([os.path.join(programs, "scatter"), "measure", uri, "--budget", "600", "-o", folder],
                   check=True, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
    here = os.path.join(folder, "recording.scat")
    compared = subprocess.run([os.path.join(programs, "vm_compare"), here, there], stdout=subprocess.PIPE, text=True)
    print(f"USB against in-process: {compared.stdout.strip()}")
    return None if compared.returncode == 0 else f"the device frames of a measurement: {compared.stdout.strip()}"


def main():
    parser = argparse.ArgumentParser(description="Runs the USB tests on a real kernel in QEMU.")
    parser.add_argument("--build", required=True, help="build folder with bin/scatter and the guest's programs")
    parser.add_argument("--kernel", required=True, help="folder with the kernel's package")
    parser.add_argument("--firmware", required=True, help="folder with the signed firmware files")
    parser.add_argument("--work", required=True, help="folder for the console's log and the results")
    parser.add_argument("--limit", type=float, default=600, help="time for everything [s]")
    parser.add_argument("--accelerator", default="tcg,thread=multi", help="of QEMU; kvm where it is usable")
    parser.add_argument("--verbose", action="store_true", help="show everything that the guest prints")
    parser.add_argument("--extra", action="append", default=[], help="PROGRAM=PATH in the guest")
    parser.add_argument("tests", nargs="*", metavar="TEST")
    options = parser.parse_args()
    names = [name for name in test_names() if not options.tests or any(name.startswith(t) for t in options.tests)]
    if not names:
        parser.error(f"no test begins with {' or '.join(options.tests)}; there are {' '.join(test_names())}")
    begin = time.monotonic()
    shared = os.path.join(os.path.abspath(options.work), "out")
    shutil.rmtree(shared, ignore_errors=True)
    os.makedirs(shared)
    try:
        need_tools()
        unpacked = os.path.join(options.work, "kernel")
        kernel.unpack(kernel_package(options.kernel), unpacked)
        vmlinux = kernel.vmlinux(unpacked)
        modules = kernel.Modules(unpacked).in_loading_order(MODULES)
    except kernel.Unavailable as reason:
        print(f"skipped: the USB tests on a real kernel need something that is not here: {reason}")
        return 77
    archive_path = os.path.join(options.work, "initramfs.cpio")
    make_archive(options, modules).write(archive_path)
    size = os.path.getsize(archive_path) / 2**20
    print(f"guest of {size:.0f} MiB made in {time.monotonic() - begin:.1f} s", flush=True)

    console = os.path.join(options.work, "console.log")
    with open(console, "wb") as log:
        machine = boot(vmlinux, archive_path, shared, options.accelerator, ["vm_tests=" + ",".join(names)])
        try:
            verdict = follow(machine, log, options.limit, names, options.verbose)
        finally:
            machine.kill()
            machine.wait()
    difference = compare_measurement(options, shared)
    if difference:
        verdict.broken.append(difference)
    seconds = time.monotonic() - begin
    print(f"{verdict.kept} promises kept, {len(verdict.broken)} broken, in {seconds:.0f} s; all of it is in {console}")
    for entry in verdict.broken:
        print(f"broken: {entry}")
    return 1 if verdict.broken else 0


if __name__ == "__main__":
    sys.exit(main())
