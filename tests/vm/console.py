"""Follows the guest's console: shows each promise as it is kept or broken, and judges the whole."""
import os
import re
import selectors
import sys
import time

# What a healthy kernel never says.
COMPLAINT = re.compile(
    r"BUG: |Oops|WARNING: CPU|Kernel panic|general protection fault|Call Trace:|segfault at|blocked for more than"
)


class Verdict:
    def __init__(self):
        self.kept = 0
        self.broken = []
        self.kept_by = {}


class Console:
    """Lines of the console until the machine ends or the time is up."""

    def __init__(self, machine, log, limit_s):
        self.machine = machine
        self.log = log
        self.deadline = time.monotonic() + limit_s
        self.limit_s = limit_s

    def lines(self):
        pending = b""
        with selectors.DefaultSelector() as selector:
            selector.register(self.machine.stdout, selectors.EVENT_READ)
            while True:
                left = self.deadline - time.monotonic()
                if left <= 0 or not selector.select(left):
                    self.machine.kill()
                    yield f"@@LATE {self.limit_s:.0f}"
                    return
                data = os.read(self.machine.stdout.fileno(), 65536)
                self.log.write(data)
                self.log.flush()
                if not data:
                    return
                pending += data
                *whole, pending = pending.split(b"\n")
                for line in whole:
                    yield line.decode(errors="replace").rstrip("\r")


def follow(machine, log, limit_s, names, verbose=False):
    """Verdict over everything until the machine's end; each of the named tests must have kept something."""
    verdict = Verdict()
    test, output, ended = "boot", [], False

    def broken(text):
        verdict.broken.append(f"{test}: {text}")
        print(f"  BROKEN          {text}")
        for line in output[-60:]:
            print(f"    | {line}")
        output.clear()
        sys.stdout.flush()

    for line in Console(machine, log, limit_s).lines():
        if COMPLAINT.search(line):
            broken(f"the kernel complains: {line}")
        # A program's last line may lack its end.
        at = line.find("@@")
        word, _, rest = line[at + 2 :].partition(" ") if at >= 0 else ("", "", "")
        if word == "BOOT":
            print(f"the guest is up after {rest} s of its time")
        elif word == "RUN":
            test, output = rest.split()[0], []
            print(test, flush=True)
        elif word == "PASS":
            begin, end, promise = rest.split(" ", 2)
            verdict.kept += 1
            verdict.kept_by[test] = verdict.kept_by.get(test, 0) + 1
            output.clear()
            print(f"  kept {float(end) - float(begin):8.2f} s  {promise}", flush=True)
        elif word == "FAIL":
            broken(rest)
        elif word == "NOTE":
            print(f"  note             {rest}", flush=True)
        elif word == "DONE":
            status = int(rest.split()[1])
            if status and not any(entry.startswith(test + ":") for entry in verdict.broken):
                broken("ran out of its time" if status in (137, 143) else f"ended with status {status}")
        elif word == "LATE":
            broken(f"the machine was ended after {rest} s")
        elif word == "END":
            ended = True
        else:
            output.append(line)
            if verbose:
                print(f"    | {line}", flush=True)
    if not ended:
        broken("the machine ended before its tests did")
    for test in names:
        if test not in verdict.kept_by and not any(entry.startswith(test + ":") for entry in verdict.broken):
            broken("nothing was tested")
    return verdict
