#!/usr/bin/env python3
"""Runs script/bench --quick over built programs and checks that every part left its rows, each with its
fields. Nothing here judges a time.

    tests/bench/bench_smoke.py BIN
"""
import json
import math
import os
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
SETS = {"primary", "bounce", "ao"}


def read(folder, name):
    with open(os.path.join(folder, name)) as file:
        return json.load(file)


def positive(row, *keys):
    for key in keys:
        assert row[key] > 0, (key, row)


def check(folder, embree):
    peer = ("peer_mrays_per_s", "ratio") if embree else ()
    rays = read(folder, "rays.json")
    assert {(r["scene"], r["builder"], r["set"]) for r in rays} == {
        (scene, builder, name) for scene in ("builtin:terrain:64", "builtin:soup:20000")
        for builder in ("sah", "quality") for name in SETS}, rays
    for row in rays:
        positive(row, "mrays_per_s", "mrays_per_s_lowest", "mrays_per_s_highest", "rays", "scaling", *peer)
        assert row["threads"] == 1 and row["repeats"] == 2 and row["device"] == "cpu", row
        if embree:
            assert row["agreement"] >= 0.9999 and row["peer"] == "embree", row
            assert abs(row["ratio"] - row["mrays_per_s"] / row["peer_mrays_per_s"]) < 1e-9, row

    builds = read(folder, "build.json")
    builders = {r["builder"] for r in builds}
    assert {"octrace sah", "octrace median"} <= builders, builders
    assert not embree or {"embree medium", "embree high"} <= builders, builders
    for row in builds:
        positive(row, "triangles", "threads", "ms", "mtri_per_s")
        if row["builder"].startswith("octrace"):
            positive(row, "bytes_per_triangle")

    growth = read(folder, "growth.json")
    rows = [row for row in growth if "set" in row]
    assert [(r["triangles"], r["set"]) for r in rows] == [
        (2 * n * n, name) for n in (16, 32, 64) for name in ("primary", "bounce", "ao")], rows
    for row in rows:
        positive(row, "mrays_per_s", "nodes_per_ray", "time_per_log", *peer)
        if row["quads"] > 16:
            positive(row, "time_per_log_step", "work_per_log_step")
    assert sum(r.get("builder") == "octrace sah" and "set" not in r for r in growth) == 3, growth
    with open(os.path.join(folder, "growth.svg")) as file:
        assert "octrace, bounce" in file.read()

    startup = read(folder, "startup.json")
    assert len(startup) >= 7, startup
    for row in startup:
        positive(row, "ms", "ms_lowest", "ms_highest", "peak_mb")

    with open(os.path.join(folder, "summary.md")) as file:
        text = file.read()
    for title in ("Rays on the CPU", "Builds", "Growth", "Start-up", "Compiler", "commit"):
        assert title in text, title


def check_views(program, folder):
    """Views are the same for any builder, each has its rows, and the means are those of the rows."""
    views = {}
    for builder in ("sah", "quality"):
        path = os.path.join(folder, builder + ".json")
        done = subprocess.run(
            [program, "rays", "--scene", "builtin:default", "--size", "64x48", "--views", "3", "--count",
             "--repeats", "1", "--builder", builder, "--json", path], check=True, capture_output=True, text=True)
        rows = read(folder, builder + ".json")
        assert [(r["view"], r["set"]) for r in rows] == [
            (view, name) for view in (1, 2, 3) for name in ("primary", "bounce", "ao")], rows
        views[builder] = [row["rays"] for row in rows]
        for name in SETS:
            line = next(l for l in done.stdout.splitlines() if l.startswith("mean of 3 views, %s:" % name))
            rate = math.exp(sum(math.log(r["mrays_per_s"]) for r in rows if r["set"] == name) / 3)
            assert "mrays_per_s %.2f" % rate in line, (line, rate)
            for key in ("nodes_per_ray", "triangles_per_ray"):
                mean = sum(row[key] for row in rows if row["set"] == name) / 3
                assert "%s %.2f" % (key, mean) in line, (line, mean)
    assert views["sah"] == views["quality"], views


def main():
    bin_folder = os.path.abspath(sys.argv[1])
    bench = [sys.executable, os.path.join(HERE, "bench.py"), "--quick", "--bin", bin_folder]
    about = json.loads(subprocess.run([os.path.join(bin_folder, "octrace-bench"), "about"], check=True,
                                      capture_output=True, text=True).stdout)
    with tempfile.TemporaryDirectory(prefix="octrace_bench_") as folder:
        subprocess.run([*bench, "--out", folder, "--threads", "2"], check=True)
        check(folder, about["embree"])
        check_views(os.path.join(bin_folder, "octrace-bench"), folder)
        # Sizes measured before are kept, not measured again.
        kept = [row for row in read(folder, "growth.json") if row["quads"] == 16]
        subprocess.run([*bench, "growth", "--quads", "8,16", "--out", folder], check=True,
                       stdout=subprocess.DEVNULL)
        again = read(folder, "growth.json")
        assert [row for row in again if row["quads"] == 16 and "set" not in row] == [
            row for row in kept if "set" not in row]
        assert {row["quads"] for row in again} == {8, 16, 32, 64}
        # A part that fails is told by the exit code, and leaves the others' rows.
        failed = subprocess.run([*bench, "growth", "--quads", "1", "--out", folder], capture_output=True, text=True)
        assert failed.returncode == 1 and "failed: growth" in failed.stderr, failed
        assert read(folder, "growth.json") == again
    assert subprocess.run([*bench, "sleep"], capture_output=True).returncode == 2


main()
