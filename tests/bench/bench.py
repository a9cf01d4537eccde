#!/usr/bin/env python3
"""Runs octrace's benchmarks and gathers them in a folder: JSON rows and summary.md. Parts run at different
times with the same --out add up to one summary.

    script/bench [rays] [build] [growth] [startup] [gpu]    all of them where none is named
"""
import argparse
import datetime
import json
import os
import platform
import subprocess
import sys

import startup
import summary

PARTS = ["rays", "build", "growth", "startup", "gpu"]
GENERATED = {False: ["builtin:terrain", "builtin:soup"], True: ["builtin:terrain:64", "builtin:soup:20000"]}
FILES = ["bunny.glb", "sponza.glb"]


class Bench:
    def __init__(self, options):
        self.options = options
        self.failed = []
        self.notes = {}  # by part: what could not be measured, and why
        os.makedirs(options.out, exist_ok=True)

    def path(self, name):
        return os.path.join(self.options.out, name)

    def program(self, name):
        return os.path.join(self.options.bin, name)

    def scenes(self):
        """Every scene but what this machine lacks; --quick takes small ones of the same kinds."""
        if self.options.quick:
            return GENERATED[True]
        files = [os.path.join(self.options.scenes, name) for name in FILES]
        missing = [name for name in files if not os.path.exists(name)]
        if missing:
            self.notes["scenes"] = "Left out, as they are not there: %s (--scenes names their folder)." % (
                ", ".join(os.path.basename(name) for name in missing))
        return [name for name in files if name not in missing] + GENERATED[False]

    def measure(self, part, *arguments):
        """The rows of one run of octrace-bench; a run that fails is told and the others go on."""
        rows = self.path("part.json")
        print("$ octrace-bench " + " ".join(arguments), flush=True)
        done = subprocess.run([self.program("octrace-bench"), *arguments, "--json", rows])
        if done.returncode != 0:
            self.failed.append("%s: octrace-bench %s: exit %d" % (part, " ".join(arguments), done.returncode))
            return []
        with open(rows) as file:
            found = json.load(file)
        os.remove(rows)
        return found

    def keep(self, name, rows):
        with open(self.path(name + ".json"), "w") as file:
            json.dump(rows, file, indent=1)
            file.write("\n")

    def repeats(self, usual):
        return ["--repeats", str(self.options.repeats or (2 if self.options.quick else usual))]

    def peer(self, *with_embree):
        return list(with_embree) if self.about["embree"] else []

    def rays(self):
        rows = []
        size = "160x96" if self.options.quick else "1280x720"
        for scene in self.scenes():
            for builder in ("sah", "quality"):
                rows += self.measure(
                    "rays", "rays", "--scene", scene, "--size", size, "--threads", "1", "--builder", builder,
                    "--scaling", str(self.options.threads), *self.peer("--peer", "embree"), *self.repeats(5))
        self.keep("rays", rows)

    def build(self):
        rows = []
        for threads in sorted({1, self.options.threads}):
            for scene in self.scenes():
                rows += self.measure("build", "build", "--scene", scene, "--threads", str(threads),
                                     *self.peer("--peer"), *self.repeats(5))
        self.keep("build", rows)

    def growth(self):
        quads = self.options.quads or ("16,32,64" if self.options.quick else "256,512,1024,2048,4096")
        size = "80x45" if self.options.quick else "512x288"
        kept = self.path("growth.json")
        merge = ["--merge", kept] if os.path.exists(kept) else []
        rows = self.measure("growth", "growth", "--quads", quads, "--size", size, "--svg",
                            self.path("growth.svg"), "--threads", str(self.options.threads),
                            *self.peer("--peer"), *merge, *self.repeats(5))
        if rows:
            self.keep("growth", rows)

    def startup(self):
        octrace = self.program("octrace")
        if not os.path.exists(octrace):
            self.notes["startup"] = "No start-up: %s is not there." % octrace
            return
        repeats = self.options.repeats or (3 if self.options.quick else 20)
        print("$ start-up, %d rounds" % repeats, flush=True)
        rows, note = startup.measure(octrace, repeats)
        if note:
            self.notes["startup"] = note
        for row in rows:
            print(startup.line(row), flush=True)
        self.keep("startup", rows)

    def gpu(self):
        probe = subprocess.run([self.program("octrace-bench"), "rays", "--scene", "builtin:default", "--size",
                                "8x8", "--device", "cuda"], capture_output=True, text=True)
        if probe.returncode == 4:  # unsupported: no CUDA in the build, no driver or no GPU
            self.notes["gpu"] = "No GPU: %s." % probe.stderr.strip().removeprefix("octrace-bench: error: ")
            return
        rows, builds = [], []
        size = "160x96" if self.options.quick else "2048x2048"
        for scene in self.scenes():
            for builder in ("sah", "quality", "hploc"):
                rows += self.measure("gpu", "rays", "--scene", scene, "--size", size, "--device", "cuda",
                                     "--builder", builder, *self.repeats(10))
            builds += [row for row in self.measure("gpu", "build", "--scene", scene, "--gpu", "0",
                                                   *self.repeats(3)) if row["builder"] == "octrace hploc"]
        self.keep("gpu", rows)
        self.keep("gpu-build", builds)

    def machine(self):
        """When, where and with what; taken before anything runs, so that the load is others'."""
        with open("/proc/cpuinfo") as file:
            cpu = next((line.split(":")[1].strip() for line in file if line.startswith("model name")), "unknown")
        return {"date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%d %H:%M UTC"),
                "cpu": cpu, "cores": len(os.sched_getaffinity(0)), "load": os.getloadavg()[0],
                "memory_gb": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9,
                "system": platform.freedesktop_os_release()["PRETTY_NAME"], "kernel": platform.release(),
                "commit": self.options.commit or commit(), "quick": self.options.quick, **self.about}

    def run(self):
        about = subprocess.run([self.program("octrace-bench"), "about"], capture_output=True, text=True, check=True)
        self.about = json.loads(about.stdout)
        machine = self.machine()
        for part in self.options.parts:
            getattr(self, part)()
        earlier = summary.read(self.options.out, "machine") or {"notes": {}}
        others = {part: note for part, note in earlier["notes"].items() if part not in self.options.parts}
        self.keep("machine", {**machine, "notes": {**others, **self.notes}})
        text = summary.markdown(self.options.out)
        with open(self.path("summary.md"), "w") as file:
            file.write(text)
        print("\n" + text + "\n" + self.path("summary.md"))
        for failure in self.failed:
            print("script/bench: failed: " + failure, file=sys.stderr)
        return 1 if self.failed else 0


def commit():
    here = os.path.dirname(os.path.abspath(__file__))
    found = subprocess.run(["git", "-C", here, "describe", "--always", "--dirty", "--abbrev=10"],
                           capture_output=True, text=True)
    return found.stdout.strip() or "unknown"


def main():
    root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    parser = argparse.ArgumentParser(prog="script/bench", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help="of %s; all where none is named" % ", ".join(PARTS))
    parser.add_argument("--quick", action="store_true", help="small scenes and few repeats: does it run at all?")
    parser.add_argument("--out", help="folder of the results [out/bench, or out/bench-quick]")
    parser.add_argument("--bin", help="folder of octrace and octrace-bench; nothing is installed or built")
    parser.add_argument("--scenes", default=os.path.join(root, "../shared/scenes/bench"),
                        help="folder of %s" % " and ".join(FILES))
    parser.add_argument("--threads", type=int, default=len(os.sched_getaffinity(0)),
                        help="of what runs on more than one [the machine's: %(default)s]")
    parser.add_argument("--repeats", type=int, help="timed runs a row, in place of each part's own")
    parser.add_argument("--quads", help="growth: sides of the terrains [256,512,1024,2048,4096]")
    parser.add_argument("--commit", help="what to call the measured version [git's name of this one]")
    options = parser.parse_args()
    unknown = [part for part in options.parts if part not in PARTS]
    if unknown or options.threads < 1:
        parser.error("no part is called %s" % unknown[0] if unknown else "--threads needs at least 1")
    options.parts = options.parts or PARTS
    options.out = options.out or os.path.join(root, "out/bench-quick" if options.quick else "out/bench")
    options.bin = options.bin or os.path.join(root, "build/release/bin")
    return Bench(options).run()


if __name__ == "__main__":
    sys.exit(main())
