"""End to end tests of `octrace batch`, judged by exit codes, messages and files: jobs, what they
list and make, and what fails.

    OCTRACE_PROGRAM=build/release/bin/octrace python3 tests/batch/batch_test.py [Class.case ...]
"""
import copy
import json
import os
import shutil
import subprocess
import sys
import time
import unittest

from batch_case import BatchCase, LEAST, PROGRAM, SOURCE, TRIANGLE
from job_cases import INVALID, VALID


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
