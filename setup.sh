#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# From a fresh Debian machine to a map, a passed test suite, an installation or packages.
set -eu
umask 022 # what is installed and packaged is for everyone
called_from="$PWD"
cd "$(dirname "$0")"

BUILD_PACKAGES="g++ cmake ninja-build pkg-config git libvisp-dev libopencv-dev libeigen3-dev libnlopt-dev libyaml-cpp-dev
libcli11-dev nlohmann-json3-dev libfmt-dev libavcodec-dev libavformat-dev libavutil-dev libswscale-dev"
PYTHON_PACKAGES="pybind11-dev python3-dev python3-numpy"
CAMPAIGN_PACKAGES="libembree-dev snakemake python3-scipy python3-matplotlib"
TEST_PACKAGES="$PYTHON_PACKAGES $CAMPAIGN_PACKAGES libgtest-dev libgmock-dev visp-images-data xvfb xauth python3-pandas
valgrind chromium gdal-bin procps slurmctld slurmd slurm-client munge"

usage() {
  echo "usage: ./setup.sh demo               map the demonstration flight"
  echo "       ./setup.sh test               pass the test suite"
  echo "       ./setup.sh install [PREFIX]   the command, library, headers and Python module (default /usr/local)"
  echo "       ./setup.sh package            Debian packages in build/demo/packages"
  echo "       ./setup.sh campaign           many simulated flights with tables and a page: the small one, in campaigns/small"
  echo "Each installs the Debian packages that it needs and builds first."
}

say() {
  echo "== $(date +%H:%M:%S) $*"
}

fail() {
  echo "setup.sh: $*" >&2
  exit 1
}

as_root() {
  if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi
}

may_be_root() {
  [ "$(id -u)" -eq 0 ] || { command -v sudo >/dev/null && sudo -v; }
}

install_packages() { # PACKAGE...
  missing=""
  for package in "$@"; do
    dpkg-query -W -f '${Status}\n' "$package" 2>/dev/null | grep -q "install ok installed" || missing="$missing $package"
  done
  [ -n "$missing" ] || return 0
  may_be_root || fail "Debian packages are missing and sudo is not to be had; as root: apt-get install$missing"
  say "installing Debian packages (about two minutes, and until any other apt is done):$missing"
  log=$(mktemp)
  apt_get update || true # a source that fails is no matter where the packages are to be had
  # shellcheck disable=SC2086
  apt_get install -y --no-install-recommends $missing ||
    fail "apt-get: $(grep -E 'Failed to fetch|^E: ' "$log" | grep -v -m 1 lock) (is there a network? all that it said: $log)"
  rm -f "$log"
}

# Once no other one is at work: apt itself waits for dpkg's lock alone.
apt_get() { # ARGUMENT...
  until as_root env LC_ALL=C DEBIAN_FRONTEND=noninteractive apt-get -q "$@" >>"$log" 2>&1; do
    tail -n 3 "$log" | grep -q "Could not get lock" || return 1
    sleep 5
  done
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

# The command under its name: in a folder of PATH that is the user's to write, never in place of another file.
link_command() {
  for folder in "$HOME/.local/bin" /usr/local/bin; do
    case ":$PATH:" in *":$folder:"*) ;; *) continue ;; esac
    if [ -w "$folder" ] && { [ -L "$folder/bole" ] || [ ! -e "$folder/bole" ]; }; then
      ln -sf "$PWD/build/demo/bole" "$folder/bole"
      return
    fi
  done
  echo "The tutorials' \`bole\` in this shell: PATH=\"$PWD:\$PATH\" (in every one: ./setup.sh install)"
}

install_to() { # PREFIX
  case "$1" in /*) prefix="$1" ;; *) prefix="$called_from/$1" ;; esac
  above="$prefix"
  while [ ! -e "$above" ]; do above=$(dirname "$above"); done
  as=""
  if [ ! -w "$above" ]; then
    may_be_root || fail "$prefix is root's to write and sudo is not to be had: as root, or ./setup.sh install \$HOME/.local"
    as=as_root
  fi
  # shellcheck disable=SC2086
  install_packages $BUILD_PACKAGES $PYTHON_PACKAGES
  build_command -DCMAKE_INSTALL_PREFIX="$prefix" -DCMAKE_SKIP_INSTALL_RPATH=OFF
  if [ -L "$prefix/bin/bole" ]; then $as rm "$prefix/bin/bole"; fi # of `demo`
  $as cmake --install build/demo >/dev/null
  if [ -n "$as" ] || [ "$(id -u)" -eq 0 ]; then $as /sbin/ldconfig; fi
  say "installed to $prefix: try $prefix/bin/bole track park-forward -o run"
}

most_words=1
case "${1:-}" in install) most_words=2 ;; esac
[ $# -le $most_words ] || fail "too many words: $* (./setup.sh --help)"

case "${1:-}" in
demo)
  echo "This takes about six minutes on two cores, a third of it for the packages."
  build_command
  ln -sf build/demo/bole bole
  say "mapping the demonstration flight, and comparing the map with the true trunks"
  ./bole track data/park-forward -o run
  ./bole evaluate run data/park-forward | grep -A 1 '^Trunks'
  link_command
  [ -d build/demo/python ] || echo "There is no Python module yet: ./setup.sh install builds it, too."
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
  install_to "${2:-/usr/local}"
  ;;
package)
  # shellcheck disable=SC2086
  install_packages $BUILD_PACKAGES $PYTHON_PACKAGES dpkg-dev file
  build_command -DCMAKE_INSTALL_PREFIX=/usr -DCMAKE_SKIP_INSTALL_RPATH=ON
  (cd build/demo && cpack -G DEB)
  say "done: apt install ./build/demo/packages/*.deb, then bole track park-forward -o run in any folder"
  ;;
campaign)
  # shellcheck disable=SC2086
  install_packages $BUILD_PACKAGES $CAMPAIGN_PACKAGES
  say "building the command with the laboratory"
  cmake --preset release -DBOLE_BUILD_TESTS=OFF
  cmake --build --preset release --target bole
  snakemake -s apps/campaign/Snakefile --configfile config/campaign/small.yaml --cores 2 -d campaigns/small
  say "done. Look at campaigns/small/page.html"
  ;;
-h | --help | help)
  usage
  ;;
"")
  usage >&2
  exit 2
  ;;
*)
  meant=""
  for word in demo test install package campaign; do
    case "$1" in "${word%"${word#?}"}"*) meant="; did you mean $word?" ;; esac
  done
  echo "setup.sh: no such word: $1$meant (./setup.sh --help)" >&2
  exit 2
  ;;
esac
