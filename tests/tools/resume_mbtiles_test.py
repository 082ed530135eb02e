#!/usr/bin/env python3
"""An .mbtiles file whose build was killed, stopped or starved of disk ends with the bytes of an
uninterrupted build, whatever the threads and the memory. (resume_test.py: the same for folders, and all
that does not depend on the form of the output.)

usage: resume_mbtiles_test.py QMPIPE [unittest's arguments]
QMPIPE_RESUME_SEED repeats the random moments of an earlier run; QMPIPE_RESUME_KILLS sets how many.
"""
import hashlib
import os
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import time
import unittest

QMPIPE = None
SEED = int(os.environ.get("QMPIPE_RESUME_SEED", random.SystemRandom().randrange(10**6)))
KILLS = int(os.environ.get("QMPIPE_RESUME_KILLS", 10))
# Fine enough that a run spends most of its time on tiles.
OPTIONS = {"--tolerance": "3000", "--gzip": "1", "--threads": "2", "--name": "t",
           "--checkpoint": "0.05"}


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def beside(out, suffix):
    return out.with_name(out.name + suffix)


class MbtilesRuns(unittest.TestCase):
    @staticmethod
    def prepare(folder):
        cls = MbtilesRuns
        cls.root = pathlib.Path(folder)
        cls.dem = cls.root / "dem.tif"
        subprocess.run([QMPIPE, "synth", "-o", cls.dem, "--size", "1800x1350", "--bounds",
                        "6,44,10,47", "--seed", "3", "--voids", "0.02"], check=True,
                       stdout=subprocess.DEVNULL)
        cls.reference = cls.root / "reference.mbtiles"
        started = time.monotonic()
        done = cls.build(cls.reference)
        assert done.returncode == 0, done.stderr
        cls.seconds = time.monotonic() - started
        cls.expected = sha256(cls.reference)

    @classmethod
    def command(cls, out, *extra):
        options = [word for name, value in OPTIONS.items() if name not in extra
                   for word in (name, value)]
        return [str(word) for word in (QMPIPE, "build", cls.dem, "-o", out, *options, *extra)]

    @classmethod
    def build(cls, out, *extra):
        return subprocess.run(cls.command(out, *extra), capture_output=True, text=True, timeout=120,
                              stdin=subprocess.DEVNULL, check=False)

    def start(self, out, *extra):
        process = subprocess.Popen(self.command(out, *extra), stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.stderr.close)
        self.addCleanup(process.kill)
        return process

    def wait_for_tiles(self, process, out):
        """Until the working file has grown beyond its empty tables."""
        working = beside(out, ".qmpipe-tmp")
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline and process.poll() is None:
            if working.exists() and working.stat().st_size > 100_000:
                return
            time.sleep(0.002)
        self.fail("no tiles came")

    def expect_finished(self, out):
        self.assertEqual(sha256(out), self.expected)
        left = sorted(path.name for path in out.parent.glob(out.name + "*"))
        self.assertEqual(left, [out.name, out.name + ".report.json"])

    def finish(self, out, *extra):
        done = self.build(out, *extra)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.expect_finished(out)
        for path in (out, beside(out, ".report.json")):
            path.unlink()
        return done

    def stop_without_working_file(self, out):
        process = self.start(out, "--threads", "1")
        self.wait_for_tiles(process, out)
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=60)[1]
        self.assertEqual(process.returncode, 130, said)
        beside(out, ".qmpipe-tmp").unlink()

    def test_threads_and_memory_leave_no_trace(self):
        for k, extra in enumerate((["--threads", "1"], ["--memory", "250M"], ["--threads", "7"],
                                   ["--checkpoint", "0"])):
            self.finish(self.root / f"other-{k}.mbtiles", *extra)

    def test_killed_at_random_moments_ends_with_the_same_bytes(self):
        dice = random.Random(SEED)
        out = self.root / "killed.mbtiles"
        killed = {"survey": 0, "tiles": 0, "done": 0}
        while sum(killed.values()) < KILLS or killed["tiles"] == 0:
            process = self.start(out, "--threads", str(dice.randint(1, 3)))
            time.sleep(dice.uniform(0, self.seconds))
            process.kill()
            process.wait(timeout=60)
            working = beside(out, ".qmpipe-tmp")
            if working.exists():
                self.assertFalse(out.exists(), "a file with the name must be whole")
                killed["tiles" if working.stat().st_size > 100_000 else "survey"] += 1
            else:
                # Before it was made, or after it took its name.
                killed["done" if out.exists() else "survey"] += 1
            if out.exists():
                self.assertEqual(sha256(out), self.expected)
                if not beside(out, ".qmpipe-run").exists():
                    out.unlink()
        self.finish(out)
        print("killed", killed, flush=True)

    def test_killed_while_it_ends_goes_on(self):
        out = self.root / "ending.mbtiles"
        dice = random.Random(SEED + 1)
        unfinished = 0
        for _ in range(6):
            process = self.start(out)
            # Written last before the file is closed and renamed.
            report = beside(out, ".report.json")
            while process.poll() is None and not report.exists():
                time.sleep(0.0002)
            time.sleep(dice.uniform(0, 0.02))
            process.kill()
            process.wait(timeout=60)
            if beside(out, ".qmpipe-run").exists():
                unfinished += 1
                self.finish(out)
            else:
                self.expect_finished(out)
                out.unlink()
                report.unlink()
        print("killed before it was all done", unfinished, "times", flush=True)

    def test_an_older_file_stays_until_the_new_one_is_whole(self):
        out = self.root / "older.mbtiles"
        out.write_bytes(b"an older file")
        done = self.build(out)
        self.assertEqual(done.returncode, 1)
        self.assertIn("--overwrite", done.stderr)
        process = self.start(out, "--overwrite")
        self.wait_for_tiles(process, out)
        process.kill()
        process.wait(timeout=60)
        self.assertEqual(out.read_bytes(), b"an older file")
        done = self.finish(out)
        self.assertIn("going on with the run", done.stderr)

    def test_stopped_it_goes_on_without_meshing_again(self):
        out = self.root / "stopped.mbtiles"
        process = self.start(out, "--threads", "1")
        self.wait_for_tiles(process, out)
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=60)[1]
        self.assertEqual(process.returncode, 130, said)
        self.assertIn("the checkpoint is kept", said)
        done = self.finish(out)
        self.assertRegex(done.stderr, r"going on: \d+ of \d+ tiles are done")

    def test_a_working_file_that_is_gone_is_built_again(self):
        out = self.root / "gone.mbtiles"
        self.stop_without_working_file(out)
        done = self.finish(out)
        self.assertIn("all tiles are meshed again", done.stderr)

    def test_no_tile_of_an_older_file_gets_into_the_new_one(self):
        out = self.root / "foreign.mbtiles"
        # The same tiles with other bytes.
        older = self.root / "gzip-2.mbtiles"
        self.assertEqual(self.build(older, "--gzip", "2").returncode, 0)
        self.stop_without_working_file(out)
        older.rename(out)
        before = out.read_bytes()
        # It might be what the run had finished before it was killed; but it is not.
        for _ in range(2):
            done = self.build(out)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("is another tile set", done.stderr)
            self.assertIn("--overwrite", done.stderr)
            self.assertEqual(out.read_bytes(), before)
        self.finish(out, "--overwrite")

    def test_a_second_run_is_refused_while_one_is_at_work(self):
        out = self.root / "twice.mbtiles"
        process = self.start(out, "--threads", "1")
        self.wait_for_tiles(process, out)
        # With a run folder of its own, so that only the file itself stands in the way.
        for extra in ([], ["--overwrite"], ["--overwrite", "--run-folder", self.root / "own-run"]):
            done = self.build(out, *extra)
            if process.poll() is not None:
                break
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("another run is at work with it", done.stderr)
        self.assertEqual(process.wait(timeout=60), 0, process.stderr.read())
        self.expect_finished(out)

    def test_full_disk_is_gone_on_with_when_there_is_room(self):
        disk = self.root / "disk"
        disk.mkdir()
        size_kb = 1024
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size_kb}k", "tmpfs", disk],
                                 capture_output=True, check=False)
        if mounted.returncode != 0:
            self.skipTest("cannot mount a small disk: " + mounted.stderr.decode().strip())
        self.addCleanup(subprocess.run, ["umount", disk], check=False)
        out = disk / "out.mbtiles"
        fills = 0
        done = self.build(out)
        while done.returncode != 0:
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("Free some space", done.stderr)
            self.assertFalse(out.exists())
            fills += 1
            self.assertLess(fills, 40)
            size_kb = size_kb * 5 // 4 + 64
            subprocess.run(["mount", "-o", f"remount,size={size_kb}k", disk], check=True)
            done = self.build(out)
        self.assertGreater(fills, 1)
        self.expect_finished(out)
        print("the disk was full", fills, "times", flush=True)


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    print("seed", SEED, flush=True)
    with tempfile.TemporaryDirectory(prefix="qmpipe-resume-") as place:
        MbtilesRuns.prepare(place)
        unittest.main(verbosity=2)
