"""A stock Debian kernel without installing it: the boot image's content and modules in loading order."""
import bz2
import glob
import gzip
import lzma
import os
import re
import shutil
import struct
import subprocess


class Unavailable(Exception):
    """This machine cannot run the suite; the text says what is missing and what to do."""


def unpack(package, folder):
    """The package's files in `folder`, unpacked again only when the package is another one."""
    stamp = os.path.join(folder, "package")
    name = os.path.basename(package)
    if os.path.exists(stamp) and open(stamp, encoding="utf-8").read() == name:
        return
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    subprocess.run(["dpkg-deb", "--extract", package, folder], check=True)
    with open(stamp, "w", encoding="utf-8") as file:
        file.write(name)


def tool_output(tool, data):
    if shutil.which(tool) is None:
        raise Unavailable(f"the kernel is packed with {tool}, which is not there; install the package {tool}")
    return subprocess.run([tool, "-dc"], input=data, stdout=subprocess.PIPE, check=True).stdout


def vmlinux(folder):
    """Path of the uncompressed kernel, which boots by PVH without the slow unpacker.

    Where it lies in the boot image: Documentation/arch/x86/boot.rst, payload_offset and payload_length.
    """
    path = os.path.join(folder, "vmlinux")
    if os.path.exists(path):
        return path
    with open(one(os.path.join(folder, "boot", "vmlinuz-*")), "rb") as file:
        image = file.read()
    begin, size = struct.unpack_from("<II", image, 0x248)
    begin += (image[0x1F1] + 1) * 512
    payload = image[begin : begin + size]
    unpackers = {
        b"\xfd7zXZ\0": lambda data: lzma.LZMADecompressor().decompress(data),
        b"\x1f\x8b": lambda data: gzip.decompress(data[:-4]),
        b"BZh": lambda data: bz2.BZ2Decompressor().decompress(data),
        b"\x28\xb5\x2f\xfd": lambda data: tool_output("zstd", data[:-4]),
        b"\x02\x21\x4c\x18": lambda data: tool_output("lz4", data[:-4]),
        b"\x7fELF": lambda data: data,
    }
    content = next((unpacker(payload) for magic, unpacker in unpackers.items() if payload.startswith(magic)), b"")
    if not content.startswith(b"\x7fELF"):
        raise Unavailable(f"the kernel's packing is unknown: it begins with {payload[:6].hex()}")
    with open(path + ".new", "wb") as file:
        file.write(content)
    os.rename(path + ".new", path)
    return path


def one(pattern):
    found = glob.glob(pattern)
    if len(found) != 1:
        raise Unavailable(f"the kernel package holds {len(found)} files {os.path.basename(pattern)}, expected 1")
    return found[0]


class Modules:
    """The package's loadable modules by name. A name may be written with - or _."""

    def __init__(self, folder):
        self.files = {}
        self.builtin = set()
        root = one(os.path.join(folder, "lib", "modules", "*"))
        for where, _, names in os.walk(root):
            for name in names:
                if ".ko" in name:
                    self.files[self.canonical(name.split(".ko")[0])] = os.path.join(where, name)
        with open(os.path.join(root, "modules.builtin"), encoding="utf-8") as file:
            for line in file:
                self.builtin.add(self.canonical(os.path.basename(line.strip()).split(".ko")[0]))

    @staticmethod
    def canonical(name):
        return name.replace("-", "_")

    def content(self, name):
        path = self.files[name]
        with open(path, "rb") as file:
            data = file.read()
        if path.endswith(".xz"):
            return lzma.decompress(data)
        if path.endswith(".zst"):
            return tool_output("zstd", data)
        return data

    def in_loading_order(self, wanted):
        """(name, content) of the wanted modules and of all that they need, each after what it needs."""
        ordered = {}

        def add(name):
            name = self.canonical(name)
            if name in ordered or name in self.builtin:
                return
            if name not in self.files:
                raise Unavailable(f"the kernel package has no module {name}; is it the cloud flavour?")
            data = self.content(name)
            # The module's own statement, as depmod reads it: depends=a,b
            stated = re.search(rb"\0depends=([^\0]*)\0", data)
            for needed in filter(None, stated.group(1).decode().split(",")):
                add(needed)
            ordered[name] = data

        for name in wanted:
            add(name)
        return list(ordered.items())
