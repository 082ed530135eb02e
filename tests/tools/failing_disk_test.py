#!/usr/bin/env python3
"""A build whose n-th write, sync, rename, open, close, mkdir or truncate fails says so, and goes on with
the same command to the bytes of an undisturbed one: as a folder and as MBTiles. Locks that a file system
does not have are replaced.

usage: failing_disk_test.py QMPIPE CC [unittest's arguments]
QMPIPE_FAULT_STEP=1 tries every n of each call; without it a few of each, at random.
QMPIPE_FAULT_SEED repeats the choice of an earlier run.
"""
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import unittest

QMPIPE = None
SHIM = None
SOURCE = pathlib.Path(__file__).with_name("failing_disk.c")
SEED = int(os.environ.get("QMPIPE_FAULT_SEED", random.SystemRandom().randrange(10**6)))
STEP = int(os.environ.get("QMPIPE_FAULT_STEP", 0))
FORMS = ("out", "out.mbtiles")


class FailingDisk(unittest.TestCase):
    @staticmethod
    def prepare(folder):
        cls = FailingDisk
        cls.root = pathlib.Path(folder)
        cls.dem = cls.root / "dem.tif"
        subprocess.run([QMPIPE, "synth", "-o", cls.dem, "--size", "300x225", "--bounds",
                        "6,44,8,45.5", "--seed", "3"], check=True, stdout=subprocess.DEVNULL)
        cls.expected = {}
        cls.counts = {}
        for form in FORMS:
            place = cls.root / "reference"
            done = cls.build(place / form, FAILING_DISK_LOG=cls.root / "counts")
            assert done.returncode == 0, done.stderr
            cls.expected[form] = contents(place)
            words = (line.split() for line in (cls.root / "counts").read_text().splitlines())
            cls.counts[form] = {name: int(count) for name, count in words}
            shutil.rmtree(place)

    @classmethod
    def build(cls, out, *extra, **variables):
        out.parent.mkdir(exist_ok=True)
        environment = dict(os.environ, LD_PRELOAD=str(SHIM), FAILING_DISK_ROOT=str(out.parent),
                           **{name: str(value) for name, value in variables.items()})
        # No checkpoint before the last tile, unless a test wants them.
        return subprocess.run([QMPIPE, "build", cls.dem, "-o", out, "--threads", "1", "--gzip", "1",
                               "--name", "t", "--tolerance", "60000", "--checkpoint", "1000",
                               *extra], env=environment, capture_output=True, text=True, timeout=120,
                              stdin=subprocess.DEVNULL, check=False)


def contents(place):
    """All but the reports, which hold times."""
    return {str(path.relative_to(place)): path.read_bytes() for path in sorted(place.rglob("*"))
            if path.is_file() and not path.name.endswith("report.json")}


class Faults(FailingDisk):
    def numbers(self, form, call, dice):
        count = self.counts[form][call]
        if STEP:
            return range(1, count + 1, STEP)
        return sorted({n for n in (dice.randint(1, max(1, count)), count) if n >= 1})

    def fail_once(self, form, call, number, stays):
        place = self.root / "place"
        out = place / form
        what = f"{form}: {call} {number} fails{' and all after it' if stays else ''}"
        done = self.build(out, FAILING_DISK_CALL=call, FAILING_DISK_AT=number,
                          FAILING_DISK_STAYS=int(stays))
        if done.returncode != 0:
            self.assertEqual(done.returncode, 1, what + ": " + done.stderr)
            self.assertIn("qmpipe: cannot", done.stderr, what)
            again = self.build(out)
            self.assertEqual(again.returncode, 0, what + ": " + done.stderr + again.stderr)
        self.assertEqual(contents(place), self.expected[form], what)
        shutil.rmtree(place)
        return done.returncode

    def test_any_call_may_fail(self):
        for form in FORMS:
            dice = random.Random(f"{SEED} {form}")
            failed = tried = 0
            for call in self.counts[form]:
                for number in self.numbers(form, call, dice):
                    stays = dice.random() < 0.5
                    failed += self.fail_once(form, call, number, stays)
                    tried += 1
            print(f"{form}: {failed} of {tried} faults stopped a run", flush=True)
            self.assertGreater(failed, tried // 3, self.counts[form])


class MissingLocks(FailingDisk):
    """As a Lustre client mounted without -o flock."""

    def build_without_locks(self, out, *extra):
        return self.build(out, *extra, FAILING_DISK_LOCKS="none")

    def test_a_build_needs_no_locks_of_the_file_system(self):
        for form in FORMS:
            place = self.root / "lockless"
            done = self.build_without_locks(place / form)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(contents(place), self.expected[form])
            # What was built can be read there too.
            done = subprocess.run([QMPIPE, "verify", place / form], capture_output=True, text=True,
                                  env=dict(os.environ, LD_PRELOAD=str(SHIM), FAILING_DISK_LOCKS="none"),
                                  check=False)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            shutil.rmtree(place)

    def test_two_runs_still_keep_apart_and_a_lock_left_behind_is_explained(self):
        for form, locked in (("out", "out.qmpipe-run/journal"),
                             ("out.mbtiles", "out.mbtiles.qmpipe-tmp")):
            place = self.root / "lockless"
            lock = place / (locked + ".lock")
            lock.parent.mkdir(parents=True)
            lock.write_text("node7 4711")
            for extra in ((), ("--overwrite",)):
                done = self.build_without_locks(place / form, *extra)
                self.assertEqual(done.returncode, 1, done.stderr)
                for text in ("another run is at work", "process 4711 on node7", f"remove {lock} and run"):
                    self.assertIn(text, done.stderr)
                self.assertEqual(lock.read_text(), "node7 4711")
            lock.unlink()
            done = self.build_without_locks(place / form)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(contents(place), self.expected[form])
            shutil.rmtree(place)


if __name__ == "__main__":
    QMPIPE, compiler = sys.argv.pop(1), sys.argv.pop(1)
    print("seed", SEED, flush=True)
    with tempfile.TemporaryDirectory(prefix="qmpipe-failing-disk-") as temporary:
        SHIM = pathlib.Path(temporary) / "failing_disk.so"
        subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o", SHIM, SOURCE,
                        "-ldl"], check=True)
        FailingDisk.prepare(pathlib.Path(temporary))
        unittest.main(verbosity=2)
