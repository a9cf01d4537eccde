#!/usr/bin/env python3
"""Measures `octrace batch`: views a second and where the time goes, memory over many views, runs that are
killed, and Blender beside it on the same views. Needs Python and the program, so it also measures a bundle.

    tests/bench/batch_bench.py [--octrace PROGRAM] [--device cuda] [--formats exr,png] [--views 1000]
                               [--memory 10000] [--kill 30] [--blender]
"""
import argparse
import hashlib
import json
import os
import random
import shutil
import statistics
import subprocess
import tempfile
import time

SCENE = "builtin:terrain:224"  # 100,352 triangles
PLANES = ["Z", "mask", "object_id"]
FORMATS = {"exr": {"output": "out/{camera}.exr"}, "png": {"output": "out/{camera}_{aov}.png"},
           "npz": {"output": "out/{camera}.npz"},
           **{"exr-" + c: {"output": "out/{camera}.exr", "compression": c}
              for c in ("zips", "rle", "piz", "none")}}

BLENDER = """
import bpy, json, mathutils, numpy, sys
if not hasattr(numpy, "bool"):
    numpy.bool = bool  # add-ons of Blender 3.4 ask for a name that NumPy 1.24 removed
poses = json.loads(sys.argv[sys.argv.index("--") + 2])
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=sys.argv[sys.argv.index("--") + 1])
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.cycles.samples = 1
scene.cycles.use_denoising = False
scene.cycles.max_bounces = 0
scene.render.use_persistent_data = True
scene.render.resolution_x, scene.render.resolution_y = 640, 480
scene.render.resolution_percentage = 100
layer = scene.view_layers[0]
layer.use_pass_z = layer.use_pass_object_index = True
scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
scene.render.image_settings.color_depth = "32"
camera = bpy.data.objects.new("c", bpy.data.cameras.new("c"))
scene.collection.objects.link(camera)
scene.camera = camera
camera.data.sensor_fit = "VERTICAL"
turn = mathutils.Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))  # +Y up to +Z up
for i, (matrix, yfov) in enumerate(poses):
    camera.data.angle = yfov
    camera.matrix_world = turn @ mathutils.Matrix([matrix[r::4] for r in range(4)])
    scene.render.filepath = sys.argv[sys.argv.index("--") + 3] + "%d.exr" % i
    bpy.ops.render.render(write_still=True)
"""


def write_job(arguments, folder, views, output, size=(640, 480), **members):
    job = {"version": 1, "scenes": [SCENE], "size": list(size), "aovs": PLANES, "output": output,
           "cameras": [{"turntable": {"n": views, "elevation": 20}}], "device": arguments.device, **members}
    path = os.path.join(folder, "job.json")
    with open(path, "w") as file:
        json.dump(job, file)
    return path


def run(arguments, job, *more):
    """Seconds by the clock, and of all processors together."""
    before, started = os.times(), time.monotonic()
    subprocess.run([arguments.octrace, "batch", job, "--force", "--quiet", *more], check=True)
    seconds, after = time.monotonic() - started, os.times()
    return seconds, (after.children_user + after.children_system -
                     before.children_user - before.children_system)


def summary(folder):
    with open(os.path.join(folder, "out", "summary.json")) as file:
        return json.load(file)


def throughput(arguments, folder):
    """Shares of a view: the tracing thread's, and of all writers together, who work beside it."""
    for name in arguments.formats.split(","):
        shutil.rmtree(os.path.join(folder, "out"), True)
        job = write_job(arguments, folder, arguments.views, **FORMATS[name])
        seconds, processor = run(arguments, job)
        told = summary(folder)
        n, ms = told["done"], told["ms"]
        size = sum(f["bytes"] for line in open(os.path.join(folder, "out/.octrace/journal-1-of-1.ndjson"))
                   for f in json.loads(line).get("files", [])) / n
        print("%-8s %6.1f views/s of %d, process %.1f s on %.2f cores, %.1f ms of processor time a view; "
              "a view: trace %.2f, waited for writers %.2f, encode %.2f, flush %.2f ms; load %.0f ms; "
              "%.0f kB a view; peak %.0f MB; %s" %
              (name, told["views_per_s"], n, seconds, processor / seconds,
               processor * 1e3 / n, ms["trace"] / n, ms["wait_for_writers"] / n,
               ms["encode"] / n, ms["flush"] / n, ms["load"], size / 1e3,
               told["peak_rss_bytes"] / 1e6, told["device"]), flush=True)


def resident(pid):
    with open("/proc/%d/status" % pid) as file:
        for line in file:
            if line.startswith("VmRSS"):
                return int(line.split()[1])


def memory(arguments, folder):
    shutil.rmtree(os.path.join(folder, "out"), True)
    job = write_job(arguments, folder, arguments.memory, "out/{camera}.exr", (48, 32))
    journal = os.path.join(folder, "out/.octrace/journal-1-of-1.ndjson")
    process = subprocess.Popen([arguments.octrace, "batch", job, "--quiet"])
    marks, seen, position = {}, 0, 0
    while process.poll() is None:
        time.sleep(0.01)
        if os.path.exists(journal):
            with open(journal, "rb") as file:
                file.seek(position)
                text = file.read()
                position += len(text)
                seen += text.count(b'{"kind":"view"')
        for mark in (100, arguments.memory // 10, arguments.memory // 2, arguments.memory - 20):
            if seen >= mark and mark not in marks:
                try:
                    marks[mark] = (seen, resident(process.pid))
                except (OSError, TypeError):
                    pass
    print("resident: " + ", ".join("%s kB after view %d" % (rss, at) for at, rss in marks.values()))
    values = [value[1] for value in marks.values() if value[1]]
    if len(values) > 1:
        print("last / first: %.4f, most / first: %.4f" %
              (values[-1] / values[0], max(values) / values[0]))


def hashes(folder):
    found = {}
    for place, _, names in os.walk(folder):
        for name in names:
            if name.endswith(".exr") or name in ("cameras.json", "objects.json"):
                with open(os.path.join(place, name), "rb") as file:
                    found[name] = hashlib.sha256(file.read()).hexdigest()
    return found


def kill(arguments, folder):
    out = os.path.join(folder, "out")
    job = write_job(arguments, folder, 50, "out/{camera}.exr")
    shutil.rmtree(out, True)
    length, _ = run(arguments, job)
    expected = hashes(out)
    rng = random.Random(arguments.seed)
    journal = os.path.join(out, ".octrace/journal-1-of-1.ndjson")
    twice, done = 0, []
    for attempt in range(arguments.kill):
        shutil.rmtree(out)
        process = subprocess.Popen([arguments.octrace, "batch", job, "--quiet"])
        time.sleep(rng.uniform(0.0, length))
        process.kill()
        process.wait()
        before = sum('"kind":"view"' in line for line in open(journal)) if os.path.exists(journal) else 0
        left = [n for _, _, names in os.walk(out) for n in names if ".octrace-" in n]
        subprocess.run([arguments.octrace, "batch", job, "--quiet"], check=True)
        again = [n for _, _, names in os.walk(out) for n in names if ".octrace-" in n]
        with open(journal) as file:
            views = [json.loads(line).get("view") for line in file if '"kind":"view"' in line]
        assert hashes(out) == expected and not again, (attempt, again)
        assert sorted(views) == list(range(50)), attempt
        twice += len(left)
        done.append(before)
    print("%d kills (seed %d) after %s of 50 views: all %d outputs as without, no view twice in the journal; "
          "%d temporary files found and removed, 0 left" %
          (arguments.kill, arguments.seed, sorted(done), len(expected), twice))


def blender(arguments, folder):
    subprocess.run([arguments.octrace, "export", SCENE, "--to", "gltf", "-o", folder + "/glb"],
                   check=True, stdout=subprocess.DEVNULL)
    glb = [os.path.join(folder, "glb", n) for n in os.listdir(folder + "/glb") if n.endswith(".glb")][0]
    job = write_job(arguments, folder, 10, "out/{camera}.exr", scenes=[glb])
    shutil.rmtree(os.path.join(folder, "out"), True)
    times = [run(arguments, job)[0] for _ in range(5)]
    poses = []
    with open(os.path.join(folder, "out/.octrace/journal-1-of-1.ndjson")) as file:
        for line in map(json.loads, file):
            if line["kind"] == "view":
                poses.append((line["lens"]["matrix"], line["lens"]["yfov"]))
    script = os.path.join(folder, "views.py")
    with open(script, "w") as file:
        file.write(BLENDER)

    def start(views):
        started = time.monotonic()
        # Blender's Python looks for its own modules by PATH, where another Python may come first.
        process = subprocess.run([shutil.which("blender") or "blender", "-b", "--factory-startup", "-noaudio", "--python-exit-code", "3",
                                  "-P", script, "--", glb, json.dumps(views), folder + "/b"],
                                 stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                 env={**os.environ, "PATH": "/usr/local/bin:/usr/bin:/bin"})
        seconds = time.monotonic() - started
        if process.returncode != 0:
            raise SystemExit("Blender failed: " + process.stdout[-2000:])
        for i in range(len(views)):
            os.remove(folder + "/b%d.exr" % i)  # it was made
        return seconds

    # In turns: machines that are shared change their speed within a minute.
    together, apart = [], []
    for pose in poses[:3]:
        together.append(start(poses))
        times += [run(arguments, job)[0] for _ in range(5)]
        apart.append(start([pose]) * len(poses))
        times += [run(arguments, job)[0] for _ in range(5)]

    def told(seconds):
        return "%.2f s (%.2f to %.2f)" % (statistics.median(seconds), min(seconds), max(seconds))
    own = statistics.median(times)
    print("ten views, medians: octrace %s, %d processes; Blender in one process %s, three times, %.1f x; "
          "in one process a view %s, from three views, %.0f x" %
          (told(times), len(times), told(together), statistics.median(together) / own, told(apart),
           statistics.median(apart) / own))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--octrace", default="build/release/bin/octrace")
    parser.add_argument("--views", type=int, default=1000, help="of the throughput; 0: none")
    parser.add_argument("--formats", default="exr,png,npz", help=", ".join(FORMATS))
    parser.add_argument("--device", default="cpu", help="cpu, cuda or cuda:N")
    parser.add_argument("--memory", type=int, default=10000, help="views; 0: none")
    parser.add_argument("--kill", type=int, default=0, help="kill -9 a 50-view job so many times")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--blender", action="store_true")
    arguments = parser.parse_args()
    arguments.octrace = os.path.abspath(arguments.octrace)
    folder = tempfile.mkdtemp(prefix="octrace_bench_")
    try:
        if arguments.views:
            throughput(arguments, folder)
        if arguments.memory:
            memory(arguments, folder)
        if arguments.kill:
            kill(arguments, folder)
        if arguments.blender:
            blender(arguments, folder)
    finally:
        shutil.rmtree(folder, True)


main()
