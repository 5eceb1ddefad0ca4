"""The guest's only file system: a cpio archive (newc) put together in memory, without root and without cpio."""
import os
import re
import stat
import subprocess


class Archive:
    """Files by path in the guest; a file's folders come with it."""

    def __init__(self):
        self.entries = {}

    def folder(self, path):
        path = path.strip("/")
        if path and path not in self.entries:
            self.folder(os.path.dirname(path))
            self.entries[path] = (stat.S_IFDIR | 0o755, b"")

    def put(self, path, data, mode=0o644):
        path = path.strip("/")
        self.folder(os.path.dirname(path))
        self.entries[path] = (stat.S_IFREG | mode, data)

    def link(self, path, target):
        path = path.strip("/")
        self.folder(os.path.dirname(path))
        self.entries[path] = (stat.S_IFLNK | 0o777, target.encode())

    def copy(self, source, path, mode=None):
        with open(source, "rb") as file:
            data = file.read()
        self.put(path, data, mode if mode is not None else stat.S_IMODE(os.stat(source).st_mode))

    def program(self, source, path, stripped=None):
        """A program and the shared libraries that it is linked with, where this machine has them."""
        self.copy(stripped or source, path, 0o755)
        for library in shared_libraries(source):
            if library.strip("/") not in self.entries:
                self.copy(os.path.realpath(library), library, 0o755)

    def write(self, path):
        with open(path, "wb") as file:
            for number, (name, (mode, data)) in enumerate(self.entries.items(), 1):
                file.write(member(number, mode, name, data))
            file.write(member(0, 0, "TRAILER!!!", b""))


def member(number, mode, name, data):
    """Header of 110 digits, name and content, the latter two padded to four bytes (cpio(5), New ASCII Format)."""
    name = name.encode() + b"\0"
    links = 2 if stat.S_ISDIR(mode) else 1
    fields = (number, mode, 0, 0, links, 0, len(data), 0, 0, 0, 0, len(name), 0)
    head = b"070701" + b"".join(b"%08X" % field for field in fields) + name
    return head + b"\0" * (-len(head) % 4) + data + b"\0" * (-len(data) % 4)


def shared_libraries(program):
    listing = subprocess.run(["ldd", program], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=False)
    missing = re.findall(r"^\s*(\S+) => not found", listing.stdout, re.MULTILINE)
    if missing:
        raise FileNotFoundError(f"{program} wants libraries that are not there: {', '.join(missing)}")
    return re.findall(r"(?:=> |^\s*)(/\S+) \(0x", listing.stdout, re.MULTILINE)
