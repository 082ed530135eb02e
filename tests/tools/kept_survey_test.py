#!/usr/bin/env python3
"""A survey that lives in memory is kept when its run is stopped: the next run goes on from it and ends
with the bytes of an uninterrupted one, wherever the stop, and whatever else goes wrong then.

usage: kept_survey_test.py QMPIPE [unittest's arguments]
QMPIPE_RESUME_SEED repeats the random moments of an earlier run.
"""
import json
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

from resume_test import contents, run_folder

QMPIPE = None
SEED = int(os.environ.get("QMPIPE_RESUME_SEED", random.SystemRandom().randrange(10**6)))
# So that every survey took longer, and every mesh pass can be stopped in its middle.
KEPT_AFTER = ["--checkpoint", "0.01"]
OPTIONS = ["--tolerance", "60000", "--gzip", "1", "--threads", "2",
           "--name", "t"]


class KeptSurvey(unittest.TestCase):
    @staticmethod
    def prepare(folder):
        cls = KeptSurvey
        cls.root = pathlib.Path(folder)
        cls.dem = cls.root / "dem.tif"
        # Around a pole, whose row gets one height after all its blocks.
        done = subprocess.run([QMPIPE, "synth", "-o", cls.dem, "--size", "6000x800", "--bounds",
                               "-180,80,-60,90", "--seed", "5", "--voids", "0.02"],
                              capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        cls.reference = cls.root / "reference"
        done = cls.build(cls.reference)
        assert done.returncode == 0, done.stderr
        assert "is kept in" not in done.stderr, "the lattice must be in memory: " + done.stderr
        report = cls.report(cls.reference)
        cls.survey_s = report["survey_s"]
        cls.expected = contents(cls.reference)

    @staticmethod
    def report(out):
        return json.loads((out / "report.json").read_text())

    @classmethod
    def command(cls, out, *extra):
        after = [] if "--checkpoint" in extra else KEPT_AFTER
        return [QMPIPE, "build", str(cls.dem), "-o", str(out), *OPTIONS, *after, *map(str, extra)]

    @classmethod
    def build(cls, out, *extra):
        return subprocess.run(cls.command(out, *extra), capture_output=True, text=True, timeout=300,
                              stdin=subprocess.DEVNULL, check=False)

    def start(self, out, *extra):
        process = subprocess.Popen(self.command(out, *extra), stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.stderr.close)
        self.addCleanup(process.kill)
        return process

    def stop(self, out, *extra, in_mesh):
        """Starts a build and stops it; what it said, or None where it was done before."""
        process = self.start(out, *extra)
        if in_mesh:
            while process.poll() is None and not next(out.glob("*/*/*.terrain"), None):
                time.sleep(0.002)
        else:
            time.sleep(self.dice.uniform(0.3, 0.9) * self.survey_s)
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=120)[1]
        # Done before, or stopped before it was listening.
        if process.returncode in (0, -signal.SIGINT):
            shutil.rmtree(out, ignore_errors=True)
            return None
        self.assertEqual(process.returncode, 130, said)
        return said

    def stopped(self, out, *extra, in_mesh):
        for _ in range(30):
            said = self.stop(out, *extra, in_mesh=in_mesh)
            # A run that was stopped while it opened its input had nothing to keep.
            if said is not None and ("stopped after" if in_mesh else "keeping the survey") in said and (
                    in_mesh or "stopped after" not in said):
                return said
            shutil.rmtree(out, ignore_errors=True)
            shutil.rmtree(run_folder(out), ignore_errors=True)
        self.fail("the run could never be stopped in time")

    def finish(self, out, *extra):
        done = self.build(out, *extra)
        self.assertEqual(done.returncode, 0, done.stderr)
        found = contents(out)
        self.assertEqual(sorted(found), sorted(self.expected))
        self.assertEqual([k for k, data in found.items() if data != self.expected[k]], [])
        self.assertFalse(run_folder(out).exists())
        return done

    def setUp(self):
        self.dice = random.Random(SEED)
        self.out = self.root / self.id().rsplit(".", 1)[-1]
        self.addCleanup(shutil.rmtree, self.out, ignore_errors=True)
        self.addCleanup(shutil.rmtree, run_folder(self.out), ignore_errors=True)

    def test_stopped_while_it_meshes_it_need_not_be_made_again(self):
        said = self.stopped(self.out, in_mesh=True)
        self.assertIn("keeping the survey", said)
        self.assertIn("the checkpoint is kept", said)
        done = self.finish(self.out)
        self.assertIn("the survey is done", done.stderr)
        self.assertEqual(self.report(self.out)["source"]["decoded_blocks"], 0)

    def test_stopped_in_its_middle_it_goes_on_there(self):
        for _ in range(10):
            self.stopped(self.out, in_mesh=False)
            self.assertTrue(list(run_folder(self.out).glob("lattice-*.h5")))
            done = self.finish(self.out, "--json")
            self.assertIn("going on with the run", done.stderr)
            events = [json.loads(line) for line in done.stderr.splitlines()]
            survey, = [e for e in events
                       if (e["event"], e.get("phase")) == ("phase_done", "survey")]
            self.assertEqual(survey["done"], survey["total"])
            if survey["done_before"] > 256 * 256:
                return
            # It had hardly begun.
            shutil.rmtree(self.out)
        self.fail("each time it was stopped at its start")

    def test_stopped_again_and_again_it_ends_with_the_same_bytes(self):
        stops = 0
        for _ in range(9):
            said = self.stop(self.out, in_mesh=self.dice.random() < 0.4)
            if said is None:
                continue
            stops += 1
            if self.dice.random() < 0.3:
                self.finish(self.out)
                shutil.rmtree(self.out)
        self.finish(self.out)
        self.assertGreater(stops, 2)
        print("stopped", stops, "times", flush=True)

    def test_a_short_one_is_not_kept(self):
        said = self.stopped(self.out, "--checkpoint", "1000", in_mesh=True)
        self.assertNotIn("keeping", said)
        self.assertEqual(list(run_folder(self.out).glob("lattice-*.h5")), [])
        self.finish(self.out)

    def test_killed_while_it_is_kept_the_run_goes_on_all_the_same(self):
        for _ in range(3):
            process = self.start(self.out)
            while process.poll() is None and not next(self.out.glob("*/*/*.terrain"), None):
                time.sleep(0.002)
            timer = threading.Timer(60, process.kill)
            timer.start()
            process.send_signal(signal.SIGINT)
            for line in process.stderr:
                if "keeping the survey" in line:
                    time.sleep(self.dice.uniform(0, 0.1))
                    # Who asks a second time wants to wait no longer.
                    process.send_signal(signal.SIGINT)
            process.wait(timeout=60)
            timer.cancel()
            self.assertIn(process.returncode, (0, 130, -signal.SIGINT))
            if process.returncode == 0:
                shutil.rmtree(self.out)
                continue
            self.finish(self.out)
            shutil.rmtree(self.out)

    def test_a_full_disk_is_told_and_the_rest_is_kept(self):
        disk = self.root / "disk"
        disk.mkdir()
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk],
                                 capture_output=True, check=False)
        if mounted.returncode != 0:
            self.skipTest("cannot mount a small disk: " + mounted.stderr.decode().strip())
        self.addCleanup(subprocess.run, ["umount", disk], check=False)
        where = ["--run-folder", disk / "run"]
        said = self.stopped(self.out, *where, in_mesh=False)
        self.assertIn("the survey is not kept", said)
        self.assertIn("space", said)
        subprocess.run(["mount", "-o", "remount,size=64m", disk], check=True)
        self.finish(self.out, *where)


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    print("seed", SEED, flush=True)
    with tempfile.TemporaryDirectory(prefix="qmpipe-kept-") as place:
        KeptSurvey.prepare(place)
        unittest.main(verbosity=2)
