#!/usr/bin/env python3
"""`qmpipe check` against real servers, each with one fault: it names that one, and no other.

usage: check_server_test.py QMPIPE
"""
import gzip
import json
import pathlib
import struct
import sys
import tempfile
import unittest

import served_set
from served_set import (MEDIA_TYPE, check, codes, is_tile, serving, with_layer, with_metadata,
                        with_tiles)

QMPIPE = None
FILES = {}
LEAF = "4/16/11.terrain"


# Changes to answers.

def headers(choose=is_tile, **changes):
    """Sets headers (None removes one) of the files that `choose` takes."""
    def change(answer, _):
        if answer.status == 200 and choose(answer.path):
            for name, value in changes.items():
                answer.headers.pop(name.replace("_", "-"), None)
                if value is not None:
                    answer.headers[name.replace("_", "-")] = value
        return answer
    return change


def body(choose, make):
    def change(answer, _):
        if answer.status == 200 and choose(answer.path):
            answer.body = make(answer.body)
        return answer
    return change


def is_layer(path):
    return path == "layer.json"


def is_leaf(path):
    return path == LEAF


def every(path):
    return is_layer(path) or is_tile(path)


def status(choose, number, command="GET"):
    def change(answer, handler):
        if handler.command == command and choose(answer.path):
            answer.status = number
        return answer
    return change


def start_page(choose):
    """What single-page applications do: 200 and their page for whatever is not there."""
    def change(answer, _):
        if choose(answer):
            answer.status = 200
            answer.headers = {"Content-Type": "text/html", "Access-Control-Allow-Origin": "*"}
            answer.body = b"\n<!DOCTYPE html><html><body>Welcome</body></html>"
        return answer
    return change


def cut(choose):
    def change(answer, _):
        if answer.status == 200 and choose(answer.path):
            answer.headers["Content-Length"] = str(len(answer.body))
            answer.body = answer.body[:len(answer.body) // 2]
        return answer
    return change


def redirect_tiles(answer, handler):
    if is_tile(answer.path) and not handler.path.endswith("&moved"):
        answer.status = 302
        answer.headers["Location"] = handler.path + "&moved"
        answer.body = b""
    return answer


# Changes to files.

def without(*paths):
    return {path: data for path, data in FILES.items() if path not in paths}


def flipped(path):
    zoom, x, name = path.split("/")
    y = int(name.partition(".")[0])
    return f"{zoom}/{x}/{2 ** int(zoom) - 1 - y}.terrain"


def rows_from_north():
    return {flipped(path) if is_tile(path) else path: data for path, data in FILES.items()}


def with_ranges(zoom, ranges):
    available = json.loads(FILES["layer.json"])["available"]
    keys = ("startX", "startY", "endX", "endY")
    available[zoom] = [dict(zip(keys, r)) for r in ranges]
    return with_layer(FILES, available=available)


def leaf_changed(change):
    return with_tiles(FILES, lambda path, tile: change(tile) if path == LEAF else tile)


def patched(at, form, *values):
    def change(tile):
        changed = bytearray(tile)
        struct.pack_into(form, changed, at, *values)
        return bytes(changed)
    return change


def without_extensions(tile):
    return tile[:served_set.start_of_extensions(tile)]


def south_for_north(tile):
    z_m, = struct.unpack_from("<d", tile, 48)
    return patched(48, "<d", -z_m)(tile)


# (name, faults, warnings, hints, change of the answers, the files)
def cases():
    def same(answer, _):
        return answer

    def files(name, make, faults=(), warnings=(), hints=()):
        return name, faults, warnings, hints, same, make()

    def answers(name, change, faults=(), warnings=(), hints=()):
        return name, faults, warnings, hints, change, FILES

    plain = {path: gzip.decompress(data) if is_tile(path) else data for path, data in FILES.items()}
    tiles_url = "{z}/{x}/{y}.terrain"
    return [
        answers("sound", same),
        ("sound, plain", (), (), (), headers(Content_Encoding=None), plain),
        answers("gzip by the x-name", headers(Content_Encoding="x-gzip")),
        answers("layer.json gzipped and announced",
                lambda a, h: headers(is_layer, Content_Encoding="gzip")(
                    body(is_layer, gzip.compress)(a, h), h)),
        files("sound, by metadata", lambda: with_metadata(FILES, 2)),
        files("sound, rows from the north and told so",
              lambda: with_layer(rows_from_north(), scheme="slippyMap"), (), ["scheme-not-tms"]),
        files("several templates",
              lambda: with_layer(FILES, tiles=[tiles_url, "/" + tiles_url, "./" + tiles_url])),
        # The server.
        answers("no CORS at all", headers(every, Access_Control_Allow_Origin=None), (),
                ["no-cors"]),
        answers("no CORS at tiles", headers(Access_Control_Allow_Origin=None), (), ["no-cors"]),
        answers("CORS for somebody else",
                headers(every, Access_Control_Allow_Origin="https://example.org"), (),
                ["cors-other-origin"]),
        answers("CORS twice", headers(every, Access_Control_Allow_Origin=["*", "*"]),
                ["cors-twice"]),
        # How answers are sent.
        answers("gzip without a header", headers(Content_Encoding=None), ["gzip-not-announced"]),
        answers("layer.json gzipped without a header", body(is_layer, gzip.compress),
                ["gzip-not-announced"]),
        ("a header without gzip", ["gzip-announced-but-plain"], (), (), same, plain),
        answers("gzip twice", body(is_tile, gzip.compress), ["gzip-twice"]),
        answers("gzip twice and announced twice",
                lambda a, h: headers(Content_Encoding=["gzip", "gzip"])(
                    body(is_tile, gzip.compress)(a, h), h), (), ["gzip-twice-announced"]),
        answers("damaged gzip", body(is_leaf, lambda b: b[:100] + b"\0\0\0\0" + b[104:]),
                ["gzip-damaged"]),
        answers("brotli that nobody asked for", headers(Content_Encoding="br"),
                ["foreign-encoding"]),
        answers("a tile cut off", cut(is_leaf), ["cut-off"]),
        answers("layer.json cut off", cut(is_layer), ["cut-off"]),
        # layer.json.
        answers("no layer.json", status(is_layer, 404), ["layer-json-missing"]),
        answers("layer.json forbidden", status(is_layer, 403), ["layer-json-status"]),
        answers("a page for layer.json", start_page(lambda a: is_layer(a.path)),
                ["layer-json-is-html"]),
        answers("no JSON", body(is_layer, lambda b: b[:200]), ["layer-json-unreadable"]),
        files("another projection", lambda: with_layer(FILES, projection="EPSG:2056"),
              ["layer-json-unreadable"]),
        files("misspelt key", lambda: with_layer(FILES, scheme=None, schema="tms"), (),
              ["misspelt-key"]),
        files("misspelt format key", lambda: with_layer(FILES, format=None,
                                                        fromat="quantized-mesh-1.0"),
              ["format"], ["misspelt-key"]),
        files("another format", lambda: with_layer(FILES, format="heightmap-1.0"), ["format"]),
        files("no tiles", lambda: with_layer(FILES, tiles=[]), ["no-tile-urls"]),
        files("another scheme", lambda: with_layer(FILES, scheme="xyz"), ["scheme"]),
        files("a template without y", lambda: with_layer(FILES, tiles=["{z}/{x}.terrain"]),
              ["tile-url"]),
        files("a template of another scheme", lambda: with_layer(FILES, tiles=["s3://b/" + tiles_url]),
              ["tile-url"]),
        files("an unknown placeholder", lambda: with_layer(FILES, tiles=[tiles_url + "?k={key}"]),
              ["tile-url"]),
        files("no version", lambda: with_layer(FILES, version=None), (), ["no-version"]),
        files("no availability", lambda: with_layer(FILES, available=None), ["no-availability"]),
        files("nothing available", lambda: with_layer(FILES, available=[[], []]),
              ["available-empty"]),
        files("one root", lambda: with_ranges(0, [(1, 0, 1, 0)]), ["available-roots"]),
        files("a reversed range", lambda: with_ranges(4, [(16, 11, 17, 12), (9, 9, 8, 8)]),
              ["available-range"]),
        files("beyond the scheme", lambda: with_ranges(4, [(16, 11, 17, 12), (32, 0, 32, 0)]),
              ["available-range"]),
        files("a hole", lambda: with_ranges(3, [(8, 5, 8, 5)]), ["available-hole"]),
        files("maxzoom too low", lambda: with_layer(FILES, maxzoom=3), ["maxzoom-too-low"]),
        files("no maxzoom", lambda: with_layer(FILES, maxzoom=None), (), ["no-maxzoom"]),
        files("an unknown extension",
              lambda: with_layer(FILES, extensions=["octvertexnormals", "normals"]), (),
              ["unknown-extension"]),
        files("a parent", lambda: with_layer(FILES, parentUrl="../world"), (), (),
              ["parent-not-checked"]),
        files("both kinds of availability",
              lambda: with_layer(with_metadata(FILES, 2), available=[]), (), (),
              ["available-ignored"]),
        files("no levels of metadata", lambda: with_layer(FILES, metadataAvailability=0,
                                                          available=None), ["metadata-levels"]),
        # Tiles.
        files("a root missing", lambda: without("0/0/0.terrain"), ["root-missing"]),
        files("a tile missing", lambda: without(LEAF), ["tile-missing"]),
        answers("a tile forbidden", status(is_leaf, 403), ["tile-missing"]),
        answers("an empty tile", lambda a, h: headers(is_leaf, Content_Encoding=None)(
            body(is_leaf, lambda _: b"")(a, h), h), ["tile-empty"]),
        ("a page for missing tiles", ["html-instead-of-tile"], (), ["soft-404"],
         start_page(lambda a: a.status == 404), without(LEAF)),
        answers("a page for unlisted tiles", start_page(lambda a: a.status == 404), (), (),
                ["soft-404"]),
        files("a truncated tile", lambda: leaf_changed(lambda tile: tile[:-7]),
              ["tile-unreadable"]),
        files("65,536 vertices", lambda: leaf_changed(patched(88, "<I", 65536)),
              ["vertex-count-65536"]),
        files("metadata uncalled for",
              lambda: leaf_changed(lambda tile: tile + served_set.metadata([])),
              ["metadata-unexpected"]),
        files("metadata missing", lambda: with_tiles(with_metadata(
            with_layer(FILES, extensions=None), 2), lambda p, t: without_extensions(t)),
              ["metadata-absent"]),
        files("metadata that is none", lambda: with_tiles(
            with_layer(FILES, available=None, metadataAvailability=1),
            lambda p, t: t + served_set.extension(4, struct.pack("<I", 3) + b"[1,")),
              ["metadata-unreadable"]),
        files("normals not listed", lambda: with_layer(FILES, extensions=None),
              ["normals-not-listed"]),
        files("normals absent", lambda: leaf_changed(without_extensions), ["normals-absent"]),
        files("water not listed",
              lambda: leaf_changed(lambda tile: tile + served_set.extension(2, b"\xff")),
              ["watermask-not-listed"]),
        files("water absent",
              lambda: with_layer(FILES, extensions=["octvertexnormals", "watermask"]), (),
              ["watermask-absent"]),
        files("a sphere elsewhere", lambda: leaf_changed(patched(32, "<3d", 0, -6.4e6, 0)),
              ["tile-misplaced"]),
        files("a neighbour's tile", lambda: {**FILES, LEAF: FILES["4/17/12.terrain"]},
              ["tile-misplaced"]),
        files("rows from the north", rows_from_north, ["rows-flipped"]),
        files("rows from the south, told otherwise", lambda: with_layer(FILES, scheme="slippyMap"),
              ["rows-flipped"], ["scheme-not-tms"]),
        files("a sphere in the mirrored row", lambda: leaf_changed(south_for_north),
              ["rows-flipped"]),
        # Costs.
        answers("another media type", headers(Content_Type="text/plain"), (), ["media-type"]),
        answers("a generic media type", headers(Content_Type="application/octet-stream"), (), (),
                ["media-type-generic"]),
        answers("no media type", headers(Content_Type=None), (), (), ["media-type-generic"]),
        answers("a media type with parameters",
                headers(Content_Type=MEDIA_TYPE + ";extensions=octvertexnormals")),
        answers("no caching", headers(Cache_Control=None), (), (), ["no-caching"]),
        answers("no HEAD", status(every, 405, "HEAD"), (), (), ["head-refused"]),
        answers("redirections", redirect_tiles, (), (), ["tile-redirect"]),
        files("an unlisted tile", lambda: {**FILES, "5/32/22.terrain": FILES[LEAF]}, (), (),
              ["unlisted-tile"]),
    ]


class OneFault(unittest.TestCase):
    def test_each_fault_is_named_and_no_other(self):
        for name, faults, warnings, hints, change, files in cases():
            with self.subTest(name), serving(files, change) as address:
                done, report = check(QMPIPE, address)
                self.assertEqual(codes(report, "fault"), sorted(faults), done.stdout)
                self.assertEqual(codes(report, "warning"), sorted(warnings), done.stdout)
                self.assertEqual(codes(report, "hint"), sorted(hints), done.stdout)
                self.assertEqual(done.returncode, 3 if faults else 0)
                self.assertEqual(done.stderr, "")

    def test_all_tiles_of_a_small_set_are_asked_for_and_sound(self):
        for files in (FILES, with_metadata(FILES, 2), with_metadata(FILES, 1)):
            with serving(files) as address:
                _, report = check(QMPIPE, address)
                self.assertEqual((report["tiles_asked"], report["tiles_sound"]), (11, 11))
                self.assertEqual(report["deepest_zoom"], 4)

    def test_as_many_tiles_as_wanted(self):
        with serving(FILES) as address:
            _, report = check(QMPIPE, address, "--tiles", 3)
            self.assertEqual(report["tiles_asked"], 3)

    def test_equal_findings_are_told_once_with_a_count(self):
        with serving(FILES, headers(Content_Encoding=None)) as address:
            _, report = check(QMPIPE, address)
            fault, = report["findings"]
            self.assertEqual(fault["answers"], 11)
            self.assertEqual(report["tiles_sound"], 0)
            self.assertIn("Invalid typed array length", fault["viewers"])
            self.assertIn("Content-Encoding: gzip", fault["remedy"])

    def test_text_for_people_ends_in_a_sum(self):
        with serving(FILES) as address:
            done = served_set.run(QMPIPE, "check", address + "layer.json")
            self.assertEqual(done.returncode, 0)
            self.assertEqual(done.stdout, f"check: {address}layer.json: 11 of 11 tiles without a "
                             "fault, down to zoom 4, 0 faults, 0 warnings, 0 hints\n")

    def test_words_of_a_server_do_not_steer_the_terminal(self):
        files = with_layer(FILES, format="\x1b[2J\x07")
        with serving(files) as address:
            done = served_set.run(QMPIPE, "check", address)
            self.assertIn(r"\u001b[2J\u0007", done.stdout)
            self.assertNotIn("\x1b", done.stdout)

    def test_a_page_that_is_named_makes_cors_a_fault(self):
        change = headers(every, Access_Control_Allow_Origin="http://page.example")
        with serving(FILES, change) as address:
            self.assertEqual(check(QMPIPE, address, "--origin", "http://page.example")[0].returncode, 0)
            done, report = check(QMPIPE, address, "--origin", "http://other.example")
            self.assertEqual((done.returncode, codes(report, "fault")), (3, ["cors-other-origin"]))

    def test_a_page_of_the_same_host_needs_no_cors(self):
        with serving(FILES, headers(every, Access_Control_Allow_Origin=None)) as address:
            done, report = check(QMPIPE, address, "--origin", address)
            self.assertEqual((done.returncode, report["findings"]), (0, []))

    def test_what_a_browser_would_send(self):
        seen = {}

        def note(answer, handler):
            seen[answer.path] = dict(handler.headers)
            return answer

        with serving(FILES, note) as address:
            check(QMPIPE, address + "?token=7", "--origin", "https://page.example")
        self.assertEqual(seen[LEAF]["Origin"], "https://page.example")
        self.assertEqual(seen[LEAF]["Accept"], MEDIA_TYPE + ";extensions=octvertexnormals,"
                         "application/octet-stream;q=0.9,*/*;q=0.01")
        self.assertEqual(seen["layer.json"]["Accept-Encoding"], "gzip")

    def test_the_address_may_carry_a_token(self):
        paths = []

        def guard(answer, handler):
            paths.append(handler.path)
            if "token=7" not in handler.path:
                answer.status = 403
            return answer

        with serving(FILES, guard) as address:
            self.assertEqual(check(QMPIPE, address + "?token=7")[0].returncode, 0)
        self.assertTrue(any("?v=" in path and "&token=7" in path for path in paths), paths)

    def test_usage(self):
        for arguments, word in ((["ftp://host/"], "http://"), (["nohost"], "http://"),
                                (["http:///x"], "host"), (["http://h/ x"], "blanks"),
                                (["http://h/", "--tiles", "0"], "--tiles"),
                                (["http://h/", "--timeout", "0"], "--timeout"),
                                (["http://h/", "--origin", "page"], "--origin")):
            done = served_set.run(QMPIPE, "check", *arguments)
            self.assertEqual(done.returncode, 2, arguments)
            self.assertIn(word, done.stderr)


def main():
    global QMPIPE
    if len(sys.argv) < 2:
        print(__doc__, file=sys.stderr)
        return 2
    QMPIPE = sys.argv.pop(1)
    with tempfile.TemporaryDirectory(prefix="qmpipe-check-") as folder:
        tiles = pathlib.Path(folder) / "tiles"
        served_set.build_set(QMPIPE, tiles)
        FILES.update(served_set.read_set(tiles))
        unittest.main()


if __name__ == "__main__":
    sys.exit(main())
