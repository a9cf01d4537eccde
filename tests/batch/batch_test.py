"""End to end tests of `octrace batch`, judged by exit codes, messages and files.

    OCTRACE_PROGRAM=build/release/bin/octrace python3 tests/batch/batch_test.py [Class.case ...]

OCTRACE_TEST_INTENSITY scales how often a run is killed. Cases that mount need root and skip without.
"""
import copy
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tarfile
import tempfile
import time
import unittest

from job_cases import INVALID, VALID

PROGRAM = os.path.abspath(os.environ["OCTRACE_PROGRAM"])
SOURCE = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", ".."))
TRIANGLE = os.path.join(SOURCE, "tests", "data", "triangle.gltf")
INTENSITY = float(os.environ.get("OCTRACE_TEST_INTENSITY", "1"))

LEAST = {"version": 1, "scenes": ["a.gltf"], "cameras": [{"turntable": {"n": 6, "elevation": 20}}],
         "size": [32, 24], "aovs": ["Z", "mask", "object_id"],
         "output": "out/{scene}_{camera}_{frame:04}.exr"}


class BatchCase(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="octrace_batch_")
        self.addCleanup(shutil.rmtree, self.folder, True)
        shutil.copy(TRIANGLE, self.path("a.gltf"))

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def job(self, **members):
        job = copy.deepcopy(LEAST)
        job.update(members)
        job = {key: value for key, value in job.items() if value is not None}
        with open(self.path("job.json"), "w") as file:
            json.dump(job, file)
        return job

    def start(self, *arguments, **environment):
        return subprocess.Popen([PROGRAM, "batch", "job.json", *arguments], cwd=self.folder,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                env={**os.environ, **environment})

    def run_batch(self, *arguments, code=0):
        process = self.start(*arguments)
        out, err = process.communicate(timeout=300)
        self.assertEqual(process.returncode, code, err)
        return out, err

    def outputs(self, folder="out"):
        """Hashes of the images below a folder, hidden ones too, by path."""
        found = {}
        for place, _, names in os.walk(self.path(folder)):
            for name in names:
                path = os.path.join(place, name)
                if name.endswith((".exr", ".png", ".npz")):
                    with open(path, "rb") as file:
                        found[os.path.relpath(path, self.path(folder))] = hashlib.sha256(
                            file.read()).hexdigest()
        return found

    def temporaries(self):
        return [name for _, _, names in os.walk(self.folder) for name in names
                if ".octrace-" in name]

    def journal(self, shard="1-of-1", folder="out"):
        with open(self.path(folder, ".octrace", "journal-%s.ndjson" % shard)) as file:
            return [json.loads(line) for line in file]


class Jobs(BatchCase):
    """The schema file and the program's own checks agree on every case."""

    def setUp(self):
        super().setUp()
        shutil.copy(TRIANGLE, self.path("b.gltf"))
        identity = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]]
        with open(self.path("transforms.json"), "w") as file:
            json.dump({"fl_x": 500, "w": 640, "h": 480,
                       "frames": [{"file_path": "images/f1.png", "transform_matrix": identity}]}, file)
        with open(self.path("path.json"), "w") as file:
            camera = {"type": "perspective", "yfov": 0.7,
                      "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 3, 1]}
            json.dump({"cameras": [camera, camera]}, file)
        try:
            import jsonschema
            with open(os.path.join(SOURCE, "backend", "batch", "job.schema.json")) as file:
                schema = json.load(file)
            jsonschema.Draft202012Validator.check_schema(schema)
            self.schema = jsonschema.Draft202012Validator(schema)
        except ImportError:
            self.schema = None

    def both(self, change):
        job = copy.deepcopy(LEAST)
        change(job)
        with open(self.path("job.json"), "w") as file:
            json.dump(job, file)
        process = subprocess.run([PROGRAM, "batch", "job.json", "--dry-run"], cwd=self.folder,
                                 capture_output=True, text=True, timeout=60)
        return job, process, self.schema.is_valid(job) if self.schema else None

    def test_valid(self):
        for name, change in VALID:
            with self.subTest(name):
                job, process, valid = self.both(change)
                self.assertEqual(process.returncode, 0, process.stderr)
                self.assertIn(valid, (True, None), job)

    def test_invalid(self):
        for name, change, pointer, in_schema in INVALID:
            with self.subTest(name):
                job, process, valid = self.both(change)
                self.assertIn(process.returncode, (2, 6), process.stderr)
                place = "job.json#%s: " % pointer if pointer else "job.json: "
                self.assertIn(place, process.stderr)
                self.assertFalse(os.path.exists(self.path("out")))
                if self.schema:
                    self.assertEqual(valid, not in_schema, job)

    def test_no_json_and_no_file(self):
        with open(self.path("job.json"), "w") as file:
            file.write('{"version": 1,')
        self.assertIn("INVALID_JSON", self.run_batch(code=2)[1])
        os.remove(self.path("job.json"))
        self.run_batch(code=5)


class DryRun(BatchCase):
    def test_says_that_a_scene_is_not_there(self):
        self.job(scenes=["a.gltf", "none.glb"], cameras=[{"turntable": {"n": 1}}])
        err = self.run_batch("--dry-run")[1]
        self.assertIn("none.glb: there is no such file", err)
        self.assertNotIn("a.gltf: there", err)

    def test_lists_every_file_and_makes_none(self):
        self.job(scenes=["a.gltf", {"path": "builtin:paper", "name": "../p q"}], frames="1-3:2",
                 cameras=[{"turntable": {"n": 2, "name": "t"}}],
                 output=["out/{scene}/{camera}_{frame:04}.exr",
                         {"path": "out/{view:03}_{aov}.npy", "aovs": ["mask", "Z"]}])
        out, err = self.run_batch("--dry-run")
        expected = []
        view = 0
        for scene in ("a", "_._p_q"):  # "../p q": nothing of it leaves its place
            for frame in (1, 3):
                for camera in ("t_000", "t_001"):
                    expected.append("out/%s/%s_%04d.exr" % (scene, camera, frame))
                    expected.append("out/%03d_mask.npy" % view)
                    expected.append("out/%03d_Z.npy" % view)
                    view += 1
        self.assertEqual(out.splitlines(), expected)
        self.assertFalse(os.path.exists(self.path("out")))

    def test_cameras_of_the_scene_without_loading_it(self):
        # Images and buffers that are not there do not matter to a list of files.
        with open(self.path("b.gltf"), "w") as file:
            json.dump({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 2]}],
                       "nodes": [{"name": "Left", "camera": 0}, {"name": "Unused", "camera": 0},
                                 {"children": [3]}, {"camera": 0}],
                       "cameras": [{"name": "lens", "type": "perspective",
                                    "perspective": {"yfov": 0.7, "znear": 0.1}}],
                       "buffers": [{"uri": "missing.bin", "byteLength": 4}]}, file)
        self.job(scenes=["b.gltf"], cameras=None)
        self.assertEqual(self.run_batch("--dry-run")[0].splitlines(),
                         ["out/b_Left_0000.exr", "out/b_lens_0000.exr"])

    def test_shards_are_disjoint_complete_and_even(self):
        self.job(scenes=["a.gltf", "builtin:paper"], frames="1-7")
        whole = self.run_batch("--dry-run")[0].splitlines()
        self.assertEqual(len(whole), 84)
        for count in (1, 2, 5, 84, 100):
            parts = [self.run_batch("--dry-run", "--shard", "%d/%d" % (i + 1, count))[0].splitlines()
                     for i in range(count if count < 50 else 3)]
            if count < 50:
                self.assertEqual(sum(parts, []), whole)
                self.assertLessEqual(max(map(len, parts)) - min(map(len, parts)), 1)
        for wrong in ("0/3", "4/3", "1", "a/b", "1/0"):
            self.run_batch("--dry-run", "--shard", wrong, code=2)


class Cameras(BatchCase):
    def test_conventions_meet_in_the_same_image(self):
        opengl = [[1, 0, 0, 0.1], [0, 1, 0, 0.2], [0, 0, 1, 3], [0, 0, 0, 1]]
        opencv = [[1, 0, 0, 0.1], [0, -1, 0, 0.2], [0, 0, -1, 3], [0, 0, 0, 1]]
        inverse = [[1, 0, 0, -0.1], [0, -1, 0, 0.2], [0, 0, -1, 3]]
        columns = [row[c] for c in range(4) for row in opengl]
        with open(self.path("t.json"), "w") as file:
            json.dump({"camera_model": "PINHOLE", "fl_x": 40, "fl_y": 40, "cx": 16, "cy": 12, "w": 32,
                       "h": 24, "k1": 0,
                       "frames": [{"file_path": "./x/n.png", "transform_matrix": opengl}]}, file)
        lens = {"fx": 40, "fy": 40, "cx": 16, "cy": 12, "width": 32, "height": 24}
        self.job(cameras=[{"matrices": [opengl], "intrinsics": lens, "name": "gl"},
                          {"matrices": [columns], "intrinsics": lens, "name": "columns"},
                          {"matrices": [opencv], "convention": "opencv", "intrinsics": lens,
                           "name": "cv"},
                          {"matrices": [inverse], "convention": "opencv",
                           "pose": "world_to_camera", "intrinsics": lens, "names": ["w2c"]},
                          {"nerfstudio": "t.json"}],
                 output="out/{camera}.npz")
        self.run_batch()
        images = self.outputs()
        self.assertEqual(sorted(images), ["columns_000.npz", "cv_000.npz", "gl_000.npz", "n.npz",
                                          "w2c.npz"])
        self.assertEqual(len(set(images.values())), 1)
        objects = [line["lens"] for line in self.journal() if line["kind"] == "view"]
        self.assertEqual({lens["type"] for lens in objects}, {"pinhole"})

    def test_distortion_is_refused(self):
        matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]]
        for change in ({"k1": 0.1}, {"camera_model": "OPENCV_FISHEYE"}):
            with open(self.path("t.json"), "w") as file:
                json.dump({"fl_x": 40, "w": 32, "h": 24, "frames": [{"transform_matrix": matrix}],
                           **change}, file)
            self.job(cameras=[{"nerfstudio": "t.json"}])
            self.assertIn("t.json#/" + list(change)[0], self.run_batch(code=4)[1])

    def test_turntable_sees_the_whole_scene(self):
        self.job(scenes=["builtin:default"], output="out/{camera}.png", aovs=["mask"],
                 cameras=[{"turntable": {"n": 5, "elevation": -30}},
                          {"turntable": {"n": 1, "elevation": 90, "name": "top"}},
                          {"hemisphere": {"n": 5, "seed": 3}}])
        self.run_batch()
        self.assertEqual(len(self.outputs()), 11)


class Resume(BatchCase):
    def big_job(self, **members):
        shutil.copy(TRIANGLE, self.path("b.gltf"))
        return self.job(**{"scenes": ["a.gltf", "builtin:paper", "b.gltf"], "size": [160, 120],
                           "cameras": [{"turntable": {"n": 5}}], **members})

    def reference(self):
        self.run_batch("--out", "reference")
        return self.outputs("reference/out")

    def test_killed_at_random_moments(self):
        self.big_job()
        expected = self.reference()
        seed = int(os.environ.get("OCTRACE_TEST_SEED", "1"))
        rng = random.Random(seed)
        started = time.monotonic()
        self.run_batch("--force")
        length = time.monotonic() - started
        for attempt in range(max(1, round(4 * INTENSITY))):
            shutil.rmtree(self.path("out"))
            for _ in range(rng.choice((1, 1, 2))):
                process = self.start()
                time.sleep(rng.uniform(0.0, length))
                process.kill()
                process.communicate()
            before = {line["view"] for line in self.journal() if line["kind"] == "view"} \
                if os.path.exists(self.path("out", ".octrace", "journal-1-of-1.ndjson")) else set()
            self.run_batch()
            with self.subTest(seed=seed, attempt=attempt, done_before=len(before)):
                self.assertEqual(self.outputs(), expected)
                self.assertEqual(self.temporaries(), [])
                views = [line["view"] for line in self.journal() if line["kind"] == "view"]
                self.assertEqual(sorted(views), list(range(len(expected))))  # none twice

    def test_a_second_run_does_nothing(self):
        self.job()
        self.run_batch()
        before = {path: os.stat(self.path("out", path)).st_mtime_ns for path in self.outputs()}
        _, err = self.run_batch()
        self.assertIn("6 before", err)
        self.assertEqual(
            before, {path: os.stat(self.path("out", path)).st_mtime_ns for path in self.outputs()})

    def test_missing_and_cut_files_are_made_again(self):
        self.job()
        self.run_batch()
        expected = self.outputs()
        names = sorted(expected)
        os.remove(self.path("out", names[0]))
        os.truncate(self.path("out", names[3]), 100)
        _, err = self.run_batch()
        self.assertIn("4 before", err)
        self.assertEqual(self.outputs(), expected)

    def test_torn_journal(self):
        self.job()
        self.run_batch()
        expected = self.outputs()
        path = self.path("out", ".octrace", "journal-1-of-1.ndjson")
        with open(path, "rb") as file:
            text = file.read()
        rng = random.Random(7)
        header = text.index(b"\n") + 1
        for cut in [0, 5, header - 1, header] + [rng.randrange(header, len(text)) for _ in range(4)]:
            with open(path, "wb") as file:
                file.write(text[:cut])
            self.run_batch()
            with self.subTest(cut=cut):
                self.assertEqual(self.outputs(), expected)
                views = {line["view"] for line in self.journal() if line["kind"] == "view"}
                self.assertEqual(views, set(range(6)))

    def test_changed_job_and_scene_are_noticed(self):
        self.job()
        self.run_batch()
        self.job(size=[40, 24])
        _, err = self.run_batch(code=2)
        self.assertIn("/size/0 was 32, is 40", err)
        self.run_batch("--dry-run", code=2)
        self.run_batch("--force")
        self.run_batch()
        os.utime(self.path("a.gltf"), (1, 1))
        _, err = self.run_batch(code=2)
        self.assertIn("/scenes/0/file was", err)
        # What decides nothing about the images is no change.
        self.job(size=[40, 24], device="cpu")
        self.run_batch("--force")
        self.run_batch("--threads", "1")

    def test_compression(self):
        sizes = {}
        for name in ("none", "rle", "zips", "zip", "piz"):
            self.job(compression=name, scenes=["builtin:default"], size=[160, 120],
                     cameras=[{"turntable": {"n": 1}}], output="out/%s.exr" % name)
            self.run_batch("--force")
            sizes[name] = os.path.getsize(self.path("out", name + ".exr"))
        self.assertEqual(len(set(sizes.values())), 5, sizes)
        self.assertEqual(max(sizes, key=sizes.get), "none")

    def test_interrupted(self):
        self.job(size=[640, 480], frames="0-99", scenes=["builtin:terrain:64"])
        process = self.start()
        while not os.path.exists(self.path("out")) or not self.outputs():
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 130, err)
        self.assertIn("the same command goes on", err)
        self.assertEqual(self.temporaries(), [])
        lines = self.journal()
        self.assertTrue(lines[-1]["kind"] == "end" and lines[-1]["interrupted"])
        done = [line for line in lines if line["kind"] == "view"]
        self.assertEqual(len(done), len(self.outputs()))
        with open(self.path("out", "summary.json")) as file:
            self.assertTrue(json.load(file)["interrupted"])

    def test_shards_together_are_the_whole(self):
        self.big_job()
        expected = self.reference()
        runs = [self.start("--shard", "%d/3" % i) for i in (1, 2)]
        for run in runs:
            self.assertEqual((run.communicate(timeout=300), run.returncode)[1], 0)
        self.run_batch("--shard", "3/3")
        self.assertEqual(self.outputs(), expected)
        # Without shards nothing is left to do, whatever the division was.
        self.assertIn("15 before", self.run_batch()[1])


class Failures(BatchCase):
    def test_a_bad_scene_fails_alone(self):
        with open(self.path("bad.gltf"), "w") as file:
            file.write("{}")
        self.job(scenes=["bad.gltf", "a.gltf", "missing.glb"])
        _, err = self.run_batch(code=8)
        self.assertIn("scene 0 (bad), 6 views: ", err)
        self.assertIn("missing.glb", err)
        self.assertEqual(len(self.outputs()), 6)
        with open(self.path("out", "summary.json")) as file:
            summary = json.load(file)
        self.assertEqual((summary["done"], summary["failed"]), (6, 12))
        self.assertEqual([failure["scene"] for failure in summary["failures"]],
                         ["bad.gltf", "missing.glb"])
        # Mended, the rest is made.
        shutil.copy(TRIANGLE, self.path("missing.glb"))
        _, err = self.run_batch("--force", code=8)
        self.assertEqual(len(self.outputs()), 12)

    def test_a_bad_view_fails_alone(self):
        self.job(cameras=["nobody", {"turntable": {"n": 2}}])
        _, err = self.run_batch(code=8)
        self.assertIn("there is no camera nobody", err)
        self.assertEqual(len(self.outputs()), 2)

    def test_many_writers_begin_together(self):
        # The image library's threads must not be changed by each of them.
        self.job(cameras=[{"turntable": {"n": 60, "elevation": 20}}], aovs=["Z", "mask"], size=[64, 48],
                 output="out/{camera}.exr")
        for _ in range(12):
            self.run_batch("--force", "--threads", "16")
        self.assertEqual(len(self.outputs()), 60)

    def test_hostile_names_stay_in_their_place(self):
        for name in ("../../x", "/etc/x", ".", "..", "a/b\\c", "x" * 500, "-rf", "caf\u00e9"):
            self.job(scenes=[{"path": "a.gltf", "name": name}],
                     output="out/{scene}/v_{camera_index}.npz", cameras=[{"turntable": {"n": 1}}])
            self.run_batch("--force")
        found = sorted(self.outputs())
        self.assertEqual(len(found), len({os.path.dirname(path) for path in found}))
        self.assertTrue(all(path.count("/") == 1 and not path.startswith((".", "/")) for path in found))
        self.assertEqual(sorted(os.listdir(self.folder)), ["a.gltf", "job.json", "out"])

    def test_two_runs_on_one_folder(self):
        self.job(scenes=["builtin:terrain:64"], size=[640, 480], frames="0-199")
        first = self.start()
        try:
            while not os.path.exists(self.path("out")) or not self.outputs():
                time.sleep(0.02)
            _, err = self.run_batch(code=5)
            self.assertIn("process %d on " % first.pid, err)
            self.assertIn("LOCKED", self.run_batch("--shard", "2/3", code=5)[1])
        finally:
            first.kill()
            first.communicate()


class Locks(BatchCase):
    """A process that stands still with its lock is what a dead one on another node looks like, until
    the file server gives up its lock: the kill is that moment."""

    def stand_still(self, *arguments, **environment):
        process = self.start(*arguments, **environment)
        self.addCleanup(lambda: (process.kill(), process.communicate()))
        while not os.path.exists(self.path("out")) or not self.outputs():
            time.sleep(0.02)
        process.send_signal(signal.SIGSTOP)
        return process

    def read_until(self, process, text):
        line = process.stderr.readline()
        while line and text not in line:
            line = process.stderr.readline()
        self.assertIn(text, line)

    def big_job(self):
        self.job(scenes=["builtin:terrain:64"], size=[640, 480], frames="0-9")

    def test_a_requeued_task_waits_for_the_dead_one(self):
        self.big_job()
        self.run_batch("--out", "reference")
        expected = self.outputs("reference/out")
        task = {"SLURM_JOB_ID": "7", "SLURM_CLUSTER_NAME": "c"}
        dead = self.stand_still("--shard", "1/2", **task)
        second = self.start("--shard", "1/2", "--wait-lock", "120", **task)
        self.read_until(second, "waiting up to 120 s: process %d on " % dead.pid)
        self.assertIsNone(second.poll())
        dead.kill()
        _, err = second.communicate(timeout=120)
        self.assertEqual(second.returncode, 0, err)
        self.assertIn("the lock is free after", err)
        self.run_batch("--shard", "2/2")
        self.assertEqual(self.outputs(), expected)
        views = [line["view"] for line in self.journal("1-of-2") if line["kind"] == "view"]
        self.assertEqual(sorted(views), list(range(30)))  # none twice

    def test_the_wait_ends(self):
        self.big_job()
        dead = self.stand_still()
        _, err = self.run_batch("--wait-lock", "1.5", code=5)
        self.assertIn("process %d on " % dead.pid, err)
        self.assertRegex(err, r"\([0-9]+ s waited\)")

    def test_another_run_is_not_waited_for(self):
        self.big_job()
        first = self.stand_still("--shard", "1/2", SLURM_JOB_ID="7", SLURM_CLUSTER_NAME="c")
        for arguments, environment in (
                (("--shard", "1/2"), {}),
                (("--shard", "1/2", "--wait-lock", "600"),
                 {"SLURM_JOB_ID": "8", "SLURM_CLUSTER_NAME": "c"}),
                (("--shard", "1/3", "--wait-lock", "600"), {})):
            second = self.start(*arguments, **environment)
            _, err = second.communicate(timeout=60)
            self.assertEqual(second.returncode, 5, err)
            self.assertIn("process %d on " % first.pid, err)
            self.assertNotIn("waiting", err)

    def test_merging_waits_for_any_shard(self):
        self.big_job()
        dead = self.stand_still("--shard", "1/2")
        merge = self.start("--merge", "--wait-lock", "120", SLURM_JOB_ID="9")
        self.read_until(merge, "waiting up to 120 s")
        dead.kill()
        _, err = merge.communicate(timeout=60)
        self.assertEqual(merge.returncode, 8, err)
        self.assertIn("are missing", err)

    def test_a_signal_ends_the_wait(self):
        self.big_job()
        self.stand_still()
        second = self.start("--wait-lock", "600")
        self.read_until(second, "waiting up to 600 s")
        second.send_signal(signal.SIGTERM)
        second.communicate(timeout=60)
        self.assertEqual(second.returncode, 128 + signal.SIGTERM)


class Packs(BatchCase):
    """Tar files of views: the same bytes as loose files, whole or absent, a pack at a time."""
    PACK = {"path": "out/part-{pack:03}.tar", "views": 4}

    def packed_job(self, **members):
        return self.job(**{"scenes": ["a.gltf", "builtin:paper"], "size": [160, 120],
                           "cameras": [{"turntable": {"n": 5}}], "masks": "coco",
                           "aovs": ["Z", "object_id"], "output": "{view:04}.{aov}.npy",
                           "pack": self.PACK, **members})

    def packs(self):
        """Contents of the members by pack and name, in order."""
        found = {}
        for name in sorted(os.listdir(self.path("out"))):
            if name.endswith(".tar"):
                with tarfile.open(self.path("out", name)) as tar:
                    found[name] = {member.name: tar.extractfile(member).read()
                                   for member in tar.getmembers()}
        return found

    def hashes(self):
        hashes = {}
        for name in os.listdir(self.path("out")):
            if name.endswith(".tar"):
                with open(self.path("out", name), "rb") as file:
                    hashes[name] = hashlib.sha256(file.read()).hexdigest()
        return hashes

    def test_members_are_the_loose_files(self):
        self.packed_job(pack=None, output="loose/{view:04}.{aov}.npy")
        self.run_batch()
        self.packed_job()
        self.assertEqual(self.run_batch("--dry-run")[0].splitlines(),
                         ["out/part-%03d.tar" % i for i in range(3)])
        self.run_batch()
        packs = self.packs()
        self.assertEqual([len(members) for members in packs.values()], [12, 12, 6])
        with open(self.path("loose", "cameras.json")) as file:
            cameras = json.load(file)["views"]
        with open(self.path("loose", "objects.json")) as file:
            objects = json.load(file)["views"]
        names = [name for members in packs.values() for name in members]
        self.assertEqual(names, ["%04d.%s" % (view, end) for view in range(10)
                                 for end in ("Z.npy", "object_id.npy", "Z.json")])
        for members in packs.values():
            for name, content in members.items():
                if name.endswith(".npy"):
                    with open(self.path("loose", name), "rb") as file:
                        self.assertEqual(content, file.read(), name)
                    continue
                entry = json.loads(content)
                seen = entry.pop("objects")
                self.assertEqual(entry, cameras[entry["view"]])
                self.assertTrue(all(thing.pop("rle") for thing in seen))
                self.assertEqual(seen, objects[entry["view"]]["objects"])
        self.assertFalse(os.path.exists(self.path("out", "cameras.json")))
        with open(self.path("out", "objects.json")) as file:
            self.assertEqual(len(json.load(file)["scenes"]), 2)
        # Packs are noted as they become whole.
        self.assertEqual(sorted(line["views"] for line in self.journal() if line["kind"] == "pack"),
                         [[0, 3], [4, 7], [8, 9]])
        self.assertFalse([line for line in self.journal() if line["kind"] == "view"])

    def test_killed_at_random_moments(self):
        self.packed_job(size=[320, 240])
        started = time.monotonic()
        self.run_batch()
        length = time.monotonic() - started
        expected = self.hashes()
        rng = random.Random(int(os.environ.get("OCTRACE_TEST_SEED", "1")))
        for attempt in range(max(1, round(4 * INTENSITY))):
            shutil.rmtree(self.path("out"))
            process = self.start(TMPDIR=self.folder)
            time.sleep(rng.uniform(0.0, length))
            process.send_signal(rng.choice((signal.SIGKILL, signal.SIGINT)))
            process.communicate()
            self.run_batch()
            with self.subTest(attempt=attempt):
                self.assertEqual(self.hashes(), expected)
                self.assertFalse([name for name in os.listdir(self.path("out"))
                                  if ".octrace-" in name])
                packs = [line["pack"] for line in self.journal() if line["kind"] == "pack"]
                self.assertEqual(sorted(packs), [0, 1, 2])  # none twice
        self.assertIn("10 before", self.run_batch()[1])

    def test_shards_take_whole_packs(self):
        self.packed_job()
        self.run_batch()
        expected = self.hashes()
        shutil.rmtree(self.path("out"))
        for shard in ("2/2", "1/2"):
            self.run_batch("--shard", shard)
        self.run_batch("--merge")
        self.assertEqual(self.hashes(), expected)
        with open(self.path("out", "summary.json")) as file:
            summary = json.load(file)
        self.assertEqual((summary["done"], summary["left"]), (10, 0))

    def test_a_failed_view_is_missing_and_its_pack_is_tried_again(self):
        self.packed_job(cameras=["nobody", {"turntable": {"n": 4}}], scenes=["a.gltf", "b.gltf"])
        _, err = self.run_batch(code=8)
        self.assertIn("there is no camera nobody", err)
        packs = self.packs()  # views 0 and 5 to 9 fail: no camera, no scene
        self.assertEqual([len(members) for members in packs.values()], [9, 3])
        with open(self.path("out", "summary.json")) as file:
            summary = json.load(file)
        self.assertEqual((summary["done"], summary["failed"]), (4, 6))
        _, err = self.run_batch("--merge", code=8)
        self.assertIn("view 0 is missing", err)
        self.assertIn("views 5 to 9 are missing", err)
        shutil.copy(TRIANGLE, self.path("b.gltf"))
        self.run_batch("--force", code=8)
        self.assertEqual([len(members) for members in self.packs().values()], [9, 9, 6])

    def test_a_missing_pack_is_made_again(self):
        self.packed_job()
        self.run_batch()
        expected = self.hashes()
        os.remove(self.path("out", "part-001.tar"))
        _, err = self.run_batch()
        self.assertIn("6 before", err)
        self.assertEqual(self.hashes(), expected)

    def test_long_names(self):
        name = "n" * 90
        self.packed_job(scenes=[{"path": "a.gltf", "name": name}], output="{scene}/{scene}/{view}.npz",
                        cameras=[{"turntable": {"n": 1}}])
        self.run_batch()
        self.assertEqual(list(self.packs()["part-000.tar"]),
                         ["%s/%s/0.%s" % (name, name, end) for end in ("npz", "json")])


class Disks(BatchCase):
    """Needs to mount: root, and a kernel that lets it."""

    def mount(self, *arguments):
        os.makedirs(self.path("out"), exist_ok=True)
        done = subprocess.run(["mount", *arguments, self.path("out")], capture_output=True)
        if done.returncode != 0:
            self.skipTest("cannot mount here")
        self.addCleanup(subprocess.run, ["umount", "-l", self.path("out")], capture_output=True)

    def test_a_full_disk(self):
        self.job(size=[160, 120], compression="none")
        self.run_batch("--out", "reference")
        expected = self.outputs("reference/out")
        self.mount("-t", "tmpfs", "-o", "size=600k", "tmpfs")
        _, err = self.run_batch(code=5)
        self.assertIn("No space left", err)
        some = self.outputs()
        self.assertTrue(0 < len(some) < len(expected))
        self.assertLess(some.items(), expected.items())  # none of them is cut
        self.assertEqual(self.temporaries(), [])
        told = [line["view"] for line in self.journal() if line["kind"] == "view"]  # whole lines
        self.assertTrue(0 < len(told) <= len(some))
        subprocess.run(["mount", "-o", "remount,size=16m", self.path("out")], check=True)
        self.run_batch()
        self.assertEqual(self.outputs(), expected)
        told = [line["view"] for line in self.journal() if line["kind"] == "view"]
        self.assertEqual(sorted(told), list(range(len(expected))))  # none twice

    def test_a_full_disk_for_packs(self):
        self.job(size=[160, 120], output="{view}.npy", aovs=["Z"],
                 pack={"path": "out/{pack}.tar", "views": 2})
        self.mount("-t", "tmpfs", "-o", "size=400k", "tmpfs")
        _, err = self.run_batch(code=5)
        self.assertIn("No space left", err)
        self.assertEqual(self.temporaries(), [])
        packs = [line["path"] for line in self.journal() if line["kind"] == "pack"]
        self.assertEqual(packs, [name for name in sorted(os.listdir(self.path("out")))
                                 if name.endswith(".tar")])
        self.assertTrue(0 < len(packs) < 3)
        subprocess.run(["mount", "-o", "remount,size=16m", self.path("out")], check=True)
        self.run_batch()
        with open(self.path("out", "summary.json")) as file:
            self.assertEqual(json.load(file)["done"], 6)

    def test_a_read_only_folder(self):
        self.job()
        self.mount("-t", "tmpfs", "-o", "size=4m,ro", "tmpfs")
        _, err = self.run_batch(code=5)
        self.assertIn("Read-only", err)
        subprocess.run(["mount", "-o", "remount,rw", self.path("out")], check=True)
        self.run_batch()
        expected = self.outputs()
        self.assertEqual(len(expected), 6)
        # Half done, then read-only: the journal stays as it is, and the rest is made afterwards.
        for name in sorted(expected)[::2]:
            os.remove(self.path("out", name))
        before = self.journal()
        subprocess.run(["mount", "-o", "remount,ro", self.path("out")], check=True)
        _, err = self.run_batch(code=5)
        self.assertIn("Read-only", err)
        self.assertEqual(self.journal(), before)
        subprocess.run(["mount", "-o", "remount,rw", self.path("out")], check=True)
        _, err = self.run_batch()
        self.assertIn("3 before", err)
        self.assertEqual(self.outputs(), expected)


class Progress(BatchCase):
    def test_json_lines(self):
        self.job()
        _, err = self.run_batch("--progress", "json")
        lines = [json.loads(line) for line in err.splitlines() if line.startswith("{")]
        self.assertEqual(lines[-1]["done"], 6)
        self.assertEqual(lines[-1]["share"], 1.0)

    def test_openjd_lines(self):
        self.job()
        out, _ = self.run_batch("--progress", "openjd")
        self.assertIn("openjd_progress: 100.00\n", out)
        self.assertIn("openjd_status: 6 of 6 views\n", out)


if __name__ == "__main__":
    unittest.main(argv=sys.argv)
