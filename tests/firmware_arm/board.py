"""The board mps2_an500 under QEMU, for tests: starts it, speaks serial framing with it, and ends it.

The wire's encoding comes from tests/golden/make_vectors.py, which was written from protocol/SPEC.md alone.
"""
import os
import selectors
import socket
import struct
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "golden"))
import make_vectors as wire  # noqa: E402

SHARED_BYTES = 16 << 20
FACTORY_OFFSET = 4 << 20
SLOT_OFFSETS = (8 << 20, (8 << 20) + (512 << 10))
EEPROM_BYTES = 32 << 10
NAMES = {number: name for name, (number, _, _) in wire.MESSAGES.items()}


def decode(kind, data, at=0):
    """(value, next offset) of one field kind of make_vectors.MESSAGES."""
    if isinstance(kind, str):
        size = struct.calcsize(wire.SCALARS[kind])
        return struct.unpack(wire.SCALARS[kind], data[at:at + size])[0], at + size
    if isinstance(kind, list):
        value = {}
        for name, inner in kind:
            value[name], at = decode(inner, data, at)
        return value, at
    if kind[0] in ("text", "array"):
        (count,) = struct.unpack_from("<H", data, at)
        at += 2
        if kind[0] == "text":
            return data[at:at + count].decode(), at + count
        values = []
        for _ in range(count):
            value, at = decode(kind[1], data, at)
            values.append(value)
        return values, at
    size = kind[1] if kind[0] == "raw" else len(data) - at
    return data[at:at + size].hex(), at + size


def uncobs(block):
    out, at = bytearray(), 0
    while at < len(block):
        code = block[at]
        out += block[at + 1:at + code]
        at += code
        if code < 255 and at < len(block):
            out.append(0)
    return bytes(out)


def slot_images(scfw):
    """What the two slots hold for a .scfw file: signed header, erased bytes up to 1024, body."""
    with open(scfw, "rb") as file:
        data = file.read()
    images = []
    for k in (0, 1):
        offset, size = struct.unpack_from("<II", data, 16 + 8 * k)
        image = data[offset:offset + size]
        images.append(image[:256] + b"\xff" * 768 + image[256:])
    return images


class Board:
    """One QEMU. `slots`: bytes for slot 0 and 1; `shared` and `eeprom` may name files that outlive it.
    Without parts nothing is on the I2C bus."""

    def __init__(self, kernel, slots=(), shared=None, eeprom=None, with_parts=True, options=()):
        self.folder = tempfile.TemporaryDirectory()
        self.shared = shared or os.path.join(self.folder.name, "shared")
        self.eeprom = eeprom or os.path.join(self.folder.name, "eeprom")
        for path, size in ((self.shared, SHARED_BYTES), (self.eeprom, EEPROM_BYTES)):
            if not os.path.exists(path):
                with open(path, "wb") as file:
                    file.write(b"\xff" * size)
        for offset, image in zip(SLOT_OFFSETS, slots):
            self.write_shared(offset, image)
        self.lines, remote = [], []
        for _ in range(2):
            ours, theirs = socket.socketpair()
            ours.settimeout(30)
            self.lines.append(ours)
            remote.append(theirs)
        arguments = ["qemu-system-arm", "-M", "mps2-an500,memory-backend=ps", "-display", "none", "-monitor", "none",
                     "-object", f"memory-backend-file,id=ps,size=16M,mem-path={self.shared},share=on",
                     "-kernel", kernel, "-semihosting-config", "enable=on,target=native"]
        for k, end in enumerate(remote):
            arguments += ["-chardev", f"socket,id=u{k},fd={end.fileno()}", "-serial", f"chardev:u{k}"]
        if with_parts:
            arguments += ["-drive", f"if=none,id=ee,format=raw,file={self.eeprom}", "-device",
                          "at24c-eeprom,address=0x50,rom-size=32768,drive=ee",
                          "-device", "tmp105,address=0x48", "-device", "tmp105,address=0x49"]
        arguments += options
        self.process = subprocess.Popen(arguments, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                        pass_fds=[end.fileno() for end in remote])
        for end in remote:
            end.close()
        self.pending = b""
        self.sequence = 0
        self.correlation = 0
        self.session = 0

    def write_shared(self, offset, data):
        with open(self.shared, "r+b") as file:
            file.seek(offset)
            file.write(data)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()
        for line in self.lines:
            line.close()
        self.folder.cleanup()

    def bench_message(self):
        """The next whole message on the backplane: kind, length, payload, check."""
        data = b""
        while len(data) < 2 or len(data) < data[1] + 3:
            more = self.lines[1].recv(1 if len(data) < 2 else data[1] + 3 - len(data))
            if not more:
                raise EOFError("QEMU ended")
            data += more
        return data

    def exit_status(self, seconds=50):
        """Waits for the program's own end (semihosting); (status, what it printed)."""
        output, _ = self.process.communicate(timeout=seconds)
        return self.process.returncode, output.decode()

    def send(self, message, correlation=0, **fields):
        number, channel, kinds = wire.MESSAGES[message]
        bytes_ = wire.frame(number, wire.encode(kinds, fields), channel=channel, sequence=self.sequence,
                            session=self.session, correlation=correlation)
        self.sequence += 1
        self.lines[0].sendall(b"\0" + wire.cobs(bytes_) + b"\0")

    def receive(self, seconds=20):
        """The next intact frame: (name, correlation, fields). Damaged blocks are skipped."""
        end = time.monotonic() + seconds
        while True:
            block, zero, rest = self.pending.partition(b"\0")
            if zero:
                self.pending = rest
                data = uncobs(block)
                if len(data) >= 28 and wire.crc32c(data[:20]) == struct.unpack_from("<I", data, 20)[0]:
                    number, length = struct.unpack_from("<HI", data, 6)
                    (correlation,) = struct.unpack_from("<H", data, 18)
                    name = NAMES[number]
                    fields, _ = decode(wire.MESSAGES[name][2], data[24:24 + length])
                    return name, correlation, fields
                continue
            left = end - time.monotonic()
            if left <= 0:
                raise TimeoutError("the board sent no frame")
            self.lines[0].settimeout(left)
            data = self.lines[0].recv(1 << 16)
            if not data:
                raise EOFError("QEMU ended")
            self.pending += data

    def ask(self, message, seconds=20, **fields):
        """Sends a request and returns (name, fields) of its reply, after any PENDING."""
        self.correlation += 1
        self.send(message, correlation=self.correlation, **fields)
        while True:
            name, correlation, reply = self.receive(seconds)
            if correlation == self.correlation and reply.get("status") != 1:
                return name, reply

    def hello(self, session=0x1234, seconds=20):
        self.session = session
        self.sequence = 0
        return self.ask("hello", seconds, min_wire_major=1, max_wire_major=1, schema_revision=1, schema_digest=0,
                        max_payload=1024, capabilities=0, build_id="test", host_name="test")
