#!/usr/bin/env python3
"""Runs the released command against the promises of the main walk and prints one row per promise.

    acceptance.py SCATTER [--seeds N] [--instruments N] [--spots N] [--only WORD]

Every limit below is a promise (README, docs/accuracy.md), none comes from an earlier run. Exit status
0 when all hold, 1 otherwise. Real data: SCATTER_REAL_DATA, else ../shared/data beside the repository.
"""
import argparse
import concurrent.futures
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time as clock

ROOT = pathlib.Path(__file__).resolve().parents[2]
LIMITS = {"median_relative_error": 0.005, "p95_relative_error": 0.02}
ALBEDO_LIMIT = 0.003
CHI_SQUARE = (0.8, 1.25)


class Walk:
    def __init__(self, scatter):
        self.scatter = scatter
        self.rows = []
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="scatter-acceptance-"))

    def call(self, *arguments, expect=0, timeout=300):
        done = subprocess.run([self.scatter, *arguments], capture_output=True, text=True, timeout=timeout)
        if expect is not None and done.returncode != expect:
            raise RuntimeError(f"{' '.join(arguments)}: exit {done.returncode}: {done.stderr.strip()}")
        return json.loads(done.stdout) if done.stdout.strip().startswith("{") else {}

    def measure(self, name, uri, *more, expect=0):
        out = self.folder / name
        return out, self.call("measure", uri, "-o", str(out), "--json", *more, expect=expect)

    def compare(self, out, truth):
        return self.call("compare", str(out / "brdf.exr"), truth, "--region", "measured", "--json")

    def row(self, name, good, text):
        self.rows.append(bool(good))
        print(f"{'ok  ' if good else 'FAIL'} {name:<44} {text}", flush=True)

    def check_comparison(self, name, c, chi_square=True):
        # Without what goes straight through a film: no instrument of this kind sees it.
        albedo = max(abs(i["albedo_error"] - abs(i["dirac"] - i["dirac_reference"])) for i in c["incidences"])
        good = all(c[k] <= v for k, v in LIMITS.items()) and albedo <= ALBEDO_LIMIT
        chi = c.get("reduced_chi_square")
        if chi_square:
            good = good and chi is not None and CHI_SQUARE[0] <= chi <= CHI_SQUARE[1]
        self.row(name, good, f"median {c['median_relative_error']:.4f}  p95 {c['p95_relative_error']:.4f}  "
                             f"albedo {albedo:.5f}  chi2 {chi if chi is None else round(chi, 3)}  bins {c['bins']}")
        return good


def quality(result):
    return {row["name"]: row for row in result["quality"]}


def accuracy(walk, seeds):
    for spec in ("lambertian:0.5", "ggx:alpha=0.2,f0=0.04,albedo=0.3", "ggx:alpha=0.1,f0=0.04,albedo=0.3"):
        for seed in range(1, seeds + 1):
            out, result = walk.measure("accuracy", f"sim:?sample={spec}&seed={seed}")
            walk.check_comparison(f"{spec} seed {seed}", walk.compare(out, spec))
            ledger = result["ledger"]
            if ledger["exposed"] != sum(v for k, v in ledger.items() if k != "exposed"):
                walk.row("ledger", False, str(ledger))
            if seed == 1:
                walk.row(f"{spec} time", result["instrument_seconds"] <= 3 and result["wall_seconds"] <= 3,
                         f"instrument {result['instrument_seconds']:.2f} s  wall {result['wall_seconds']:.2f} s")


def film(walk):
    spec = "film:transmittance=0.6,haze=0.3"
    out, _ = walk.measure("film", f"sim:?sample={spec}&seed=1")
    walk.check_comparison(spec, walk.compare(out, spec))


def real_data(walk):
    data = pathlib.Path(os.environ.get("SCATTER_REAL_DATA", ROOT.parent / "shared" / "data"))
    file = data / "zemax" / "brown_vinyl_measured_brdf.bsdf"
    if not file.exists():
        print("skipped: no real data")
        return
    out, _ = walk.measure("vinyl", f"sim:?sample=file:{file}&seed=1")
    walk.check_comparison("BrownVinyl", walk.compare(out, str(file)), chi_square=False)


def tilt(walk):
    x, y = math.cos(math.radians(30)), math.sin(math.radians(30))
    for alpha in (0.1, 0.2):
        spec = f"ggx:alpha={alpha},f0=0.04,albedo=0.3"
        uri = f"sim:?sample={spec}+tilt=1.0@30&seed=1"
        out, result = walk.measure("tilt", uri)
        q = quality(result)
        told = "tilt_x_deg" in q
        error = max(abs(q["tilt_x_deg"]["value"] - x), abs(q["tilt_y_deg"]["value"] - y)) if told else math.inf
        walk.row(f"tilt alpha {alpha}", error <= 0.1, f"worst component off by {error:.3f} deg")
        out, _ = walk.measure("tilt", uri, "--correct-tilt")
        walk.check_comparison(f"tilt corrected alpha {alpha}", walk.compare(out, spec), chi_square=False)
    _, result = walk.measure("level", "sim:?sample=lambertian:0.5&seed=1")
    walk.row("tilt of a Lambertian", quality(result)["tilt_deg"]["verdict"] == "cannot tell", "cannot be told")


def flags(walk):
    def flagged(name, uri, item, expect=0):
        _, result = walk.measure("flags", uri, expect=expect)
        row = quality(result).get(item) if "quality" in result else None
        walk.row(name, row is not None and row["verdict"] in ("warn", "fail") and row["advice"], row and row["advice"][:60])

    flagged("translucent", "sim:?sample=ggx:alpha=0.2,f0=0.04,albedo=0.3+translucent=0.1&seed=1", "ambient_share")
    flagged("soft", "sim:?sample=lambertian:0.5+soft=0.2&seed=1", "repeat_difference")
    flagged("saturated", "sim:?sample=ggx:alpha=0.01,f0=0.95&seed=1", "saturated_share")
    flagged("stale calibration", "sim:?sample=lambertian:0.5&calibration=stale&seed=1", "calibration_age_s")
    flagged("missing calibration", "sim:?sample=lambertian:0.5&calibration=none&seed=1", "calibration_missing", expect=1)


def time(walk):
    for spec, limit in (("lambertian:0.02", 5), ("lambertian:0.05", 5), ("lambertian:0.3", 3), ("lambertian:0.9", 3),
                        ("ggx:alpha=0.05,f0=0.9", 5), ("ggx:alpha=0.3,f0=0.04,albedo=0.3", 3)):
        _, result = walk.measure("time", f"sim:?sample={spec}&seed=1")
        walk.row(f"time {spec}", result["instrument_seconds"] <= limit and result["wall_seconds"] <= 3,
                 f"instrument {result['instrument_seconds']:.2f} s (at most {limit})  wall {result['wall_seconds']:.2f} s (3)")


def repeatable(walk):
    spec = "ggx:alpha=0.2,f0=0.04,albedo=0.3"
    names = ("recording.scat", "brdf.exr")
    first, _ = walk.measure("twice_a", f"sim:?sample={spec}&seed=5")
    second, _ = walk.measure("twice_b", f"sim:?sample={spec}&seed=5")
    one = walk.folder / "one_thread"
    subprocess.run(["taskset", "-c", "0", walk.scatter, "measure", f"sim:?sample={spec}&seed=5", "-o", str(one), "--json"],
                   capture_output=True, check=True)
    for name in names:
        same = (first / name).read_bytes() == (second / name).read_bytes() == (one / name).read_bytes()
        walk.row(f"same seed, same bytes: {name}", same, "two threads twice, one thread once")


def any_calibration(walk):
    spec = "ggx:alpha=0.2,f0=0.04,albedo=0.3"
    out, _ = walk.measure("cal_a", f"sim:?sample={spec}&seed=3")
    walk.call("calibrate", "sim:?seed=3", "-o", str(walk.folder / "other.scat"), "--json")
    again = walk.folder / "cal_b"
    walk.call("process", str(out / "recording.scat"), "--calibration", str(walk.folder / "other.scat"), "-o", str(again), "--json")
    walk.check_comparison("another session's calibration", walk.compare(again, spec))
    # One served instrument, three measurements: its noise goes on, so that repeats differ.
    socket = walk.folder / "instrument"
    server = subprocess.Popen([walk.scatter, "simulate", "--listen", f"unix:{socket}", "--sample", spec, "--seed", "3",
                               "--clock", "virtual"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        for _ in range(100):
            if socket.exists():
                break
            clock.sleep(0.05)
        os.environ["SCATTER_LIBRARY"] = str(walk.folder / "library")
        records = []
        for k in range(3):
            o, result = walk.measure(f"repeat_{k}", f"unix:{socket}")
            records.append(str(o / "recording.scat"))
            if k > 0:
                walk.row(f"repeat {k} finds the calibration", not result["calibration"]["performed"], "from the library")
    finally:
        server.terminate()
        server.wait(timeout=10)
    average = walk.folder / "average"
    result = walk.call("process", *records, "-o", str(average), "--json")
    walk.check_comparison("three repeats averaged", walk.compare(average, spec))
    agree = quality(result)["repeatability_chi_square"]
    walk.row("repeats agree within their uncertainty", agree["verdict"] == "ok", f"reduced chi2 {agree['value']:.3f}")
    turned = walk.folder / "turned"
    result = walk.call("process", records[0], records[1], "--rotation", "0", "90", "--merge", "rotations", "-o", str(turned), "--json")
    parts = walk.call("compare", str(turned / "brdf.exr"), spec, "--region", "measured", "--json")
    walk.row("two rotations merged", "anisotropy" in quality(result) and len(parts["incidences"]) == 8,
             f"{len(parts['incidences'])} incidences, anisotropy {quality(result)['anisotropy']['value']:.4f}")
    walk.check_comparison("two rotations merged", parts)


def coverage(walk, instruments):
    spec = "ggx:alpha=0.2,f0=0.04,albedo=0.3"

    def one(seed):
        out = walk.folder / f"drawn_{seed}"
        walk.call("measure", f"sim:?sample={spec}&seed={seed}&references=drawn", "-o", str(out), "--json")
        c = walk.compare(out, spec)
        shutil.rmtree(out)
        return c["coverage_95"]

    with concurrent.futures.ThreadPoolExecutor(max_workers=2) as pool:
        shares = list(pool.map(one, range(1, instruments + 1)))
    mean = sum(shares) / len(shares)
    walk.row(f"coverage over {instruments} drawn instruments", 0.93 <= mean <= 0.97, f"{100 * mean:.1f} % of bins")


def corrosion(walk, spots):
    """A steel sheet that rusts: what the instrument sees over the years, and whether it sees what is there."""
    looks = []
    worst = {}
    for age in (0, 1, 5, 10, 20):
        spec = f"corroded:age={age},corrosivity=low,starting_points=300,seed=1"
        out = walk.folder / f"corrosion_{age}"
        result = walk.call("measure", f"sim:?sample={spec}&seed=1", "-o", str(out), "--spots", str(spots), "--json",
                           timeout=3600)
        for k in range(0, spots, max(1, spots // 4)):
            spot = result["spots"][k]
            c = walk.compare(pathlib.Path(spot["folder"]), spot["sample"])
            walk.check_comparison(f"age {age} spot {k + 1} against its truth", c)
        rows = {row["theta_i_deg"]: row["channels"] for row in result["spread"]}
        angles = sorted(rows)
        # Peaks at 20 and 40 deg: the blind disc lies on that of the 0 deg head, and where half of a spot is rust
        # that of the 60 deg head may be saturated. The floor at 20, 40 and 60 deg, where metal sends little
        # farther than 45 deg from its peak; the share of that light in all at every incidence. Low corrosivity and
        # many starting points: rust spreads without growing so deep that it darkens.
        peaks = [c["peak_per_sr"]["mean"] for a in angles if 1 < a < 50 for c in rows[a]]
        floor = [rows[a][0]["diffuse_per_sr"]["mean"] for a in angles if a > 1]
        share = [rows[a][0]["diffuse_share"]["mean"] for a in angles]
        spread = max(c["albedo"]["standard_deviation"] / c["albedo"]["mean"] for a in angles for c in rows[a])
        looks.append((age, peaks, floor, share, spread))
        shutil.rmtree(out)
    for (a, peaks_a, floor_a, share_a, _), (b, peaks_b, floor_b, share_b, spread) in zip(looks, looks[1:]):
        walk.row(f"age {a} to {b}: peaks fall", all(y < x for x, y in zip(peaks_a, peaks_b)),
                 f"mean of {spots} spots, red at 40 deg: {peaks_a[3]:.3f} to {peaks_b[3]:.3f} /sr")
        rise = all(y > x for x, y in zip(floor_a + share_a, floor_b + share_b))
        walk.row(f"age {a} to {b}: the diffuse part rises", rise,
                 f"red at 40 deg: {floor_a[1]:.4f} to {floor_b[1]:.4f} /sr, {100 * share_a[2]:.1f} to "
                 f"{100 * share_b[2]:.1f} % of the light; spots differ by {100 * spread:.0f} %")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("scatter")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--instruments", type=int, default=100)
    parser.add_argument("--spots", type=int, default=20)
    parser.add_argument("--only")
    options = parser.parse_args()
    walk = Walk(options.scatter)
    parts = {"accuracy": lambda: accuracy(walk, options.seeds), "film": lambda: film(walk), "real_data": lambda: real_data(walk),
             "tilt": lambda: tilt(walk), "flags": lambda: flags(walk), "time": lambda: time(walk),
             "repeatable": lambda: repeatable(walk), "any_calibration": lambda: any_calibration(walk),
             "corrosion": lambda: corrosion(walk, options.spots),
             "coverage": lambda: coverage(walk, options.instruments)}
    try:
        for name, part in parts.items():
            if options.only in (None, name):
                try:
                    part()
                except (RuntimeError, KeyError, OSError, ValueError, subprocess.SubprocessError) as e:
                    walk.row(name, False, f"{type(e).__name__}: {e}")
    finally:
        shutil.rmtree(walk.folder, ignore_errors=True)
    print(f"{sum(walk.rows)} passed, {len(walk.rows) - sum(walk.rows)} failed")
    return 0 if all(walk.rows) else 1


if __name__ == "__main__":
    sys.exit(main())
