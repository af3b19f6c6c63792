#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# From a fresh Debian machine to a map, a passed test suite, an installation or packages.
set -eu
cd "$(dirname "$0")"

BUILD_PACKAGES="g++ cmake ninja-build pkg-config git libvisp-dev libopencv-dev libeigen3-dev libnlopt-dev libyaml-cpp-dev
libcli11-dev nlohmann-json3-dev libfmt-dev libavcodec-dev libavformat-dev libavutil-dev libswscale-dev"
TEST_PACKAGES="libgtest-dev libgmock-dev libembree-dev visp-images-data xvfb xauth pybind11-dev python3-dev python3-numpy
python3-pandas python3-matplotlib"
PACKAGE_PACKAGES="dpkg-dev file pybind11-dev python3-dev"

usage() {
  echo "usage: ./setup.sh demo               map the demonstration flight"
  echo "       ./setup.sh test               pass the test suite"
  echo "       ./setup.sh install [PREFIX]   the command, library and headers (default /usr/local)"
  echo "       ./setup.sh package            Debian packages in build/demo/packages"
  echo "       ./setup.sh campaign           many simulated flights with tables and a page: the small one, in campaigns/small"
  echo "Each installs the Debian packages that it needs and builds first."
}

as_root() {
  if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi
}

say() {
  echo "== $(date +%H:%M:%S) $*"
}

install_packages() { # PACKAGE...
  missing=""
  for package in "$@"; do
    dpkg-query -W -f '${Status}\n' "$package" 2>/dev/null | grep -q "install ok installed" || missing="$missing $package"
  done
  [ -n "$missing" ] || return 0
  say "installing Debian packages (about two minutes):$missing"
  as_root apt-get update -qq
  # shellcheck disable=SC2086
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
}

# Release build of the library and the command alone, without laboratory and tests.
build_command() { # CMAKE_ARGUMENT...
  # shellcheck disable=SC2086
  install_packages $BUILD_PACKAGES
  say "building the library and the command (about three minutes on two cores)"
  cmake --preset demo "$@" >build.log || { cat build.log && exit 1; }
  rm -f build.log
  cmake --build --preset demo
}

case "${1:-}" in
demo)
  echo "This takes about six minutes on two cores, a third of it for the packages."
  build_command
  ln -sf build/demo/bole bole
  say "mapping the demonstration flight"
  ./bole track data/park-forward -o run
  ./bole evaluate run data/park-forward
  say "done. Look at run/report.html."
  echo "Here the command is ./bole; ./setup.sh install makes it \`bole\` in every folder."
  ;;
test)
  echo "This takes about twenty minutes on two cores."
  # shellcheck disable=SC2086
  install_packages $BUILD_PACKAGES $TEST_PACKAGES
  say "building the library, the laboratory and the tests"
  cmake --preset check
  cmake --build --preset check
  say "running the tests"
  ctest --test-dir build/check -j "${CTEST_PARALLEL_LEVEL:-$(nproc)}" --output-on-failure --no-tests=error
  ;;
install)
  prefix="${2:-/usr/local}"
  build_command -DCMAKE_INSTALL_PREFIX="$prefix" -DCMAKE_SKIP_INSTALL_RPATH=OFF
  mkdir -p "$prefix" 2>/dev/null || true
  if [ -w "$prefix" ]; then
    cmake --install build/demo >/dev/null
  else
    as_root cmake --install build/demo >/dev/null
  fi
  if [ "$(id -u)" -eq 0 ]; then ldconfig; fi
  say "installed to $prefix: try $prefix/bin/bole track park-forward -o run"
  ;;
package)
  # shellcheck disable=SC2086
  install_packages $BUILD_PACKAGES $PACKAGE_PACKAGES
  build_command -DCMAKE_INSTALL_PREFIX=/usr -DCMAKE_SKIP_INSTALL_RPATH=ON
  (cd build/demo && cpack -G DEB)
  say "done: apt install ./build/demo/packages/*.deb, then bole track park-forward -o run in any folder"
  ;;
campaign)
  # shellcheck disable=SC2086
  install_packages $BUILD_PACKAGES libembree-dev snakemake python3-scipy python3-matplotlib
  say "building the command with the laboratory"
  cmake --preset release -DBOLE_BUILD_TESTS=OFF
  cmake --build --preset release --target bole
  snakemake -s apps/campaign/Snakefile --configfile config/campaign/small.yaml --cores 2 -d campaigns/small
  say "done. Look at campaigns/small/page.html"
  ;;
*)
  usage
  exit 2
  ;;
esac
