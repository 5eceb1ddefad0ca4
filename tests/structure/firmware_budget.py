#!/usr/bin/env python3
"""Fails when a firmware image is larger than it may be: code, static RAM, deepest stack, forbidden symbols.

usage: firmware_budget.py BUILD      checks bin/*.elf of a firmware build and prints the table
       firmware_budget.py --self-test

Code is text, constants and the initial values of data. Static RAM is everything that the linker places in RAM, the two
stacks included, without `.frame_bands` (a row band and a wire frame of pixels, which grow with the sensor and the
carrier). The deepest stack comes from the compiler's call graph (-fcallgraph-info=su, one .ci file per object):

- a virtual call or a call through a pointer goes to every function whose address is taken in the image (in a vtable, a
  table of handlers, ...) and whose class method name fits; without the name, to all of them;
- an exception may come at the deepest place: its frame (104 bytes with floating point, 4 for alignment) and the deepest
  interrupt handler come on top; interrupts have one priority and do not nest; crash handlers have a stack of their own;
- recursion has no bound and fails; functions of the C library and libgcc have no .ci file, their stacks are read from the
  machine code (`push`, `vpush`, `sub sp`).
"""
import collections
import glob
import os
import re
import subprocess
import sys

CODE_BYTES = 160 << 10
RAM_BYTES = 96 << 10
STACK_BYTES = 6 << 10
EXCEPTION_FRAME = 108
SKIPPED = 77  # Exit status that ctest takes for "not run".
IMAGES = ("bootloader", "openscatter_slot0", "openscatter_slot1")
ENTRY = "reset_handler"
HANDLER = "interrupt_entry"
# A heap, exceptions, and what only they bring.
FORBIDDEN = re.compile(r"^(_*(malloc|calloc|realloc|free|sbrk)(_r)?|_Zn[wa].*|_Zd[la].*|__cxa_(throw|rethrow|begin_catch|"
                       r"allocate_exception|guard_acquire|atexit)|_Unwind_.*|__gxx_personality.*|__aeabi_unwind.*|abort|"
                       r"__aeabi_atexit)$")


def run(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


class Image:
    """One ELF file: its sections, symbols and machine code."""

    def __init__(self, path):
        self.path = path
        self.sections = {}
        for line in run("arm-none-eabi-size", "-A", path).splitlines():
            words = line.split()
            if len(words) == 3 and words[0].startswith("."):
                self.sections[words[0]] = (int(words[1]), int(words[2]))
        self.symbols = {}  # name: address, functions only
        self.names = set()
        for line in run("arm-none-eabi-nm", path).splitlines():
            words = line.split()
            self.names.add(words[-1])
            if len(words) == 3 and words[1] in "tTwW":
                self.symbols[words[2]] = int(words[0], 16) & ~1

    def size(self, name):
        return self.sections.get(name, (0, 0))[0]

    def code_bytes(self):
        return sum(self.size(name) for name in (".vectors", ".text", ".rodata", ".init_array", ".data"))

    def ram_bytes(self):
        return sum(self.size(name) for name in (".stack", ".data", ".bss"))

    def forbidden(self):
        return sorted(name for name in self.names if FORBIDDEN.match(name))


def disassembly(path):
    """{function: (stack bytes, {called functions})} by the machine code, for functions without a .ci file."""
    functions, name, stack, calls = {}, None, 0, set()
    for line in run("arm-none-eabi-objdump", "-d", "--no-show-raw-insn", path).splitlines():
        start = re.match(r"^[0-9a-f]+ <(.+)>:$", line)
        if start:
            if name:
                functions[name] = (stack, calls)
            name, stack, calls = start.group(1), 0, set()
            continue
        push = re.search(r"\t(?:push(?:\.w)?|stmdb\tsp!,)\s*\{([^}]*)\}", line)
        vpush = re.search(r"\tvpush\s*\{d(\d+)(?:-d(\d+))?\}", line)
        lower = re.search(r"\tsub(?:w|\.w)?\tsp, (?:sp, )?#(\d+)", line)
        one = re.search(r"\tstr(?:\.w|d)?\t.*\[sp, #-(\d+)\]!", line)
        if push:
            for part in push.group(1).split(","):
                ends = re.match(r"\s*r(\d+)-r(\d+)", part)
                stack += 4 * (int(ends.group(2)) - int(ends.group(1)) + 1) if ends else 4
        elif vpush:
            stack += 8 * (int(vpush.group(2) or vpush.group(1)) - int(vpush.group(1)) + 1)
        elif lower or one:
            stack += int((lower or one).group(1))
        call = re.search(r"\tbl?x?(?:\.w)?\t[0-9a-f]+ <([^>+]+)>", line)
        if call and call.group(1) != name:
            calls.add(call.group(1))
    if name:
        functions[name] = (stack, calls)
    return functions


class CallGraph:
    """What the compiler wrote beside the objects of a build, for one image."""

    def __init__(self, build, image):
        self.stacks = {}
        self.calls = collections.defaultdict(set)
        self.dynamic = set()
        self.indirect = collections.defaultdict(set)  # caller: {place of the call in the source}
        for path in compiled(build, image, "*.ci"):
            with open(path, encoding="utf-8", errors="replace") as file:
                self.take(file.read())
        for name, (stack, calls) in disassembly(image.path).items():
            if name not in self.stacks:
                self.stacks[name] = stack
                self.calls[name] |= calls
        self.virtual, self.pointers = addresses_taken(build, image)
        linked = set(image.symbols)
        for caller, places in self.indirect.items():
            if caller in linked:
                for place in places:
                    self.calls[caller] |= self.targets(caller, place)
        self.calls = {caller: {callee for callee in callees if callee in linked}
                      for caller, callees in self.calls.items() if caller in linked}

    def take(self, text):
        for title, label in re.findall(r'node: \{ title: "([^"]+)" label: "([^"]*)"', text):
            symbol = title.split(":")[-1]
            size = re.search(r"(\d+) bytes \(([^)]*)\)", label)
            if size:
                self.stacks[symbol] = max(self.stacks.get(symbol, 0), int(size.group(1)))
                if size.group(2) == "dynamic":
                    self.dynamic.add(symbol)
        for source, target, place in re.findall(
                r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"(?: label: "([^"]*)")?', text):
            caller, callee = source.split(":")[-1], target.split(":")[-1]
            if callee == "__indirect_call":
                self.indirect[caller].add(place)
            else:
                self.calls[caller].add(callee)

    def targets(self, caller, place):
        """Functions that the indirect call at `place` (file:line:column) of the source can reach."""
        words = source_words(place)
        named = {symbol for symbol in self.virtual if method_of(symbol) in words}
        if named:
            owner = class_of(caller)
            # The one adapter that implements the interface that it calls: the line below it is never itself.
            return {symbol for symbol in named if class_of(symbol) != owner} if owner in ADAPTERS else named
        if "->*" in words:
            return {symbol for symbol in self.pointers if class_of(symbol) == class_of(caller)}
        if caller in TABLE_CALLERS:
            return {symbol for symbol in self.pointers if TABLE_CALLERS[caller] in symbol}
        return self.pointers | self.virtual

    def deepest(self, start):
        """(bytes, [functions]) of the deepest path; raises Recursion."""
        known, under_way = {}, []

        def visit(name):
            if name in known:
                return known[name]
            if name in under_way:
                raise Recursion(under_way[under_way.index(name):] + [name])
            under_way.append(name)
            below = max((visit(callee) for callee in self.calls.get(name, ())), default=(0, []))
            under_way.pop()
            known[name] = (self.stacks.get(name, 0) + below[0], [name] + below[1])
            return known[name]

        return visit(start)


class Recursion(Exception):
    pass


# Classes that implement a port by calling the same port of another object.
ADAPTERS = {"SerialLink"}
# Functions that call through a table which only the board's own functions are entered in.
TABLE_CALLERS = {"interrupt_entry": "mps2_an500"}


def nested_name(symbol):
    """The parts of a mangled nested name, without parameters: scatter, firmware, Uart, read."""
    match = re.match(r"^_ZN[KVRO]*", symbol)
    if not match:
        return []
    parts, at = [], match.end()
    while at < len(symbol):
        number = re.match(r"\d+", symbol[at:])
        if not number:
            break
        at += number.end()
        parts.append(symbol[at:at + int(number.group())])
        at += int(number.group())
    return parts


def method_of(symbol):
    return (nested_name(symbol) or [""])[-1]


def class_of(symbol):
    parts = nested_name(symbol)
    return parts[-2] if len(parts) >= 2 else ""


def source_words(place):
    """Names that are called on the line of the source (and on the one after it); "->*" for a member pointer."""
    path, line, _ = (place.rsplit(":", 2) + ["", ""])[:3]
    try:
        with open(path, encoding="utf-8") as file:
            text = "".join(file.readlines()[max(0, int(line) - 2):int(line) + 1])
    except (OSError, ValueError):
        return set()
    words = set(re.findall(r"(?:\.|->)\s*(\w+)\s*\(", text))
    return words | ({"->*"} if "->*" in text else set())


def compiled(build, image, pattern):
    """What the compiler made of the sources of the image and of the libraries, not of other images."""
    name = os.path.basename(image.path).removesuffix(".elf")
    found = glob.glob(os.path.join(build, "**", pattern), recursive=True)
    return [path for path in found if re.search(rf"/CMakeFiles/(scatter_\w+|{name})\.dir/", path)]


def addresses_taken(build, image):
    """({functions in vtables}, {functions whose address is taken elsewhere}), by the objects' relocations."""
    virtual, pointers = set(), set()
    objects = compiled(build, image, "*.obj")
    section = ""
    for line in run("arm-none-eabi-objdump", "-r", *objects).splitlines():
        title = re.match(r"^RELOCATION RECORDS FOR \[(.+)\]", line)
        if title:
            section = title.group(1)
            continue
        words = line.split()
        if len(words) < 3 or words[1] not in ("R_ARM_ABS32", "R_ARM_THM_MOVW_ABS_NC", "R_ARM_MOVW_ABS_NC"):
            continue
        if section.startswith((".debug", ".ARM.ex", ".vectors")):
            continue
        name = re.sub(r"[+-]0x[0-9a-f]+$", "", words[2])
        name = name[len(".text."):] if name.startswith(".text.") else name
        if name in image.symbols:
            (virtual if "_ZTV" in section else pointers).add(name)
    return virtual, pointers - virtual


def demangled(names):
    text = subprocess.run(["arm-none-eabi-c++filt"], input="\n".join(names), check=True, capture_output=True,
                          text=True).stdout.splitlines()
    return [re.sub(r"scatter::(firmware|protocol)::", "", re.sub(r"\(.*", "", name)) for name in text]


def check(build):
    complaints = []
    print(f"{'image':20} {'code':>8} {'of':>8} {'RAM':>8} {'of':>8} {'bands':>8} {'stack':>8} {'of':>8}")
    for name in IMAGES:
        path = os.path.join(build, "bin", name + ".elf")
        if not os.path.exists(path):
            if name == "bootloader":
                print(f"{name:20} not built (SCATTER_BOOTLOADER=OFF)")
                continue
            print(f"{path} is not there: build it with ./run firmware")
            sys.exit(SKIPPED)
        image = Image(path)
        graph = CallGraph(build, image)
        dynamic = sorted(symbol for symbol in graph.dynamic if symbol in image.symbols)
        if dynamic:
            complaints.append(f"{name}: stack of unknown size in {', '.join(demangled(dynamic))}")
        try:
            main_bytes, main_path = graph.deepest(ENTRY)
            interrupt_bytes, interrupt_path = graph.deepest(HANDLER)
        except Recursion as cycle:
            complaints.append(f"{name}: recursion, so no bound of the stack: {' -> '.join(demangled(cycle.args[0]))}")
            continue
        stack = main_bytes + EXCEPTION_FRAME + interrupt_bytes
        print(f"{name:20} {image.code_bytes():8} {CODE_BYTES:8} {image.ram_bytes():8} {RAM_BYTES:8} "
              f"{image.size('.frame_bands'):8} {stack:8} {STACK_BYTES:8}")
        steps = [f"{graph.stacks.get(symbol, 0)} {text}"
                 for symbol, text in zip(main_path, demangled(main_path)) if graph.stacks.get(symbol, 0) >= 64]
        print(f"  deepest: {main_bytes} = {' + '.join(steps)} + small ones; interrupt {interrupt_bytes} + frame "
              f"{EXCEPTION_FRAME}")
        for what, found, limit in (("code", image.code_bytes(), CODE_BYTES), ("static RAM", image.ram_bytes(), RAM_BYTES),
                                   ("deepest stack", stack, STACK_BYTES)):
            if found > limit:
                complaints.append(f"{name}: {what} is {found} bytes, allowed are {limit}; remedy: see the map "
                                  f"{path}.map or the path above")
        if image.forbidden():
            complaints.append(f"{name}: a heap or exceptions are linked: {', '.join(image.forbidden())}")
    return complaints


def self_test():
    """Each part of the judgement on an input whose answer is known."""
    wrong = []
    graph = CallGraph.__new__(CallGraph)
    graph.stacks = {"a": 100, "b": 50, "c": 70, "d": 8}
    graph.calls = {"a": {"b", "c"}, "b": {"d"}}
    if graph.deepest("a") != (170, ["a", "c"]):
        wrong.append("the deepest path of a small graph")
    graph.calls["c"] = {"a"}
    try:
        graph.deepest("a")
        wrong.append("recursion is not noticed")
    except Recursion:
        pass
    for symbol in ("malloc", "_malloc_r", "_sbrk", "_Znwj", "_ZdlPvj", "__cxa_throw", "_Unwind_Resume"):
        if not FORBIDDEN.match(symbol):
            wrong.append(f"{symbol} is not forbidden")
    for symbol in ("memcpy", "_ZN7scatter8protocol6crc32cESt4spanIKSt4byteLj4294967295EEj", "freeze", "new_frame"):
        if FORBIDDEN.match(symbol):
            wrong.append(f"{symbol} is forbidden")
    symbol = "_ZN7scatter8firmware10mps2_an5004Uart4readESt4spanISt4byteLj4294967295EE"
    if (class_of(symbol), method_of(symbol)) != ("Uart", "read"):
        wrong.append("class and method of a mangled name")
    return [f"self-test: {what}" for what in wrong]


def main(arguments):
    if len(arguments) != 1:
        sys.exit(__doc__)
    complaints = self_test() if arguments == ["--self-test"] else check(arguments[0])
    for complaint in complaints:
        print(complaint)
    print(f"firmware budget: {len(complaints)} breaches" if complaints else "firmware budget: kept")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
