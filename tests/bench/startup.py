"""What a whole process costs: wall-clock time from its start to its end, and its peak memory. The cases take
turns, after one round that warms the file cache."""
import os
import shutil
import statistics
import subprocess
import tempfile
import time

SCENE = "builtin:terrain:224"  # 100,352 triangles
CORES = 2
MOST_OVER_EMPTY = 60.0  # ms, of a rendered image
MOST_WITHOUT_IMAGE = 30.0  # ms


def run(command, expected):
    """Milliseconds and peak kB of one process, whose exit code has to be the expected one."""
    null = [(os.POSIX_SPAWN_OPEN, fd, os.devnull, os.O_WRONLY, 0) for fd in (1, 2)]
    started = time.perf_counter()
    pid = os.posix_spawn(command[0], command, os.environ, file_actions=null)
    _, status, usage = os.wait4(pid, 0)
    ms = 1e3 * (time.perf_counter() - started)
    code = os.waitstatus_to_exitcode(status)
    if code != expected:
        raise RuntimeError("%s: exit %d, not %d" % (" ".join(command), code, expected))
    return ms, usage.ru_maxrss


def empty_program(folder):
    """A program that does nothing but link OpenImageIO, or None where it cannot be made."""
    source, program = os.path.join(folder, "empty.cpp"), os.path.join(folder, "empty")
    with open(source, "w") as file:
        file.write("int main() {}\n")
    try:
        subprocess.run(["c++", "-O2", "-o", program, source, "-Wl,--no-as-needed", "-lOpenImageIO"],
                       check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return program


def measure(octrace, repeats):
    folder = tempfile.mkdtemp(prefix="octrace_bench_")
    cores = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, sorted(cores)[:CORES])
        return measure_in(folder, os.path.abspath(octrace), repeats)
    finally:
        os.sched_setaffinity(0, cores)
        shutil.rmtree(folder, True)


def measure_in(folder, octrace, repeats):
    subprocess.run([octrace, "export", SCENE, "--to", "gltf", "-o", folder], check=True, stdout=subprocess.DEVNULL)
    glb = next(os.path.join(folder, name) for name in os.listdir(folder) if name.endswith(".glb"))
    small, broken = os.path.join(folder, "small.gltf"), os.path.join(folder, "broken.gltf")
    with open(small, "w") as file:
        file.write('{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{}]}')
    with open(broken, "w") as file:
        file.write('{"asset": {"version": "2.0"}, "scenes": [{"nodes": [7]}]}')
    image = os.path.join(folder, "image.exr")
    render = [octrace, "render", glb, "--size", "640x480", "--aov", "Z,mask", "-o", image, "--quiet", "--device", "cpu",
              "--threads", str(CORES)]
    cases = [("depth and mask of a .glb of 100,352 triangles, 640x480", render, 0, None),
             ("--help", [octrace, "--help"], 0, MOST_WITHOUT_IMAGE),
             ("render --help", [octrace, "render", "--help"], 0, MOST_WITHOUT_IMAGE),
             ("info of a small file", [octrace, "info", small], 0, MOST_WITHOUT_IMAGE),
             ("error: an argument", [octrace, "render", glb, "--size", "0x0", "-o", image], 2, MOST_WITHOUT_IMAGE),
             ("error: no such file", [octrace, "render", small + "x", "-o", image], 5, MOST_WITHOUT_IMAGE),
             ("error: a broken file", [octrace, "render", broken, "-o", image], 3, MOST_WITHOUT_IMAGE)]
    note = None
    empty = empty_program(folder)
    if empty:
        cases.insert(0, ("an empty program linked with OpenImageIO", [empty], 0, None))
    else:
        note = "No empty program to compare the start-up with: OpenImageIO cannot be linked here."

    times, peaks = [[] for _ in cases], [0] * len(cases)
    for turn in range(repeats + 1):
        for i, (_, command, expected, _) in enumerate(cases):
            ms, peak = run(command, expected)
            if turn > 0:
                times[i].append(ms)
            peaks[i] = max(peaks[i], peak)
    rows = []
    for i, (name, _, _, most) in enumerate(cases):
        row = {"case": name, "repeats": repeats, "ms": statistics.median(times[i]), "ms_lowest": min(times[i]),
               "ms_highest": max(times[i]), "peak_mb": peaks[i] / 1e3}
        if most:
            row["most_ms"] = most
        rows.append(row)
    if empty:
        rows[1]["over_empty_ms"] = rows[1]["ms"] - rows[0]["ms"]
        rows[1]["most_over_empty_ms"] = MOST_OVER_EMPTY
    return rows, note


def line(row):
    text = "%-58s %7.1f ms [%.1f, %.1f], %.0f MB" % (row["case"], row["ms"], row["ms_lowest"], row["ms_highest"],
                                                     row["peak_mb"])
    if "over_empty_ms" in row:
        text += ", %.1f ms more than the empty program" % row["over_empty_ms"]
    return text
