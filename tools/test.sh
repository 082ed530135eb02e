#!/usr/bin/env bash
# Sets up, builds and tests qmpipe, from a fresh clone on a bare Debian 12.
#   tools/test.sh        what a change needs: the preset `dev` and its tests
#   tools/test.sh --ci   also: format, the program as users get it, address/undefined and thread sanitizers, fuzzing,
#                        clang-tidy
# Every phase runs, whatever failed before it. The last line is "N passed, N failed[, N skipped]":
# the tests of all phases, where a check without tests of its own (format, clang-tidy, a fuzz
# target) counts as one, and a build counts only when it fails.
#   QMPIPE_JOBS=N        compilers at a time, 2 unless said otherwise
set -euo pipefail
cd "$(dirname "$0")/.."

mode=${1:-}
if [ $# -gt 1 ] || { [ -n "$mode" ] && [ "$mode" != --ci ]; }; then
  echo "usage: tools/test.sh [--ci]" >&2
  exit 2
fi

jobs=${QMPIPE_JOBS:-2}
fuzz_seconds=20
# How far the static analyzer follows the paths of a function: a tenth of what it would by itself, in a
# third of the time.
analyzer_nodes=20000
folders=()
for folder in scheduler formats stages pipeline tools tests perf; do
  # git keeps no empty folders, so one may be missing.
  if [ -d "$folder" ]; then folders+=("$folder"); fi
done
passed=0
failed=0
skipped=0
failures=()

fail() {
  failed=$((failed + 1))
  failures+=("$1")
}

# phase NAME COMMAND...: runs it under a heading and says how long it took; never ends the script.
phase() {
  local name=$1 start=$SECONDS result=ok
  shift
  printf '\n== %s\n' "$name"
  "$@" </dev/null || result=FAILED
  if [ $result = FAILED ]; then fail "$name"; fi
  printf -- '-- %s: %s, %d s\n' "$name" "$result" $((SECONDS - start))
}

# check NAME COMMAND...: a phase that is itself one test.
check() {
  local before=$failed
  phase "$@"
  if [ "$failed" -eq "$before" ]; then passed=$((passed + 1)); fi
}

# configure_and_build BUILD_PRESET CONFIGURE_PRESET [OPTION...]
configure_and_build() {
  local log=build/$1-configure.log
  mkdir -p build
  # The listing of the configure step matters only when it fails.
  cmake --preset "${@:2}" >"$log" 2>&1 || { cat "$log"; return 1; }
  cmake --build --preset "$1" -j "$jobs" -- -k 0 >"build/$1-build.log" 2>&1 ||
    { grep -vE '^\[[0-9]+/[0-9]+\] (Building|Linking) ' "build/$1-build.log"; return 1; }
}

# ctest_phase PRESET: adds the preset's tests to the sums.
ctest_phase() {
  local preset=$1 start=$SECONDS report=$PWD/build/$1-tests.xml status=0 counts
  printf '\n== %s: tests\n' "$preset"
  rm -f "$report"
  ctest --preset "$preset" --output-junit "$report" </dev/null || status=$?
  counts=$(python3 - "$report" <<'PYTHON'
import sys
import xml.etree.ElementTree as tree
try:
    cases = list(tree.parse(sys.argv[1]).getroot().iter("testcase"))
except (OSError, tree.ParseError):
    cases = []
run = sum(case.get("status") == "run" for case in cases)
# A test whose program is missing is "notrun" as well, but has no reason to be skipped.
skipped = sum(case.get("status") == "disabled" or case.find("skipped") is not None for case in cases)
print(run, len(cases) - run - skipped, skipped)
PYTHON
  )
  local run bad left_out
  read -r run bad left_out <<<"$counts"
  # ctest also fails when there is no test at all.
  if [ $status -ne 0 ] && [ "$bad" -eq 0 ]; then bad=1; fi
  passed=$((passed + run))
  failed=$((failed + bad))
  skipped=$((skipped + left_out))
  if [ "$bad" -gt 0 ]; then failures+=("$preset: $bad of its tests"); fi
  printf -- '-- %s: tests: %d passed, %d failed, %d skipped, %d s\n' \
    "$preset" "$run" "$bad" "$left_out" $((SECONDS - start))
}

# build_and_test BUILD_PRESET CONFIGURE_PRESET
build_and_test() {
  phase "$1: build" configure_and_build "$@"
  ctest_phase "$1"
}

format_check() {
  local file bad=0
  while read -r file; do
    clang-format-14 --dry-run -Werror "$file" 2>/dev/null && continue
    echo "$file"
    bad=$((bad + 1))
  done < <(find "${folders[@]}" -name node_modules -prune -o \( -name '*.h' -o -name '*.cpp' \) -print)
  if [ $bad -gt 0 ]; then
    echo "$bad files are not laid out as .clang-format says; clang-format-14 -i FILE mends one"
    return 1
  fi
}

# tidy_file FILE: quiet when there is nothing to say.
tidy_file() {
  local said
  said=$(clang-tidy-14 --quiet --warnings-as-errors='*' --extra-arg=-Xclang \
    --extra-arg=-analyzer-config --extra-arg=-Xclang --extra-arg="max-nodes=$analyzer_nodes" \
    --extra-arg=-Wno-ignored-optimization-argument \
    -p build/alone "$1" 2>&1) && return 0
  printf '%s\n' "$said" | grep -vE '^[0-9]+ warnings? (generated|treated)|^Suppressed |^Use -'
  return 1
}

# compile_file COMMAND: what a file includes is enough for it alone, which a build of many files as one cannot tell.
compile_file() {
  bash -c "$1 -fsyntax-only -w"
}

# The program's own files; the tests would double the time. clang-tidy reads those that were changed in the four hours
# before the newest commit, and of the others, which were clean when they last were, a third, each time another one
# (QMPIPE_TIDY_ALL=1: all); the compiler reads the rest. Behind all else, so that it takes the cores that tests leave
# idle which run alone.
tidy() {
  local status=0
  export analyzer_nodes
  export -f tidy_file compile_file
  cmake --preset dev -B build/alone -DQMPIPE_UNITY=OFF >build/alone-configure.log 2>&1 ||
    { cat build/alone-configure.log; return 1; }
  python3 - <<'PYTHON' >build/tidy-files.log || return 1
import json, os, re, subprocess, zlib
layers = ["scheduler", "formats", "stages", "pipeline", "tools"]
commands = {os.path.relpath(entry["file"]): entry["command"]
            for entry in json.load(open("build/alone/compile_commands.json"))}
files = {f for f in commands if f.split(os.sep)[0] in layers}
others = set(files)
git = lambda *words: subprocess.run(["git", *words], capture_output=True, text=True)
newest = git("log", "-1", "--format=%ct")
count = git("rev-list", "--count", "HEAD")
if newest.returncode == 0 and count.returncode == 0 and "QMPIPE_TIDY_ALL" not in os.environ:
    before = git("rev-list", "-1", f"--before=@{int(newest.stdout) - 4 * 3600}", "HEAD").stdout.strip()
    empty_tree = git("hash-object", "-t", "tree", "/dev/null").stdout.strip()
    # Where a file moved, its includes and references change with it and nothing else. Fields: lines added, removed, and the
    # path, or an empty one and then the old and the new one.
    words = git("diff", "-M", "--numstat", "-z", r"-I^\s*(#\s*include|//)", before or empty_tree).stdout.split("\0")
    changed = set()
    while len(words) > 1:
        added, removed, path = words.pop(0).split("\t")
        if not path:
            path = words.pop(1)
            words.pop(0)
        if (added, removed) != ("0", "0"):
            changed.add(os.path.splitext(path)[0])
    turn = int(count.stdout) % 3
    files = {f for f in files if os.path.splitext(f)[0] in changed or zlib.crc32(f.encode()) % 3 == turn}
print("\n".join(sorted(files)))
with open("build/compiled-files.log", "w") as rest:
    for f in sorted(others - files):
        rest.write(re.sub(r" -o \S+", "", commands[f]) + "\n")
PYTHON
  # shellcheck disable=SC2016  # the inner shell expands it
  nice -n 19 xargs -a build/tidy-files.log -P "$jobs" -n 1 bash -c 'tidy_file "$1"' _ || status=1
  # shellcheck disable=SC2016
  nice -n 19 xargs -a build/compiled-files.log -d '\n' -P "$jobs" -n 1 bash -c 'compile_file "$1"' _ || status=1
  echo "clang-tidy: $(wc -l <build/tidy-files.log) files; the compiler: $(wc -l <build/compiled-files.log) more, each alone"
  return $status
}

start_tidy() {
  tidy >build/tidy.log 2>&1 </dev/null &
  tidy_process=$!
  trap 'pkill -P "$tidy_process" 2>/dev/null || true; kill "$tidy_process" 2>/dev/null || true' EXIT
}

finish_tidy() {
  local status=0
  wait "$tidy_process" || status=1
  trap - EXIT
  cat build/tidy.log
  return $status
}

# fuzz_target PROGRAM: of the preset `asan`; new inputs stay in the build folder; a crash leaves its input there too.
fuzz_target() {
  local name=${1##*/fuzz_}
  local work=build/asan/fuzz/$name
  mkdir -p "$work"
  "$1" -max_total_time=$fuzz_seconds -timeout=10 -rss_limit_mb=2048 -print_final_stats=1 \
    -artifact_prefix="$work/" "$work" "tests/fuzz/corpus/$name" >"$work.log" 2>&1 || touch "$work.failed"
}

fuzz_result() {
  local work=build/asan/fuzz/$1
  if [ -e "$work.failed" ]; then
    tail -n 60 "$work.log"
    return 1
  fi
  grep 'number_of_executed_units' "$work.log"
}

fuzz() {
  local target targets=()
  for target in build/asan/tests/fuzz/fuzz_*; do
    if [ -x "$target" ] && ! [ -d "$target" ]; then targets+=("$target"); fi
  done
  if [ ${#targets[@]} = 0 ]; then
    fail 'fuzz: there is no target'
    return
  fi
  rm -f build/asan/fuzz/*.failed
  export fuzz_seconds
  export -f fuzz_target
  # shellcheck disable=SC2016  # the inner shell expands it
  printf '%s\n' "${targets[@]}" | xargs -P "$jobs" -n 1 bash -c 'fuzz_target "$1"' _
  for target in "${targets[@]}"; do
    check "fuzz: ${target##*/fuzz_}" fuzz_result "${target##*/fuzz_}"
  done
}

summary() {
  printf '\n'
  if [ ${#failures[@]} -gt 0 ]; then printf 'failed: %s\n' "${failures[@]}"; fi
  printf 'all phases: %d s\n' "$SECONDS"
  printf '%d passed, %d failed' $passed $failed
  if [ $skipped -gt 0 ]; then printf ', %d skipped' $skipped; fi
  printf '\n'
  if [ $failed -gt 0 ]; then exit 1; fi
}

# Nothing can be built without the tools, so this one failure ends the run.
phase 'setup' tools/setup.sh --dev
if [ $failed -gt 0 ]; then summary; fi

ccache_dir=${CCACHE_DIR:-${HOME:-/nonexistent}/.cache/ccache}
if ! mkdir -p "$ccache_dir" 2>/dev/null || ! [ -w "$ccache_dir" ]; then
  export CCACHE_DIR=$PWD/build/ccache
fi

if [ "$mode" = --ci ]; then
  # From nothing, many files as one take a third of the time. Who changes one file has it sooner without.
  phase 'dev: build' configure_and_build dev dev -DQMPIPE_UNITY=ON
  start_tidy
else
  phase 'dev: build' configure_and_build dev dev -DQMPIPE_UNITY=OFF
fi
ctest_phase dev
if [ "$mode" = --ci ]; then
  check 'format' format_check
  build_and_test release-tests release
  build_and_test asan asan
  build_and_test tsan tsan
  fuzz
  check 'clang-tidy, and each file alone: what is left' finish_tidy
fi
summary
