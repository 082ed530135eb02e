#!/usr/bin/env python3
"""The Debian package: its dependencies are named, it goes in and out without a trace, and what is in it does
the main job with nothing of the source at hand.

It is installed by dpkg into a root of its own: an overlay of this machine's, whose packages are the
dependencies, without the project's folder. Where none can be mounted (not root, a container), the test skips.

usage: package_test.py QMPIPE [unittest's arguments]
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

QMPIPE = None
ROOT = pathlib.Path(__file__).resolve().parents[2]

# In a mount namespace of its own, so that all mounts end with it. $1: a folder.
A_ROOT = r"""
set -eu
mount -t tmpfs tmpfs "$1"
mkdir "$1/upper" "$1/work" "$1/root"
mount -t overlay overlay -o "lowerdir=/,upperdir=$1/upper,workdir=$1/work" "$1/root"
"""
# $2: the project's folder, $3: what to do, $4: the package.
IN_A_ROOT = A_ROOT + r"""
mount --rbind /proc "$1/root/proc"
mount --rbind /dev "$1/root/dev"
mount -t tmpfs tmpfs "$1/root/tmp"
cp "$4" "$1/root/tmp/qmpipe.deb"
if [ -e "$1/root$2" ]; then mount -t tmpfs tmpfs "$1/root$2"; fi
exec chroot "$1/root" /bin/bash -euc "cd /tmp; $3"
"""
MAIN_JOB = r"""
dpkg -i qmpipe.deb >/dev/null
command -v qmpipe
qmpipe synth -o dem.tif --size 300x200 --bounds 6,43.5,6.5,44 --seed 3
qmpipe build dem.tif -o tiles
qmpipe verify tiles --source dem.tif
qmpipe serve tiles --port 0 >said 2>&1 &
server=$!
for i in $(seq 100); do address=$(grep -om1 'http://127.0.0.1:[0-9]*/' said || true); [ -n "$address" ] && break; sleep 0.1; done
python3 - "$address" <<'PYTHON'
import sys, urllib.request
for path, word in (("", b"<html"), ("layer.json", b"quantized-mesh")):
    assert word in urllib.request.urlopen(sys.argv[1] + path, timeout=10).read(), path
PYTHON
kill $server
wait $server || true
dpkg -L qmpipe
dpkg -r qmpipe >/dev/null
test ! -e /usr/bin/qmpipe -a ! -e /usr/share/qmpipe
"""


def output_of(*command, **options):
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False,
                          stdin=subprocess.DEVNULL, **options)
    if done.returncode != 0:
        raise AssertionError(f"{command[:4]}: exit {done.returncode}\n{done.stdout}\n{done.stderr}")
    return done.stdout


def build_folder():
    """Of the program: where its CPackConfig.cmake is."""
    return next(folder for folder in QMPIPE.parents if (folder / "CPackConfig.cmake").exists())


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        output_of("cmake", "--build", build_folder(), "--target", "qmpipe", "manual")
        output_of("cpack", "--config", build_folder() / "CPackConfig.cmake", "-B", cls.folder.name)
        cls.package, = pathlib.Path(cls.folder.name).glob("qmpipe_*.deb")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def field(self, name):
        return output_of("dpkg-deb", "--field", self.package, name)

    def test_names_what_the_program_is_linked_to(self):
        depends = self.field("Depends")
        for library in ("libc6", "libgdal32", "libtbb12", "libhdf5", "libzstd1", "libsqlite3-0", "libcurl", "proj-data"):
            self.assertIn(library, depends)
        self.assertIn("pyramids", self.field("Description"))
        version = output_of(QMPIPE, "--version").split()[-1]
        self.assertEqual(self.field("Version").strip(), version)

    def test_holds_the_program_its_manual_pages_and_licence(self):
        names = {line.split()[-1].removeprefix("./") for line in
                 output_of("dpkg-deb", "--contents", self.package).splitlines()}
        for name in ("usr/bin/qmpipe", "usr/share/man/man1/qmpipe.1", "usr/share/man/man1/qmpipe-build.1",
                     "usr/share/bash-completion/completions/qmpipe", "usr/share/doc/qmpipe/LICENSE",
                     "usr/share/doc/qmpipe/docs/GUIDE.md", "usr/share/qmpipe/viewer/index.html",
                     "usr/share/qmpipe/viewer/cesium/Cesium.js", "usr/share/qmpipe/viewer/three/three.module.js"):
            self.assertIn(name, names)
        self.assertFalse([name for name in names if not name.startswith("usr/") and name not in ("", "./", "usr")])

    def test_does_the_main_job_in_a_root_without_the_source(self):
        with tempfile.TemporaryDirectory() as folder:
            trial = subprocess.run(["unshare", "--mount", "bash", "-c", A_ROOT, "", folder], capture_output=True, check=False)
            if trial.returncode != 0:
                self.skipTest("an overlay cannot be mounted here")
            said = output_of("unshare", "--mount", "bash", "-c", IN_A_ROOT, "package_test", folder, str(ROOT), MAIN_JOB,
                             str(self.package))
        self.assertTrue(said.startswith("/usr/bin/qmpipe\n"), said)
        self.assertIn("/usr/share/man/man1/qmpipe-build.1", said)


if __name__ == "__main__":
    QMPIPE = pathlib.Path(sys.argv.pop(1)).resolve()
    unittest.main()
