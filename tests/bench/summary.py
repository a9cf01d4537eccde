"""The Markdown summary of a folder of results, made to be pasted into docs/performance.md."""
import json
import math
import os


def read(folder, name):
    path = os.path.join(folder, name + ".json")
    if not os.path.exists(path):
        return []
    with open(path) as file:
        return json.load(file)


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def number(row, key, form="%.2f"):
    return form % row[key] if key in row else ""


def spread(row, key, form="%.2f"):
    return ("%s [%s, %s]" % (form, form, form)) % (row[key], row[key + "_lowest"], row[key + "_highest"])


def geometric_mean(values):
    return math.exp(sum(map(math.log, values)) / len(values)) if values else 0.0


def ray_rows(rows):
    ratios = {(row["scene"], row["set"], row["builder"]): row["ratio"] for row in rows if "ratio" in row}
    shown = []
    for row in rows:
        peer = "%s (%s)" % (spread(row, "peer_mrays_per_s"), row["peer_interface"]) if "ratio" in row else ""
        best = ratios.get((row["scene"], row["set"], "quality"))
        share = "%.2f" % (row["ratio"] / best) if best and row["builder"] == "sah" else ""
        shown.append([row["scene"], row["builder"], row["set"], spread(row, "mrays_per_s"), peer,
                      number(row, "ratio"), share, number(row, "scaling")])
    return shown


def rays(folder):
    rows = read(folder, "rays")
    if not rows:
        return ""
    threads = next((str(row["scaling_threads"]) for row in rows if "scaling_threads" in row), "more")
    text = "## Rays on the CPU, one thread\n\n"
    text += table(["scene", "builder", "set", "Mrays/s", "Embree high, Mrays/s", "ratio", "of quality's ratio",
                   "x on %s threads" % threads], ray_rows(rows))
    for builder in sorted({row["builder"] for row in rows}, reverse=True):
        mine = [row for row in rows if row["builder"] == builder and "ratio" in row]
        if mine:
            least = min(mine, key=lambda row: row["ratio"])
            text += "\n%s: geometric mean of %d ratios %.2f, least %.2f (%s, %s)." % (
                builder, len(mine), geometric_mean([row["ratio"] for row in mine]), least["ratio"],
                least["scene"], least["set"])
    agreeing = [row["agreement"] for row in rows if "agreement" in row]
    if agreeing:
        text += "\nHits agree with Embree's on at least %.4f %% of a row's rays.\n" % (100 * min(agreeing))
    return text + "\n"


BUILD_EXTRAS = [("bytes_per_triangle", "bytes a triangle", "%.1f"), ("sah_cost", "cost", "%.2f"),
                ("wide_ms", "CPU nodes, ms", "%.1f")]


def build(folder):
    rows = read(folder, "build") + read(folder, "gpu-build")
    if not rows:
        return ""
    medium = {(row["scene"], row["threads"]): row["mtri_per_s"] for row in rows if row["builder"] == "embree medium"}
    high = {(row["scene"], row["threads"]): row["mtri_per_s"] for row in rows if row["builder"] == "embree high"}
    extras = [extra for extra in BUILD_EXTRAS if any(extra[0] in row for row in rows)]
    peak = any("peak_bytes" in row for row in rows)
    shown = []
    for row in rows:
        key = (row["scene"], row["threads"])
        beside = {"octrace sah": medium, "octrace quality": high}.get(row["builder"], {}).get(key)
        gpu = row["builder"] == "octrace hploc"
        shown.append([row["scene"], row["builder"], "GPU" if gpu else str(row["threads"]), number(row, "ms"),
                      number(row, "mtri_per_s"), "%.2f" % (row["mtri_per_s"] / beside) if beside else ""])
        shown[-1] += [number(row, key, form) for key, _, form in extras]
        if peak:
            shown[-1].append("%.2f" % (row["peak_bytes"] / row["scene_bytes"]) if row.get("peak_bytes") else "")
    head = ["scene", "builder", "threads", "ms", "Mtri/s", "ratio"] + [name for _, name, _ in extras]
    if peak:
        head.append("peak / scene")
    return ("## Builds\n\nRatios: `sah` to Embree medium, `quality` to Embree high, in the same run.\n\n" +
            table(head, shown) + "\n")


def growth(folder):
    rows = read(folder, "growth")
    if not rows:
        return ""
    shown = []
    for row in rows:
        if "set" in row:
            shown.append([str(row["triangles"]), row["set"], number(row, "mrays_per_s"),
                          number(row, "peer_mrays_per_s"), number(row, "ratio"), number(row, "nodes_per_ray", "%.1f"),
                          number(row, "triangles_per_ray", "%.1f"), number(row, "time_per_log", "%.1f"),
                          number(row, "time_per_log_step"), number(row, "work_per_log_step")])
    builds = [[str(row["triangles"]), row["builder"], number(row, "ms", "%.0f"), number(row, "mtri_per_s")]
              for row in rows if "set" not in row]
    return ("## Growth, terrain of n x n quads\n\n" +
            "Last columns: time a ray over log2 of the triangles, that over the size before it (at most 1: no faster\n"
            "than the logarithm), and the same of nodes and triangles visited.\n\n" +
            table(["triangles", "set", "Mrays/s", "Embree", "ratio", "nodes a ray", "triangles a ray", "ns / log2",
                   "time's step", "work's step"], shown) + "\n" +
            table(["triangles", "builder", "ms", "Mtri/s"], builds) + "\n")


def startup(folder):
    rows = read(folder, "startup")
    if not rows:
        return ""
    shown = []
    for row in rows:
        over = number(row, "over_empty_ms", "%+.0f")
        most = number(row, "most_ms", "%.0f") or ("+%.0f" % row["most_over_empty_ms"] if over else "")
        shown.append([row["case"], spread(row, "ms", "%.1f"), over, most,
                      number(row, "peak_mb", "%.0f")])
    return "## Start-up: whole processes on two cores\n\n" + table(
        ["process", "ms", "over the empty program", "at most", "peak MB"], shown) + "\n"


def gpu(folder):
    rows = read(folder, "gpu")
    if not rows:
        return ""
    shown = [[row["scene"], row["builder"], row["set"], number(row, "mrays_per_s", "%.0f"),
              number(row, "mrays_per_s_median", "%.0f"), number(row, "mrays_per_s_lowest", "%.0f")] for row in rows]
    return ("## Rays on the GPU: %s\n\nEvery hit equals the CPU's, bit for bit.\n\n" % rows[0]["device_name"] +
            table(["scene", "builder", "set", "Mrays/s, best", "median", "lowest"], shown) + "\n")


def markdown(folder):
    m = read(folder, "machine")
    text = "# octrace-bench, %s\n\n%s, %d cores, %.0f GB, %s, Linux %s; load %.1f at the start. Compiler %s, " % (
        m["date"], m["cpu"], m["cores"], m["memory_gb"], m["system"], m["kernel"], m["load"], m["compiler"])
    text += "commit %s%s. Medians; the lowest and highest of the repeats in brackets.\n\n" % (
        m["commit"], ", Embree " + m["embree"] if m["embree"] else "")
    if m["quick"]:
        text += "**A quick run of small scenes: it shows that everything runs, not how fast.**\n\n"
    for note in m["notes"].values():
        text += note + "\n\n"
    return (text + rays(folder) + build(folder) + growth(folder) + startup(folder) + gpu(folder)).rstrip() + "\n"
