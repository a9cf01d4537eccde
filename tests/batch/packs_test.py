"""End to end tests of the packs that `octrace batch` writes. As batch_test.py.

OCTRACE_TEST_INTENSITY scales how often a run is killed.
"""
import hashlib
import json
import os
import random
import shutil
import signal
import sys
import tarfile
import time
import unittest

from batch_case import BatchCase, INTENSITY, TRIANGLE


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


if __name__ == "__main__":
    unittest.main(argv=sys.argv)
