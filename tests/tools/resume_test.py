#!/usr/bin/env python3
"""Nothing is lost: builds that are killed, stopped, starved of disk or tampered with either go on and
end with the bytes of an uninterrupted build, or say what is wrong.

usage: resume_test.py QMPIPE [unittest's arguments]
QMPIPE_RESUME_SEED repeats the random moments of an earlier run; QMPIPE_RESUME_KILLS sets how many.
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
import time
import unittest

QMPIPE = None
SEED = int(os.environ.get("QMPIPE_RESUME_SEED", random.SystemRandom().randrange(10**6)))
KILLS = int(os.environ.get("QMPIPE_RESUME_KILLS", 20))
# Keeps the deepest zooms' lattice on disk.
LITTLE_MEMORY = "300M"
# Coarse, so that reading and storing weigh as much as meshing does.
OPTIONS = {"--tolerance": "60000", "--gzip": "1", "--threads": "2", "--name": "t",
           "--checkpoint": "0.05"}


def contents(out):
    """Every file of a tile set but the report, which holds times."""
    return {str(path.relative_to(out)): path.read_bytes()
            for path in sorted(out.rglob("*")) if path.is_file() and path.name != "report.json"}


def run_folder(out):
    return out.with_name(out.name + ".qmpipe-run")


def journal_lines(out):
    path = run_folder(out) / "journal"
    return [json.loads(line[17:]) for line in path.read_text().splitlines()]


class ResumeTest(unittest.TestCase):
    @staticmethod
    def prepare(folder):
        cls = ResumeTest
        cls.root = pathlib.Path(folder)
        cls.dem = cls.root / "dem.tif"
        done = subprocess.run([QMPIPE, "synth", "-o", cls.dem, "--size", "4800x3600", "--bounds",
                               "6,44,9,46.25", "--seed", "3", "--voids", "0.02"],
                              capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        cls.reference = cls.root / "reference"
        done = cls.build(cls.reference, "--memory", LITTLE_MEMORY)
        assert done.returncode == 0, done.stderr
        assert "is kept in" in done.stderr, "the lattice must be on disk: " + done.stderr
        report = json.loads((cls.reference / "report.json").read_text())
        cls.survey_s = report["survey_s"]
        cls.mesh_s = report["mesh_s"]
        cls.expected = contents(cls.reference)
        # Two thirds of the way through the deepest zoom, which is built by rows.
        deepest = max(cls.reference.glob("*/"), key=lambda p: int(p.name) if p.name.isdigit() else -1)
        rows = sorted({int(p.stem) for p in deepest.glob("*/*.terrain")})
        row = rows[len(rows) * 2 // 3]
        tile = sorted(deepest.glob(f"*/{row}.terrain"))[0]
        cls.late_tile = tile.relative_to(cls.reference)

    @classmethod
    def command(cls, out, *extra, dem=None):
        options = [word for name, value in OPTIONS.items() if name not in extra
                   for word in (name, value)]
        return [QMPIPE, "build", str(dem or cls.dem), "-o", str(out), *options, *extra]

    @classmethod
    def build(cls, out, *extra, dem=None):
        return subprocess.run(cls.command(out, *extra, dem=dem), capture_output=True, text=True,
                              timeout=300, stdin=subprocess.DEVNULL, check=False)

    def start(self, out, *extra, dem=None):
        process = subprocess.Popen(self.command(out, *extra, dem=dem), stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.stderr.close)
        self.addCleanup(process.kill)
        return process

    @staticmethod
    def wait_for_tiles(process, out, seconds=60):
        """True once a tile of this run may be there; False when the run ended first."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline and process.poll() is None:
            if next(out.glob("[3-9]/*/*.terrain"), None):
                return True
            time.sleep(0.005)
        return False

    @staticmethod
    def was_done(out):
        """Killed when there was nothing left to do but to end."""
        if not (out / "layer.json").exists() or (run_folder(out) / "journal").exists():
            return False
        if run_folder(out).exists():
            run_folder(out).rmdir()
        return True

    def expect_same(self, out):
        found = contents(out)
        self.assertEqual(sorted(found), sorted(self.expected))
        differing = [name for name, data in found.items() if data != self.expected[name]]
        self.assertEqual(differing, [])
        self.assertFalse(run_folder(out).exists())

    def finish(self, out, *extra):
        done = self.build(out, *extra)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.expect_same(out)
        return done

    @classmethod
    def stop_a_run(cls):
        """A run that was stopped late in its mesh pass, once for all tests."""
        out = cls.root / "stopped"
        for _ in range(20):
            shutil.rmtree(out, ignore_errors=True)
            shutil.rmtree(run_folder(out), ignore_errors=True)
            process = subprocess.Popen(cls.command(out, "--memory", LITTLE_MEMORY),
                                       stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            while process.poll() is None and not (out / cls.late_tile).exists():
                time.sleep(0.005)
            process.send_signal(signal.SIGTERM)
            cls.stop_said = process.communicate(timeout=60)[1]
            if process.returncode == 130:
                cls.stopped = out
                return
        raise AssertionError("the run could never be stopped in time")

    def unfinished(self, name):
        """A copy of that run: output and run folder may stand anywhere, together."""
        if not hasattr(ResumeTest, "stopped"):
            ResumeTest.stop_a_run()
        out = self.root / name
        shutil.copytree(self.stopped, out)
        shutil.copytree(run_folder(self.stopped), run_folder(out))
        self.addCleanup(shutil.rmtree, out, ignore_errors=True)
        self.addCleanup(shutil.rmtree, run_folder(out), ignore_errors=True)
        return out

    def refused(self, out, *extra, says=()):
        before = contents(out)
        done = self.build(out, *extra)
        self.assertEqual(done.returncode, 1, done.stderr)
        for text in says:
            self.assertIn(text, done.stderr)
        self.assertIn("--overwrite", done.stderr)
        self.assertEqual(contents(out), before, "a refusal must not touch the tiles")
        return done


class KilledRuns(ResumeTest):
    def kill_once(self, out, dice, memory):
        """Starts or goes on with a build and kills it; returns where, or None when it was done."""
        process = self.start(out, "--memory", memory)
        where = "survey"
        if dice.random() < 0.5:
            time.sleep(dice.uniform(0, self.survey_s * 1.1))
        else:
            where = "mesh"
            if self.wait_for_tiles(process, out):
                time.sleep(dice.uniform(0, self.mesh_s * 0.9))
        if process.poll() is not None:
            self.assertEqual(process.returncode, 0, process.stderr.read())
            return None
        process.kill()
        process.wait(timeout=60)
        if self.was_done(out):
            return None
        if where == "survey" and next(out.glob("*/*/*.terrain"), None):
            where = "mesh"
        return where

    def test_killed_at_random_moments_ends_with_the_same_bytes(self):
        dice = random.Random(SEED)
        out = self.root / "killed"
        killed = {"survey": 0, "mesh": 0}
        went_on = 0
        while sum(killed.values()) < KILLS or not all(killed.values()):
            # A resumed run may have more or less memory than the one before.
            memory = dice.choice([LITTLE_MEMORY, LITTLE_MEMORY, "0"])
            where = self.kill_once(out, dice, memory)
            if where is None:
                self.expect_same(out)
                shutil.rmtree(out)
                continue
            killed[where] += 1
            if dice.random() < 0.3:
                done = self.finish(out, "--memory", LITTLE_MEMORY)
                went_on += "going on" in done.stderr
                shutil.rmtree(out)
        self.finish(out, "--memory", LITTLE_MEMORY)
        print("killed", killed, "went on and finished", went_on, flush=True)

    def test_full_disk_is_gone_on_with_when_there_is_room(self):
        disk = self.root / "disk"
        disk.mkdir()
        size_kb = 4096
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size_kb}k", "tmpfs", disk],
                                 capture_output=True, check=False)
        if mounted.returncode != 0:
            self.skipTest("cannot mount a small disk: " + mounted.stderr.decode().strip())
        self.addCleanup(subprocess.run, ["umount", disk], check=False)
        out = disk / "out"
        dice = random.Random(SEED + 1)
        fills = 0
        done = self.build(out, "--memory", LITTLE_MEMORY)
        while done.returncode != 0:
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("space", done.stderr)
            self.assertFalse((out / "layer.json").exists())
            fills += 1
            self.assertLess(fills, 200)
            size_kb = int(size_kb * dice.uniform(1.05, 1.4)) + 64
            subprocess.run(["mount", "-o", f"remount,size={size_kb}k", disk], check=True)
            done = self.build(out, "--memory", LITTLE_MEMORY)
        self.assertGreater(fills, 3)
        self.expect_same(out)
        print("the disk was full", fills, "times", flush=True)


    def test_killed_while_it_clears_up_goes_on(self):
        dice = random.Random(SEED + 2)
        in_clearing = 0
        for k in range(8):
            out = self.unfinished(f"clearing-{k}")
            process = self.start(out, "--memory", LITTLE_MEMORY)
            while process.poll() is None and not (out / "layer.json").exists():
                time.sleep(0.0005)
            time.sleep(dice.uniform(0, 0.01))
            process.kill()
            process.wait(timeout=60)
            if self.was_done(out):
                self.expect_same(out)
                continue
            in_clearing += 1
            self.finish(out, "--memory", LITTLE_MEMORY)
        print("killed while it cleared up", in_clearing, "times", flush=True)


class StoppedRuns(ResumeTest):
    def test_terminated_run_writes_a_checkpoint_and_goes_on(self):
        out = self.unfinished("terminated")
        self.assertRegex(self.stop_said, r"stopped after \d+ of \d+ tiles; the checkpoint is kept")
        counted = [line["tiles_done"] for line in journal_lines(out) if "tiles_done" in line][-1]
        self.assertEqual(counted, len(list(out.glob("*/*/*.terrain"))))
        done = self.finish(out)
        self.assertIn(f"going on: {counted} of", done.stderr)
        self.assertEqual(json.loads((out / "report.json").read_text())["resumed_tiles"], counted)

    def test_report_of_a_resumed_run_has_the_sums_of_an_uninterrupted_one(self):
        out = self.unfinished("sums")
        self.finish(out)
        reports = [json.loads((o / "report.json").read_text()) for o in (out, self.reference)]
        for report in reports:
            for zoom in report["zooms"]:
                zoom.pop("stage_s")
        self.assertEqual(reports[0]["zooms"], reports[1]["zooms"])

    def test_stopped_in_the_survey_goes_on(self):
        out = self.root / "in-survey"
        process = self.start(out, "--memory", LITTLE_MEMORY)
        while process.poll() is None and not list(run_folder(out).glob("lattice-*.h5")):
            time.sleep(0.005)
        process.send_signal(signal.SIGINT)
        process.wait(timeout=60)
        self.assertEqual(process.returncode, 130, process.stderr.read())
        done = self.finish(out, "--memory", LITTLE_MEMORY)
        self.assertIn("going on with the run", done.stderr)

    def test_another_parameter_is_refused_by_name(self):
        out = self.unfinished("other-parameter")
        self.refused(out, "--tolerance", "50000", says=['g_e (--tolerance) was "60000/2", and is "50000/2"'])
        self.refused(out, "--reduce", "max", says=["--reduce"])
        # What no tile depends on may change.
        self.finish(out, "--threads", "1", "--memory", LITTLE_MEMORY, "--checkpoint", "3")

    def test_another_input_is_refused_by_name(self):
        out = self.unfinished("other-input")
        status = self.dem.stat()
        os.utime(self.dem, (1, 1))
        try:
            self.refused(out, says=["dem.tif has changed"])
        finally:
            os.utime(self.dem, ns=(status.st_atime_ns, status.st_mtime_ns))

    def test_overwrite_starts_over(self):
        out = self.unfinished("over")
        done = self.finish(out, "--overwrite")
        self.assertNotIn("going on", done.stderr)

    def test_a_second_run_on_the_same_output_is_refused(self):
        out = self.root / "twice"
        process = self.start(out)
        self.assertTrue(self.wait_for_tiles(process, out))
        process.send_signal(signal.SIGSTOP)
        try:
            for extra in ([], ["--overwrite"]):
                done = self.build(out, *extra)
                self.assertEqual(done.returncode, 1, done.stderr)
                self.assertIn("another run is at work", done.stderr)
        finally:
            process.send_signal(signal.SIGCONT)
        process.wait(timeout=60)
        self.expect_same(out)

    def test_keep_run_leaves_stores_that_no_later_run_takes_for_its_own(self):
        out = self.root / "kept"
        done = self.build(out, "--keep-run", "--memory", LITTLE_MEMORY)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue(list(run_folder(out).glob("lattice-*.h5")))
        self.assertTrue(list(run_folder(out).glob("borders-*.h5")))
        done = self.build(out)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("built already", done.stdout)
        self.refused(out, "--gzip", "2", says=["--gzip was 1, and is 2 now"])
        self.finish(out, "--overwrite")

    def test_the_run_folder_may_stand_elsewhere(self):
        out = self.root / "elsewhere"
        folder = self.root / "scratch" / "run"
        process = self.start(out, "--run-folder", str(folder))
        self.assertTrue(self.wait_for_tiles(process, out))
        process.send_signal(signal.SIGINT)
        process.wait(timeout=60)
        self.assertEqual(process.returncode, 130)
        self.assertTrue((folder / "journal").exists())
        self.assertFalse(run_folder(out).exists())
        done = self.finish(out, "--run-folder", str(folder))
        self.assertRegex(done.stderr, r"going on with the run in .*run, .*\d+ tiles are done")
        self.assertFalse(folder.exists())

    def test_without_checkpoints_nothing_is_kept(self):
        out = self.root / "none"
        process = self.start(out, "--checkpoint", "0", "--memory", LITTLE_MEMORY)
        self.assertTrue(self.wait_for_tiles(process, out))
        process.send_signal(signal.SIGINT)
        process.wait(timeout=60)
        self.assertEqual(process.returncode, 130)
        self.assertIn("--overwrite", process.stderr.read())
        self.assertEqual([p.name for p in self.root.glob("none*")], ["none"])
        self.finish(out, "--checkpoint", "0", "--memory", LITTLE_MEMORY, "--overwrite")


class TamperedRuns(ResumeTest):
    def test_torn_journal_loses_only_its_last_line(self):
        out = self.unfinished("torn")
        journal = run_folder(out) / "journal"
        whole = journal.read_bytes()
        journal.write_bytes(whole[:-7])
        done = self.finish(out, "--memory", LITTLE_MEMORY)
        self.assertIn("going on", done.stderr)

    def test_damaged_journal_is_refused(self):
        out = self.unfinished("damaged-journal")
        journal = run_folder(out) / "journal"
        lines = journal.read_bytes().split(b"\n")
        self.assertIn(b"output_begun", lines[1])
        self.assertIn(b"surveyed_zoom", lines[2])
        lines[2] = lines[2].replace(b"zoom", b"ZOOM")
        journal.write_bytes(b"\n".join(lines))
        self.refused(out, says=["journal: line 3 is damaged"])

    def test_damaged_or_missing_segments_are_refused(self):
        out = self.unfinished("segments")
        segments = sorted(run_folder(out).glob("*.h5"))
        self.assertTrue(any(s.name.startswith("lattice") for s in segments))
        self.assertTrue(any(s.name.startswith("borders") for s in segments))
        for segment in [s for s in segments if s.name in (segments[0].name, segments[-1].name)]:
            with self.subTest(segment=segment.name):
                whole = segment.read_bytes()
                segment.write_bytes(whole[:-10])
                self.refused(out, "--memory", LITTLE_MEMORY, says=[segment.name])
                segment.unlink()
                self.refused(out, "--memory", LITTLE_MEMORY, says=["segment"])
                segment.write_bytes(whole)
        self.finish(out, "--memory", LITTLE_MEMORY)

    def test_damaged_heights_end_the_run_and_not_in_silence(self):
        out = self.unfinished("heights")
        segment = sorted(run_folder(out).glob("lattice-*.h5"))[0]
        whole = segment.read_bytes()
        middle = len(whole) // 2
        segment.write_bytes(whole[:middle] + bytes(b ^ 255 for b in whole[middle:middle + 200000]) +
                            whole[middle + 200000:])
        done = self.build(out, "--memory", LITTLE_MEMORY)
        if done.returncode == 0:
            # Its blocks were not needed any more.
            self.expect_same(out)
            return
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn(segment.name, done.stderr)
        segment.write_bytes(whole)
        self.finish(out, "--memory", LITTLE_MEMORY)

    def test_damaged_survey_is_refused(self):
        out = self.unfinished("survey")
        survey = sorted(run_folder(out).glob("survey-*.qms"))[-1]
        whole = survey.read_bytes()
        for damaged in (whole[:-1], whole[:100], whole[:60] + b"\xff" + whole[61:]):
            survey.write_bytes(damaged)
            self.refused(out, "--memory", LITTLE_MEMORY, says=[survey.name])
        survey.write_bytes(whole)
        self.finish(out, "--memory", LITTLE_MEMORY)

    def test_tiles_that_are_gone_are_built_again(self):
        out = self.unfinished("gone")
        sorted(out.glob("*/*/*.terrain"))[0].unlink()
        done = self.finish(out, "--memory", LITTLE_MEMORY)
        self.assertIn("is gone", done.stderr)
        out = self.unfinished("all-gone")
        shutil.rmtree(out)
        self.finish(out, "--memory", LITTLE_MEMORY)

    def test_output_removed_while_running_is_noticed(self):
        out = self.root / "removed"
        process = self.start(out, "--memory", LITTLE_MEMORY)
        self.assertTrue(self.wait_for_tiles(process, out))
        out.rename(self.root / "moved-away")
        process.wait(timeout=60)
        said = process.stderr.read()
        self.assertEqual(process.returncode, 1, said)
        self.assertIn("removed", said)
        self.assertFalse((out / "layer.json").exists())
        self.finish(out, "--memory", LITTLE_MEMORY)

    def test_changed_clocks_do_not_matter(self):
        out = self.unfinished("clocks")
        for k, path in enumerate(sorted(run_folder(out).rglob("*")) + sorted(out.rglob("*"))):
            os.utime(path, (0, 0) if k % 2 else (4102444800, 4102444800))
        done = self.finish(out, "--memory", LITTLE_MEMORY)
        self.assertIn("going on", done.stderr)

    def test_a_source_that_fails_in_the_middle_is_named(self):
        cut = self.root / "cut.tif"
        cut.write_bytes(self.dem.read_bytes()[:self.dem.stat().st_size * 2 // 3])
        out = self.root / "from-cut"
        done = self.build(out, "--memory", LITTLE_MEMORY, dem=cut)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("cut.tif", done.stderr)
        self.assertFalse((out / "layer.json").exists())


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    print("seed", SEED, flush=True)
    with tempfile.TemporaryDirectory(prefix="qmpipe-resume-") as place:
        ResumeTest.prepare(place)
        unittest.main(verbosity=2)
