#!/usr/bin/env python3
"""`qmpipe detail` as a user types it.

  detail_cli_test.py QMPIPE
"""

import json
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import unittest

QMPIPE = ""
DATA = pathlib.Path(os.environ.get("QMPIPE_DATA",
                                   pathlib.Path(__file__).resolve().parents[3] / "shared" / "data"))


def run(*arguments, code=0):
    done = subprocess.run([QMPIPE, *map(str, arguments)], capture_output=True, text=True, check=False,
                          timeout=600)
    if done.returncode != code:
        raise AssertionError(f"{arguments}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done


def ply_counts(path):
    header = path.read_bytes()[:600].decode("latin-1").split("end_header")[0]
    counts = {line.split()[1]: int(line.split()[2]) for line in header.splitlines()
              if line.startswith("element")}
    return counts["vertex"], counts["face"]


class Detail(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.root = pathlib.Path(tempfile.mkdtemp(prefix="qmpipe-detail-"))
        cls.addClassCleanup(shutil.rmtree, cls.root)
        cls.dem = cls.root / "dem.tif"
        run("synth", "-o", cls.dem, "--size", "200x150", "--bounds", "6,44,6.2,44.15", "--seed", "4")
        cls.model = cls.root / "terrain.h5"
        cls.built = json.loads(run("detail", "build", cls.dem, "-o", cls.model, "--json").stdout)

    def extract(self, *arguments, code=0, name="mesh.ply"):
        return run("detail", "extract", self.model, "-o", self.root / name, *arguments, code=code)

    def triangles(self, *arguments):
        said = json.loads(self.extract(*arguments, "--json").stdout)
        self.assertEqual(ply_counts(self.root / "mesh.ply"), (said["vertices"], said["triangles"]))
        return said["triangles"]

    def test_builds_what_it_says_and_verifies_clean(self):
        self.assertEqual(self.built["points"], 200 * 150)
        self.assertEqual(self.built["finest_triangles"], 2 * 199 * 149)
        self.assertEqual(self.built["coarsest_triangles"],
                         self.built["finest_triangles"] - 2 * self.built["levels"])
        self.assertIn("no faults", run("detail", "verify", self.model).stdout)
        info = json.loads(run("detail", "info", self.model, "--json").stdout)
        self.assertEqual(len(info["blocks"]), 4)
        self.assertEqual(info["finest_triangles"], self.built["finest_triangles"])
        self.assertIn("WGS", info["crs"])

    def test_same_bytes_on_any_number_of_threads(self):
        for threads in ("1", "3"):
            time.sleep(1.1)  # a file may not show when it was made
            again = self.root / f"again-{threads}.h5"
            run("detail", "build", self.dem, "-o", again, "--threads", threads)
            self.assertEqual(again.read_bytes(), self.model.read_bytes())

    def test_ten_scales_have_ever_fewer_triangles(self):
        counts = [self.triangles("--svo", str(0.5 * 1.7 ** k)) for k in range(10)]
        self.assertEqual(counts, sorted(counts, reverse=True))
        self.assertEqual(counts[0], self.built["finest_triangles"])
        self.assertEqual(self.triangles("--svo", "1e9"), self.built["coarsest_triangles"])
        self.assertGreater(len(set(counts)), 4)

    def test_triangles_levels_distances_and_eyes_choose_levels(self):
        self.assertLessEqual(self.triangles("--triangles", "30000"), 30000)
        self.assertGreater(self.triangles("--triangles", "30000"), 25000)
        self.assertEqual(self.triangles("--level", "0"), self.built["coarsest_triangles"])
        self.assertEqual(self.triangles("--level", "10"), self.built["coarsest_triangles"] + 80)
        far = self.triangles("--distance", "100000")
        near = self.triangles("--distance", "1000")
        self.assertGreater(near, far)
        self.assertGreater(self.triangles("--distance", "100000", "--pixels", "0.02"), far)
        said = json.loads(self.extract("--eye", "0,0,3000", "--json").stdout)["blocks"]
        self.assertLess(said[0]["distance_m"], said[3]["distance_m"])

    def test_meshes_in_other_forms_and_frames(self):
        for name in ("mesh.obj", "mesh.glb", "mesh.stl"):
            self.extract("--level", "5", name=name)
        stl = (self.root / "mesh.stl").read_bytes()
        self.assertEqual(struct.unpack_from("<I", stl, 80)[0],
                         self.built["coarsest_triangles"] + 40)
        self.extract("--level", "5", "--frame", "crs")
        self.extract("--level", "5", "--frame", "crs", name="mesh.glb", code=2)

    def test_merged_increments_change_fewer_triangles(self):
        sums = []
        for interval in ("1", "5000"):
            model = self.root / f"interval-{interval}.h5"
            run("detail", "build", self.dem, "-o", model, "--interval", interval)
            sums.append(json.loads(run("detail", "info", model, "--increments",
                                       "--json").stdout)["increments"])
        single, merged = sums
        self.assertEqual(single["changed_merged"], single["changed_singly"])
        self.assertEqual(single["raw_bytes_merged"], single["raw_bytes_singly"])
        self.assertEqual(merged["changed_singly"], single["changed_singly"])
        self.assertLess(merged["changed_merged"], 0.8 * merged["changed_singly"])
        self.assertIn("merged over 5000 levels",
                      run("detail", "info", self.root / "interval-5000.h5", "--increments").stdout)

    def test_chart_is_a_page_of_its_own(self):
        page = self.root / "chart.html"
        run("detail", "info", self.model, "--chart", page)
        text = page.read_text()
        self.assertEqual(text.count("<svg"), 3)
        self.assertNotIn("http", text.replace("http://www.w3.org/2000/svg", ""))

    def test_points_become_a_model(self):
        cloud = self.root / "cloud.csv"
        lines = [f"{500000 + 3.5 * i:.2f};{4000000 + 4.25 * j:.2f};{(i * j) % 17 / 4}"
                 for j in range(40) for i in range(50)]
        cloud.write_text("x;y;z\n" + "\n".join(lines + lines[:3]) + "\n")
        model = self.root / "cloud.h5"
        said = json.loads(run("detail", "build", cloud, "-o", model, "--json", "--blocks", "6",
                              "--keep", "10%").stdout)
        self.assertEqual((said["points"], said["left_out"], said["blocks"]), (2000, 3, 6))
        self.assertIn("no faults", run("detail", "verify", model).stdout)
        thinned = json.loads(run("detail", "build", cloud, "-o", model, "--json", "--thin",
                                 "20").stdout)
        self.assertLess(thinned["points"], 150)

    def test_a_real_survey(self):
        las = DATA / "autzen_trim_7.las"
        if not las.exists():
            self.skipTest(f"no {las}: set QMPIPE_DATA")
        model = self.root / "autzen.h5"
        said = json.loads(run("detail", "build", las, "-o", model, "--json").stdout)
        self.assertEqual(said["points"], 109993)
        self.assertIn("no faults", run("detail", "verify", model).stdout)
        done = run("detail", "build", DATA / "autzen_trim.laz", "-o", model, code=1)
        self.assertIn("laszip -i", done.stderr)

    def test_damaged_and_foreign_files_are_refused_with_words(self):
        damaged = self.root / "damaged.h5"
        whole = self.model.read_bytes()
        for bytes_left in (whole[:-1], whole[:5000], b"", whole[:2000] + b"\xff" * 8 + whole[2008:]):
            damaged.write_bytes(bytes_left)
            for command in (("info",), ("verify",), ("extract", "--level", "0", "-o", "x.ply")):
                done = run("detail", command[0], damaged, *command[1:], code=1)
                self.assertIn("damaged.h5", done.stderr)
        run("detail", "info", self.dem, code=1)
        run("detail", "info", self.root / "nowhere.h5", code=1)

    def test_nonsense_is_a_usage_error_that_names_the_option(self):
        build = ("detail", "build", self.dem, "-o", self.root / "x.h5")
        for option, value in (("--keep", "0"), ("--keep", "120%"), ("--keep", "much"),
                              ("--blocks", "0"), ("--interval", "0"), ("--height-step", "-1"),
                              ("--class", "lava"), ("--thin", "-2"), ("--threads", "0")):
            done = run(*build, option, value, code=2)
            self.assertIn(option, done.stderr + done.stdout, (option, value))
        self.extract(code=2)
        self.extract("--svo", "1", "--level", "2", code=2)
        self.extract("--eye", "1,2", code=2)
        run("detail", "build", self.dem, "-o", self.root / "no" / "folder.h5", code=1)
        run("detail", code=2)
        for command in ("build", "extract", "info", "verify"):
            self.assertIn("Example", run("detail", command, "--help").stdout)


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    unittest.main(verbosity=2)
