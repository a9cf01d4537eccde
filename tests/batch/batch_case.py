"""What the tests of `octrace batch` share: a folder with a scene, and a job in it."""
import copy
import hashlib
import json
import os
import shutil
import subprocess
import tempfile
import unittest

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
