#!/usr/bin/env python3
"""Runs one test of the firmware on the emulated board mps2_an500.

usage: run_test.py TEST BUILD [--record]
  TEST   golden, crashes, watchdog, drivers, boot or cost
  BUILD  build folder of the preset firmware-arm
  --record  (cost only) writes cost.json instead of comparing with it

Exit status 0: passed, 1: failed, 77: the images or QEMU are not there.
"""
import json
import os
import shutil
import subprocess
import sys
import time

from board import Board

HERE = os.path.dirname(os.path.abspath(__file__))
POWER_ON, REQUESTED, WATCHDOG, FAULT = 0, 1, 2, 3
# Bits of the configurable fault status register (ARMv7-M, B3.2.15).
IACCVIOL, DACCVIOL, MSTKERR, PRECISERR, UNDEFINSTR, DIVBYZERO = 1 << 0, 1 << 1, 1 << 4, 1 << 9, 1 << 16, 1 << 25


class Failed(Exception):
    pass


def expect(what, found, wanted):
    if found != wanted:
        raise Failed(f"{what}: found {found!r}, expected {wanted!r}")


def image(build, name):
    path = os.path.join(build, "bin", name + ".elf")
    if not os.path.exists(path) or not shutil.which("qemu-system-arm"):
        print(f"skipped: {path} or qemu-system-arm is not there; remedy: ./run firmware")
        sys.exit(77)
    return path


def vectors():
    with open(os.path.join(HERE, "..", "golden", "protocol_vectors.json"), encoding="utf-8") as file:
        return json.load(file)


def functions(elf):
    """{name: (address, end)}"""
    text = subprocess.run(["arm-none-eabi-nm", "-S", elf], check=True, capture_output=True, text=True).stdout
    rows = [line.split() for line in text.splitlines()]
    return {row[3]: (int(row[0], 16) & ~1, (int(row[0], 16) & ~1) + int(row[1], 16)) for row in rows if len(row) == 4}


def test_golden(build):
    with Board(image(build, "test_golden")) as board:
        expect("exit status and words", board.exit_status(), (0, f"{len(vectors()['frames'])} frames\n"))


def test_drivers(build):
    for letter, with_parts in ((b"e", True), (b"n", False)):
        with Board(image(build, "test_driver"), with_parts=with_parts) as board:
            board.lines[0].sendall(letter)
            expect(f"exit status of part {letter}", board.exit_status()[0], 0)
            if with_parts:
                with open(board.eeprom, "rb") as file:
                    cells = file.read()
                expect("page in the EEPROM's file", cells[3 * 1024 + 64:3 * 1024 + 128], bytes(range(1, 65)))
                expect("last page in the EEPROM's file", cells[-64:], bytes(range(1, 65)))


class CrashBoard:
    """The crash image: one line of text at each boot."""
    FIELDS = ("reason", "present", "exception", "pc", "lr", "sp", "psr", "cfsr", "hfsr", "address", "uptime_us")

    def __init__(self, board):
        self.board = board
        self.text = b""

    def line(self):
        while b"\n" not in self.text:
            data = self.board.lines[0].recv(4096)
            if not data:
                raise Failed("QEMU ended")
            self.text += data
        line, self.text = self.text.split(b"\n", 1)
        words = line.decode().split(" ", len(self.FIELDS))
        state = {name: int(word, 16) for name, word in zip(self.FIELDS, words)}
        state["build_id"] = words[-1]
        return state

    def crash(self, letter):
        self.board.lines[0].sendall(letter.encode())
        return self.line()


def check_crash(state, symbols, where, exception, bits, address=None):
    expect(f"{where}: reset reason", state["reason"], FAULT)
    expect(f"{where}: snapshot", (state["present"], state["build_id"]), (1, "crash image"))
    expect(f"{where}: exception", state["exception"], exception)
    expect(f"{where}: fault status has its bit", state["cfsr"] & bits, bits)
    if address is not None:
        expect(f"{where}: address", state["address"], address)
    if where in symbols:
        low, high = symbols[where]
        if not low <= state["pc"] < high:
            raise Failed(f"{where}: pc {state['pc']:#x} is not in {low:#x}..{high:#x}")


def test_crashes(build):
    elf = image(build, "test_crash")
    symbols = functions(elf)
    with Board(elf) as plain:
        board = CrashBoard(plain)
        first = board.line()
        expect("first boot", (first["reason"], first["present"]), (POWER_ON, 0))
        check_crash(board.crash("u"), symbols, "crash_undefined", 6, UNDEFINSTR)
        check_crash(board.crash("d"), symbols, "crash_division", 6, DIVBYZERO)
        # The store faults in the helper that may be inlined or not; its address is what counts.
        check_crash(board.crash("n"), {}, "crash_no_memory", 5, PRECISERR, 0x90000000)
        check_crash(board.crash("c"), {}, "crash_write_code", 4, DACCVIOL, 0x100)
        check_crash(board.crash("f"), {}, "crash_write_factory", 4, DACCVIOL, 0x60400000)
        running_data = board.crash("x")
        check_crash(running_data, {}, "crash_run_data", 4, IACCVIOL)
        expect("pc of code run from data", running_data["pc"], 0x60000000)
        unhandled = board.crash("i")
        # Inside an interrupt the fault has no higher priority and becomes a hard fault, with the same cause.
        check_crash(unhandled, symbols, "interrupt_entry", 3, UNDEFINSTR)
        # A stack that overflows: the exception's frame cannot be pushed, so pc is unknown; sp tells where it was.
        overflow = board.crash("s")
        check_crash(overflow, {}, "crash_stack", 4, MSTKERR)
        guard = 0x20000000
        if not guard <= overflow["sp"] < guard + 256 + 512:
            raise Failed(f"stack guard: sp {overflow['sp']:#x} is not near the guard at {guard:#x}")
        kept = board.crash("b")
        expect("a requested reset keeps the snapshot", (kept["reason"], kept["present"], kept["cfsr"]),
               (REQUESTED, 1, overflow["cfsr"]))
    with Board(elf) as fresh:
        expect("power-on forgets", CrashBoard(fresh).line()["present"], 0)


def test_watchdog(build):
    elf = image(build, "test_crash")
    symbols = functions(elf)
    with Board(elf) as plain:
        board = CrashBoard(plain)
        board.line()
        for letter, name in (("w", "crash_hang"), ("m", "crash_hang_deaf")):
            begin = time.monotonic()
            state = board.crash(letter)
            expect(f"{name}: reset reason", state["reason"], WATCHDOG)
            expect(f"{name}: exception", (state["present"], state["exception"]), (1, 2))
            low, high = symbols[name]
            if not low <= state["pc"] < high:
                raise Failed(f"{name}: pc {state['pc']:#x} is not in {low:#x}..{high:#x}")
            if state["uptime_us"] < 2_000_000 or time.monotonic() - begin < 2:
                raise Failed(f"{name}: the watchdog bit before its time, after {state['uptime_us']} us")


def test_boot(build):
    from board import slot_images
    kernel = image(build, "bootloader")
    scfw = os.path.join(build, "..", "firmware", "openscatter.scfw")
    if not os.path.exists(scfw):
        print(f"skipped: {scfw} is not there; remedy: ./run firmware")
        sys.exit(77)
    images = slot_images(scfw)
    with Board(kernel, images) as board:
        expect("the bench is told that the firmware starts", board.bench_message()[:2], b"B\x03")
        name, reply = board.hello()
        expect("answer to HELLO", (name, reply["build_id"].split(" ")[0]), ("hello_reply", "openscatter"))
        expect("without a factory set", (reply["product"], reply["serial"]), ("unprovisioned", "no factory set"))
        expect("reset reason", reply["reset_reason"], POWER_ON)
        expect("no crash", board.ask("fault_record_read")[1]["present"], 0)
        name, refused = board.ask("set_configuration", recipe=recipe(illuminations=[0]))
        expect("nothing can be measured", name, "status_reply")
        expect("reboot", board.ask("reboot")[1]["status"], 0)
        board.bench_message()
        board.pending = b""
        name, reply = board.hello(session=0x4321)
        expect("reset reason", reply["reset_reason"], REQUESTED)
        expect("boots are counted in the EEPROM", reply["boot_count"], 2)
    with Board(kernel) as board:
        name, reply = board.hello()
        expect("rescue mode answers", (name, reply["build_id"].split(" ")[0]), ("hello_reply", "openscatter-boot"))
    damaged = [bytearray(images[0]), bytearray(images[1])]
    damaged[0][5000] ^= 1
    with Board(kernel, [bytes(part) for part in damaged]) as board:
        name, reply = board.hello()
        expect("the other slot starts when one is damaged", reply["build_id"].split(" ")[0], "openscatter")
    with Board(kernel, images, with_parts=False) as board:
        name, reply = board.hello()
        expect("the firmware starts without EEPROM and thermometers", reply["build_id"].split(" ")[0], "openscatter")
        name, state = board.ask("get_status")
        expect("a thermometer that does not answer", (state["sensor_temperature_mK"], state["led_temperature_mK"]),
               (0, 0))
        name, reply = board.ask("key_value_set", key="name", value="x")
        if reply["status"] == 0:
            raise Failed("without an EEPROM a setting was said to be stored")


def recipe(**fields):
    whole = {"illuminations": [], "exposures_us": [100], "exposure_mode": 0, "max_brackets": 1, "repeats": 1,
             "off_frames": 0, "off_exposure_us": 0, "time_budget_us": 0, "region_x": 0, "region_y": 0,
             "region_width": 0, "region_height": 0, "pixel_format": 0, "target": 0, "live_preview": 0,
             "test_pattern": 0}
    return {**whole, **fields}


def test_cost(build):
    """Instructions by -icount: the same on every machine, so that a commit that costs more is seen at once."""
    options = ("-icount", "shift=1,sleep=off")
    with Board(image(build, "test_cost"), options=options) as board:
        status, text = board.exit_status()
        expect("exit status", status, 0)
    found = json.loads(text[text.index("{"):text.rindex("}") + 1])
    record = os.path.join(HERE, "cost.json")
    if "--record" in sys.argv:
        with open(record, "w", encoding="utf-8") as file:
            json.dump(found, file, indent=1)
            file.write("\n")
        return
    with open(record, encoding="utf-8") as file:
        recorded = json.load(file)
    print(f"{'figure':32} {'recorded':>10} {'found':>10}")
    for name, figure in recorded.items():
        print(f"{name:32} {figure:10} {found.get(name, 'none'):>10}")
    worse = [name for name, figure in recorded.items() if found.get(name, 1 << 60) > figure * 1.1 + 2]
    if worse or set(found) != set(recorded):
        raise Failed(f"more than 10 % above the record: {', '.join(worse) or 'other figures than recorded'}; remedy: make "
                     "it cheaper, or record it with run_test.py cost BUILD --record and say why (docs/firmware.md)")


TESTS = {"golden": test_golden, "crashes": test_crashes, "watchdog": test_watchdog, "drivers": test_drivers,
         "boot": test_boot, "cost": test_cost}


def main():
    if len(sys.argv) < 3 or sys.argv[1] not in TESTS:
        sys.exit(__doc__)
    try:
        TESTS[sys.argv[1]](sys.argv[2])
    except (Failed, TimeoutError, EOFError, subprocess.TimeoutExpired) as problem:
        print(f"{sys.argv[1]}: {problem}")
        return 1
    print(f"{sys.argv[1]}: passed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
