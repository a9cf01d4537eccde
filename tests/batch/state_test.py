"""End to end tests of what a run of `octrace batch` leaves for the next one: journals, locks, disks
that are full. As batch_test.py.

OCTRACE_TEST_INTENSITY scales how often a run is killed. Cases that mount need root and skip without.
"""
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import unittest

from batch_case import BatchCase, INTENSITY, TRIANGLE


class Resume(BatchCase):
    def big_job(self, **members):
        shutil.copy(TRIANGLE, self.path("b.gltf"))
        return self.job(**{"scenes": ["a.gltf", "builtin:paper", "b.gltf"], "size": [160, 120],
                           "cameras": [{"turntable": {"n": 5}}], **members})

    def temporaries_of(self, name):
        folder = self.path("out")
        return [f for f in (os.listdir(folder) if os.path.isdir(folder) else [])
                if f.startswith(".%s.octrace-" % name)]

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

    def test_killed_while_the_summary_is_written(self):
        self.job()
        for _ in range(40):
            shutil.rmtree(self.path("out"), ignore_errors=True)
            process = self.start()
            while process.poll() is None and not self.temporaries_of("summary"):
                pass
            process.kill()
            process.communicate()
            if self.temporaries_of("summary"):
                break
        else:
            self.skipTest("writes faster than this test looks")
        self.run_batch()
        self.assertEqual(self.temporaries(), [])

    def test_results_that_cannot_be_written(self):
        self.job()
        os.makedirs(self.path("out", "cameras.json"))
        _, err = self.run_batch(code=5)
        self.assertIn("cameras.json", err)
        self.assertEqual(self.journal()[-1]["kind"], "end")
        self.assertEqual(self.temporaries(), [])
        self.assertFalse(os.path.exists(self.path("out", "summary.json")))
        os.rmdir(self.path("out", "cameras.json"))
        _, err = self.run_batch()
        self.assertIn("6 before", err)
        for name in ("cameras.json", "objects.json", "summary.json"):
            self.assertTrue(os.path.isfile(self.path("out", name)), name)

    def test_a_merge_removes_what_a_killed_one_left(self):
        self.job()
        self.run_batch("--shard", "1/2")
        self.run_batch("--shard", "2/2")
        for name in (".cameras.octrace-Xa5u6Z.json", ".summary.octrace-Xa5u6Z.json"):
            with open(self.path("out", name), "w") as file:
                file.write("{")
        self.run_batch("--merge")
        self.assertEqual(self.temporaries(), [])

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
        packs = sorted(line["path"] for line in self.journal() if line["kind"] == "pack")
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


if __name__ == "__main__":
    unittest.main(argv=sys.argv)
