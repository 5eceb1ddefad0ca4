#!/usr/bin/env python3
"""Paints the input maps of the thesis's three scenes as grey and colour PNG files.

The thesis shows its maps but does not give them; these follow its words. Deterministic; needs only Python.

usage: make_maps.py FOLDER [SIDE]
"""
import math
import os
import random
import struct
import sys
import zlib


def write_png(path, width, height, channels, rows):
    """rows: bytes of each row, 8 bits a channel."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    kind = {1: 0, 3: 2}[channels]
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0)) +
                   chunk(b"IDAT", zlib.compress(b"".join(b"\0" + row for row in rows), 9)) + chunk(b"IEND", b""))


class Noise:
    """Smooth noise that repeats without a seam: values on lattices of 4, 8, ... cells, blended."""

    def __init__(self, seed, coarsest=4, octaves=5):
        pick = random.Random(seed)
        self.lattices = [(coarsest << k, [[pick.uniform(-1, 1) for _ in range(coarsest << k)]
                                          for _ in range(coarsest << k)]) for k in range(octaves)]

    def __call__(self, u, v):
        total = 0.0
        weight = 1.0
        for count, lattice in self.lattices:
            x, y = u * count, v * count
            i, j = math.floor(x), math.floor(y)
            a, b = (t * t * (3 - 2 * t) for t in (x - i, y - j))
            i, j, right, below = i % count, j % count, (i + 1) % count, (j + 1) % count
            top = lattice[j][i] * (1 - a) + lattice[j][right] * a
            low = lattice[below][i] * (1 - a) + lattice[below][right] * a
            total += weight * (top * (1 - b) + low * b)
            weight *= 0.55
        return total


def clamp(value):
    return max(0.0, min(1.0, value))


def step(low, high, value):
    """0 below low, 1 above high, smooth between."""
    t = clamp((value - low) / (high - low))
    return t * t * (3 - 2 * t)


def grey(folder, name, side, shade):
    rows = [bytes(round(255 * clamp(shade((x + 0.5) / side, (y + 0.5) / side))) for x in range(side))
            for y in range(side)]
    write_png(os.path.join(folder, name), side, side, 1, rows)


def colour(folder, name, side, low, high, seed):
    """An uneven colour between two, given as sRGB bytes."""
    noise = Noise(seed, 8, 4)
    rows = []
    for y in range(side):
        row = bytearray()
        for x in range(side):
            share = clamp(0.5 + 0.6 * noise((x + 0.5) / side, (y + 0.5) / side))
            row += bytes(round(a + (b - a) * share) for a, b in zip(low, high))
        rows.append(bytes(row))
    write_png(os.path.join(folder, name), side, side, 3, rows)


def main(folder, side):
    os.makedirs(folder, exist_ok=True)
    # Scene 1, plate: a very light material; a surface that is damaged mainly at the edges.
    stains = Noise(1)
    edge = lambda u, v: min(u, v, 1 - u, 1 - v)
    grey(folder, "plate_material.png", side, lambda u, v: 0.88 + 0.06 * stains(v, u))
    grey(folder, "plate_surface.png", side, lambda u, v: 0.10 + 0.90 * step(0.02, 0.20, edge(u, v) + 0.06 * stains(u, v)))
    # Scene 2, pipe: a surface dark nearly everywhere, with islands of sound metal; a material a bit darker.
    islands = Noise(2, 6)
    grey(folder, "pipe_material.png", side, lambda u, v: 0.72 + 0.08 * islands(v, u))
    grey(folder, "pipe_surface.png", side, lambda u, v: 0.12 + 0.88 * step(0.62, 0.80, islands(u, v)))
    colour(folder, "pipe_layer3.png", side, (150, 148, 145), (196, 192, 186), 5)
    # Scene 3, tube: dark only around the hole, in surface and (closer to it) in material; a hole that is there before,
    # white in both so that nothing is taken where nothing is; sound metal light.
    ragged = Noise(3, 5)

    def from_hole(u, v):
        return math.hypot((u - 0.5) * 1.0, (v - 0.5) * 1.35) + 0.045 * ragged(u, v)
    hole = 0.085
    grey(folder, "tube_opening.png", side, lambda u, v: 0.0 if from_hole(u, v) < hole else 1.0)
    grey(folder, "tube_surface.png", side,
         lambda u, v: 1.0 if from_hole(u, v) < hole else 0.05 + 0.95 * step(0.16, 0.36, from_hole(u, v)))
    grey(folder, "tube_material.png", side,
         lambda u, v: 1.0 if from_hole(u, v) < hole else 0.15 + 0.80 * step(0.09, 0.22, from_hole(u, v)))
    # The thesis: none of the layers is of one even colour.
    colour(folder, "tube_layer3.png", side, (142, 146, 150), (184, 186, 186), 11)
    colour(folder, "tube_layer2.png", side, (140, 78, 38), (190, 112, 56), 12)
    colour(folder, "tube_layer1.png", side, (104, 56, 30), (146, 84, 44), 13)
    colour(folder, "tube_layer0.png", side, (58, 38, 30), (92, 58, 40), 14)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) == 3 else 256)
