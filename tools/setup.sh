#!/usr/bin/env bash
# Installs what qmpipe needs on a bare Debian 12: compiler, build tools and libraries.
# Needs root (or sudo). Safe to run again: packages that are there are left alone.
#   tools/setup.sh          what a build and its tests need
#   tools/setup.sh --dev    also clang-format, clang-tidy, the fuzzer runtime, valgrind, perf, and the web
#                           servers that docs/SERVING.md is tried with
set -euo pipefail

# libcurl (for `qmpipe check`) comes with libgdal-dev, in the flavour that is there or its first choice.
build_packages=(
  g++ cmake ninja-build ccache git ca-certificates pkg-config
  libtbb-dev libgdal-dev libproj-dev libhdf5-dev libzstd-dev libdeflate-dev libmeshoptimizer-dev libcgal-dev
  libsqlite3-dev libcpp-httplib-dev
  libcli11-dev libspdlog-dev libfmt-dev nlohmann-json3-dev
  libgtest-dev libgmock-dev libbenchmark-dev
  gdal-bin python3 sqlite3
)
dev_packages=(clang-14 clang-format-14 clang-tidy-14 libclang-rt-14-dev valgrind linux-perf nginx-core apache2-bin caddy)

packages=("${build_packages[@]}")
if [ "${1:-}" = "--dev" ]; then packages+=("${dev_packages[@]}"); fi

missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' || missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then
  echo "setup: everything is installed"
  exit 0
fi

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "setup: run this as root, or install sudo: missing ${missing[*]}" >&2; exit 1; }
  as_root=(sudo)
fi
echo "setup: installing ${missing[*]}"
"${as_root[@]}" apt-get update -qq
# RUNLEVEL=1: the packages' scripts start no service (invoke-rc.d takes the machine for one in single-user mode).
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive RUNLEVEL=1 apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
echo "setup: done"
