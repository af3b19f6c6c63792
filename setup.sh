#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# From a fresh Debian 12 machine to a map (./setup.sh demo) or to a passed test suite (./setup.sh test).
set -eu
cd "$(dirname "$0")"

PACKAGES="build-essential cmake ninja-build ccache pkg-config libvisp-dev libopencv-dev libeigen3-dev libnlopt-dev
libnlopt-cxx-dev libgtest-dev libgmock-dev libyaml-cpp-dev libcli11-dev nlohmann-json3-dev libfmt-dev libavcodec-dev
libavformat-dev libavutil-dev libswscale-dev libembree-dev visp-images-data xvfb"

usage() {
  echo "usage: ./setup.sh demo   install what is needed, build, map the demonstration flight"
  echo "       ./setup.sh test   install what is needed, build, pass the test suite"
}

install_packages() {
  for package in $PACKAGES; do
    if ! dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q "install ok installed"; then
      echo "installing Debian packages"
      sudo=""
      [ "$(id -u)" -eq 0 ] || sudo="sudo"
      $sudo apt-get update -qq
      # shellcheck disable=SC2086
      $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $PACKAGES
      return
    fi
  done
}

case "${1:-}" in
demo)
  install_packages
  cmake --preset release -DBOLE_BUILD_TESTS=OFF
  cmake --build --preset release --target bole
  build/release/bole track data/park-forward -o run
  build/release/bole evaluate run data/park-forward
  echo "Look at run/overlay.mp4, run/saliency.mp4 and run/map.svg"
  ;;
test)
  install_packages
  cmake --preset release -DBOLE_BUILD_TESTS=ON
  cmake --build --preset release
  ctest --test-dir build/release -j2 --output-on-failure
  ;;
*)
  usage
  exit 2
  ;;
esac
