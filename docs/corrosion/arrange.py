#!/usr/bin/env python3
"""Arranges PNG pictures of 8 bits and three channels, as `scatter corrode` writes them. Needs only Python.

usage: arrange.py row OUT IN...                    side by side, with a gap
       arrange.py tile OUT IN                      twice across and twice down
       arrange.py zoom OUT IN X Y SIDE FACTOR      SIDE pixels from (X, Y), each FACTOR times as large
"""
import struct
import sys
import zlib


def read(path):
    """Rows of bytes, three per pixel."""
    with open(path, "rb") as file:
        data = file.read()
    at, packed, width, height = 8, b"", 0, 0
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8:at + 8 + size]
        if kind == b"IHDR":
            width, height, bits, colour, _, _, interlaced = struct.unpack(">IIBBBBB", body)
            if (bits, colour, interlaced) != (8, 2, 0):
                sys.exit(f"{path}: expected 8 bits, RGB, not interlaced")
        elif kind == b"IDAT":
            packed += body
        at += size + 12
    plain = zlib.decompress(packed)
    stride = 3 * width
    rows, before = [], bytearray(stride)
    for y in range(height):
        kind = plain[y * (stride + 1)]
        row = bytearray(plain[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        if kind == 1:
            for i in range(3, stride):
                row[i] = (row[i] + row[i - 3]) & 255
        elif kind == 2:
            row = bytearray((a + b) & 255 for a, b in zip(row, before))
        elif kind == 3:
            for i in range(stride):
                row[i] = (row[i] + ((row[i - 3] if i > 2 else 0) + before[i]) // 2) & 255
        elif kind == 4:
            for i in range(stride):
                a, b, c = (row[i - 3], before[i], before[i - 3]) if i > 2 else (0, before[i], 0)
                p, q, r = abs(b - c), abs(a - c), abs(a + b - 2 * c)
                row[i] = (row[i] + (a if p <= q and p <= r else b if q <= r else c)) & 255
        rows.append(bytes(row))
        before = row
    return rows


def write(path, rows):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    width = len(rows[0]) // 3
    packed = bytearray()
    for row in rows:  # each byte less the one of the pixel before
        packed += b"\1" + row[:3] + bytes((a - b) & 255 for a, b in zip(row[3:], row))
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, len(rows), 8, 2, 0, 0, 0)) +
                   chunk(b"IDAT", zlib.compress(bytes(packed), 9)) + chunk(b"IEND", b""))


def main(words):
    if len(words) >= 3 and words[0] == "row":
        pictures = [read(path) for path in words[2:]]
        gap = b"\xff" * (3 * 10)
        write(words[1], [gap.join(rows) for rows in zip(*pictures)])
    elif len(words) == 3 and words[0] == "tile":
        write(words[1], [row * 2 for row in read(words[2])] * 2)
    elif len(words) == 7 and words[0] == "zoom":
        x, y, side, factor = map(int, words[3:])
        rows = [row[3 * x:3 * (x + side)] for row in read(words[2])[y:y + side]]
        wide = [b"".join(row[i:i + 3] * factor for i in range(0, len(row), 3)) for row in rows]
        write(words[1], [row for row in wide for _ in range(factor)])
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
