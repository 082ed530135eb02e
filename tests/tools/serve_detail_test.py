#!/usr/bin/env python3
"""`qmpipe serve` of a detail-increment model through real sockets.

  serve_detail_test.py QMPIPE
"""

import gzip
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

from running_server import Server

QMPIPE = ""


class ServeDetailTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.root = pathlib.Path(tempfile.mkdtemp(prefix="qmpipe-serve-detail-"))
        cls.addClassCleanup(shutil.rmtree, cls.root)
        run = lambda *a: subprocess.run([QMPIPE, *map(str, a)], check=True, capture_output=True)
        dem = cls.root / "dem.tif"
        run("synth", "-o", dem, "--size", "160x120", "--bounds", "6,43,7,43.8", "--seed", "5")
        # A model is known by what is in it.
        cls.model = cls.root / "terrain.data"
        run("detail", "build", dem, "-o", cls.model)
        info = subprocess.run([QMPIPE, "detail", "info", cls.model, "--json"], check=True,
                              capture_output=True)
        cls.info = json.loads(info.stdout)
        cls.server = Server(QMPIPE, cls.model)
        cls.addClassCleanup(cls.server.process.kill)

    @classmethod
    def tearDownClass(cls):
        code, errors = cls.server.end()
        assert (code, errors) == (0, ""), (code, errors)

    def test_it_says_where_the_page_and_the_model_are(self):
        said = self.server.said
        self.assertEqual(said["model"], said["viewer"] + "model.json")
        self.assertEqual(said["blocks"], 4)
        self.assertEqual(said["finest_triangles"], self.info["finest_triangles"])
        self.assertEqual(said["coarsest_triangles"], self.info["coarsest_triangles"])

    def test_model_json_says_what_the_model_holds(self):
        answer = self.server.get("/model.json", Accept_Encoding="identity")
        self.assertEqual(answer.headers["Content-Type"], "application/json")
        model = json.loads(answer.body)
        self.assertEqual(model["name"], "terrain")
        for key in ("crs", "interval", "offset", "step_m"):
            self.assertEqual(model[key], self.info[key], key)
        self.assertEqual(model["seams"], self.info["seam_triangles"])
        self.assertEqual(len(model["blocks"]), len(self.info["blocks"]))
        for block, info in zip(model["blocks"], self.info["blocks"]):
            self.assertEqual((block["points"], block["levels"], block["coarse_triangles"]),
                             (info["points"], info["levels"], info["coarsest_triangles"]))
            self.assertEqual(block["coarse_points"] + block["levels"], block["points"])
            low, high = block["box"]
            self.assertTrue(all(a < b for a, b in zip(low, high)), block)

    def test_parts_are_packed_for_those_who_take_it_and_plain_for_others(self):
        model = json.loads(self.server.get("/model.json", Accept_Encoding="identity").body)
        sizes = {f"/block/{b}.bin": 4 * (3 * block["points"] + 3 * block["coarse_triangles"]
                                        + 3 * block["levels"] + 1)
                 for b, block in enumerate(model["blocks"])}
        sizes["/seams.bin"] = 4 * 6 * model["seams"]
        for path, size in sizes.items():
            packed = self.server.get(path, Accept_Encoding="br, gzip;q=0.5")
            plain = self.server.get(path, Accept_Encoding="gzip;q=0")
            for answer in (packed, plain):
                self.assertEqual(answer.status, 200, path)
                self.assertEqual(answer.headers["Content-Type"], "application/octet-stream")
                self.assertEqual(answer.headers["Access-Control-Allow-Origin"], "*")
                self.assertEqual(answer.headers["Vary"], "Accept-Encoding")
            self.assertEqual(packed.headers["Content-Encoding"], "gzip")
            self.assertNotIn("Content-Encoding", plain.headers)
            self.assertEqual(len(plain.body), size, path)
            self.assertEqual(gzip.decompress(packed.body), plain.body, path)
            self.assertNotEqual(packed.headers["ETag"], plain.headers["ETag"])
        for b, block in enumerate(model["blocks"]):
            self.assertEqual(len(self.server.get(f"/block/{b}.bin", Accept_Encoding="gzip").body),
                             block["bytes"])

    def test_who_has_a_part_is_not_sent_it_again(self):
        for path in ("/model.json", "/block/0.bin", "/seams.bin"):
            for coding in ("gzip", "identity"):
                first = self.server.get(path, Accept_Encoding=coding)
                self.assertEqual(first.headers["Cache-Control"], "no-cache", path)
                again = self.server.get(path, Accept_Encoding=coding,
                                        If_None_Match=first.headers["ETag"])
                self.assertEqual((again.status, again.body), (304, b""), path)
                other = self.server.get(path, Accept_Encoding=coding, If_None_Match='"other"')
                self.assertEqual((other.status, other.body), (200, first.body), path)

    def test_the_same_model_is_served_as_the_same_bytes(self):
        server = Server(QMPIPE, self.model)
        try:
            for path in ("/model.json", "/block/3.bin", "/seams.bin"):
                mine, its = (s.get(path, Accept_Encoding="gzip") for s in (self.server, server))
                self.assertEqual((mine.body, mine.headers["ETag"]), (its.body, its.headers["ETag"]))
        finally:
            self.assertEqual(server.end(), (0, ""))

    def test_the_start_page_is_the_models(self):
        start = self.server.get("/", Accept_Encoding="identity")
        page = self.server.get("/detail.html", Accept_Encoding="identity")
        self.assertEqual(start.body, page.body)
        self.assertIn(b"detail.js", start.body)
        for path in ("/detail.js", "/detail_scene.js", "/detail_walk.js", "/detail_decoder.js",
                     "/three/three.module.js", "/three/three.core.js", "/three/OrbitControls.js"):
            answer = self.server.get(path)
            self.assertEqual(answer.status, 200, path)
            self.assertTrue(answer.headers["Content-Type"].startswith("text/javascript"), path)

    def test_absent_things_are_404_in_json(self):
        for path in ("/block/4.bin", "/block/-1.bin", "/block/00.bin", "/block/0", "/block/.bin",
                     "/block/", "/block", "/block/0.bin/", "/block/+1.bin", "/block/1e0.bin",
                     "/block/99999999999999999999.bin", "/block/0x1.bin", "/block/0.bin%00",
                     "/block/../model.json", "/seams", "/layer.json", "/0/0/0.terrain",
                     "/terrain.data", "/three/package.json", "/three/", "/node_modules/three/LICENSE",
                     "/package.json"):
            answer = self.server.get(path)
            self.assertEqual(answer.status, 404, path)
            self.assertIn("error", json.loads(answer.body), path)

    def test_a_damaged_model_is_not_served(self):
        whole = self.model.read_bytes()
        damaged = self.root / "damaged.h5"
        flipped = bytearray(whole)
        flipped[len(whole) // 2] ^= 1
        for data in (whole[:-1], whole[:len(whole) // 2], bytes(flipped), whole[:8]):
            damaged.write_bytes(data)
            done = subprocess.run([QMPIPE, "serve", damaged, "--port", "0"], capture_output=True,
                                  text=True, timeout=60, check=False)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("damaged.h5", done.stderr)
            self.assertIn("qmpipe detail build", done.stderr)


if __name__ == "__main__":
    QMPIPE = sys.argv.pop(1)
    unittest.main(verbosity=2)
