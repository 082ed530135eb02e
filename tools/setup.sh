#!/usr/bin/env bash
# Installs what qmpipe needs on a bare Debian 12: compiler, build tools and libraries, and from npm
# the CesiumJS and three.js of its viewer pages. Needs root (or sudo) where packages are missing.
# Safe to run again: what is there is left alone.
#   tools/setup.sh          what a build and a look at its result need
#   tools/setup.sh --dev    also what the tests and checks need: a browser, the web servers of
#                           docs/SERVING.md, other readers of HDF5, groff, doxygen, clang-format, clang-tidy, the
#                           fuzzer runtime, valgrind, perf
set -euo pipefail
cd "$(dirname "$0")/.."

# libcurl (for `qmpipe check`) comes with libgdal-dev, in the flavour that is there or its first choice.
build_packages=(
  g++ cmake ninja-build ccache git ca-certificates pkg-config
  libtbb-dev libgdal-dev libproj-dev libhdf5-dev libzstd-dev libdeflate-dev libmeshoptimizer-dev libcgal-dev
  libsqlite3-dev
  libcli11-dev libspdlog-dev libfmt-dev nlohmann-json3-dev
  libgtest-dev libgmock-dev libbenchmark-dev
  gdal-bin python3 sqlite3
)
dev_packages=(
  chromium nginx-core apache2-bin caddy
  hdf5-tools python3-h5py python3-zstandard groff-base doxygen
  clang-14 clang-format-14 clang-tidy-14 libclang-rt-14-dev valgrind linux-perf
)

packages=("${build_packages[@]}")
if [ "${1:-}" = "--dev" ]; then packages+=("${dev_packages[@]}"); fi

# A Node.js from elsewhere has its own npm, which Debian's would displace.
command -v npm >/dev/null || packages+=(npm)

missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' || missing+=("$package")
done
if [ ${#missing[@]} -gt 0 ]; then
  as_root=()
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || { echo "setup: run this as root, or install sudo: missing ${missing[*]}" >&2; exit 1; }
    as_root=(sudo)
  fi
  echo "setup: installing ${missing[*]}"
  "${as_root[@]}" apt-get update -qq
  # Run level 1: no web server is started because it was installed.
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive RUNLEVEL=1 \
    apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
fi

# npm_packages FOLDER: what its package-lock.json pins; left alone when that is what is there.
npm_packages() {
  cmp -s "$1/package-lock.json" "$1/node_modules/.installed-lock.json" && return 0
  echo "setup: installing the npm packages of $1"
  (cd "$1" && npm ci --ignore-scripts --omit=optional --no-audit --no-fund --loglevel=error >/dev/null)
  cp "$1/package-lock.json" "$1/node_modules/.installed-lock.json"
}
npm_packages tools/viewer
if [ "${1:-}" = "--dev" ]; then npm_packages tests/browser; fi
echo "setup: everything is installed"
