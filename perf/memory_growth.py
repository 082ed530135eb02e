#!/usr/bin/env python3
"""Shows that the memory of `qmpipe build` is bounded, whatever the DEM's size.

Builds made-up DEMs of several sizes with the same --memory and compares each run's peak with what
it had announced (expected_peak_bytes) and with the limit. The exit code is 1 when a run exceeds
either.
"""

import argparse
import json
import pathlib
import shutil
import subprocess
import sys

import results

EXAMPLE = """example, in a minute instead of an hour:
  perf/memory_growth.py --sizes 2000x2000,8000x8000 --memory 512M"""
UNITS = {"K": 2**10, "M": 2**20, "G": 2**30}


def bytes_of(text):
    if text[-1:] not in UNITS or not text[:-1].isdigit():
        results.fail(f"--memory {text} is not a size; write for example 512M or 1G")
    return int(text[:-1]) * UNITS[text[-1]]


def build(arguments, size):
    """report.json of one build."""
    dem = results.synth_dem(arguments.qmpipe, arguments.work, size)
    out = arguments.work / f"growth-{size[0]}x{size[1]}"
    command = [arguments.qmpipe, "build", dem, "-o", out, "--overwrite", "--threads",
               str(arguments.threads), "--memory", arguments.memory]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        results.fail(f"the build of {dem} ended with {done.returncode}:\n{done.stderr}")
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    shutil.rmtree(out)
    if arguments.remove_dems:
        dem.unlink()
    return report


def main():
    parser = argparse.ArgumentParser(description=__doc__, epilog=EXAMPLE,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="4000x4000,32000x32000", metavar="COLUMNSxROWS,...",
                        help="of the DEMs, in pixels (default: %(default)s)")
    parser.add_argument("--memory", default="1G", metavar="SIZE", help="default: %(default)s")
    parser.add_argument("--threads", type=int, default=2, metavar="N", help="default: %(default)s")
    parser.add_argument("--quick", action="store_true", help="a smoke test on tiny DEMs")
    parser.add_argument("--remove-dems", action="store_true",
                        help="do not keep the DEMs for the next time")
    parser.add_argument("--qmpipe", type=pathlib.Path, metavar="PROGRAM",
                        default=results.ROOT / "build/release/tools/qmpipe")
    parser.add_argument("--work", type=pathlib.Path, default=results.WORK, metavar="FOLDER",
                        help="for the DEMs and the tiles (default: %(default)s)")
    arguments = parser.parse_args()
    if arguments.quick:
        arguments.sizes, arguments.memory = "300x300,1200x1200", "512M"
    results.need_program(arguments.qmpipe)
    limit_bytes = bytes_of(arguments.memory)
    print(f"{'DEM':>12} {'tiles':>8} {'peak MiB':>9} {'announced':>9} {'limit':>6} {'seconds':>8}")
    is_exceeded = False
    for text in arguments.sizes.split(","):
        report = build(arguments, results.size_of(text))
        peak_bytes = report["peak_resident_bytes"]
        announced_bytes = report["expected_peak_bytes"]
        exceeds = peak_bytes > min(announced_bytes, limit_bytes)
        is_exceeded |= exceeds
        print(f"{text:>12} {report['tiles']:>8} {peak_bytes / 2**20:>9.0f} "
              f"{announced_bytes / 2**20:>9.0f} {limit_bytes / 2**20:>6.0f} "
              f"{report['survey_s'] + report['mesh_s']:>8.1f}{'  EXCEEDED' if exceeds else ''}",
              flush=True)
    sys.exit(1 if is_exceeded else 0)


if __name__ == "__main__":
    main()
