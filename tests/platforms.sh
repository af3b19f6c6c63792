#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# The README's commands on a minimal Debian system of its own, from a clean clone of the last commit. As root:
#   tests/platforms.sh SUITE demo|test     ./setup.sh demo or test on SUITE (bookworm, trixie, forky, sid ...)
#   tests/platforms.sh SUITE package       builds the .deb files there and copies them to FOLDER/SUITE-packages
#   tests/platforms.sh SUITE installed     a system that never saw the sources: installs those, maps the packaged flight
# FOLDER is $BOLE_PLATFORMS (default /var/tmp/bole-platforms). It keeps the minimal system as a tar file; the systems
# themselves are unpacked anew each time and removed afterwards. How this machine's apt reaches its mirror is passed on,
# and so is what the environment tells CMake, CTest and Ninja (CMAKE_BUILD_PARALLEL_LEVEL=1 on a busy machine). The last
# line tells the processor time beside the time on the clock, for machines that do other work, too.
set -euo pipefail
suite="${1:?SUITE}" what="${2:-demo}"
sources="$(cd "$(dirname "$0")/.." && pwd)"
folder="${BOLE_PLATFORMS:-/var/tmp/bole-platforms}"
mirror="${BOLE_MIRROR:-http://deb.debian.org/debian}"
minimal="$folder/$suite.tar" system="$folder/$suite-$what"
mapfile -t passed_on < <(env | grep -E '^(CMAKE|CTEST|NINJA)_' || true)

make_minimal_system() {
  [ -s "$minimal" ] && return
  command -v mmdebstrap >/dev/null || apt-get install -y -qq --no-install-recommends mmdebstrap
  mkdir -p "$folder"
  mmdebstrap --variant=apt --include=ca-certificates --aptopt='Acquire::Check-Valid-Until "false"' "$suite" \
    "$folder/new.tar" "$mirror"
  mv "$folder/new.tar" "$minimal"
}

unpack_system() {
  rm -rf "$system"
  mkdir -p "$system"
  tar -C "$system" -xf "$minimal"
  cp /etc/resolv.conf "$system/etc/resolv.conf"
  if ls /etc/apt/apt.conf.d/*proxy* >/dev/null 2>&1; then
    cp /etc/apt/apt.conf.d/*proxy* "$system/etc/apt/apt.conf.d/"
  fi
}

# A command in the system, with mounts of its own that end with it.
inside() {
  # shellcheck disable=SC2016
  unshare --mount --pid --fork sh -c '
    mount -t proc proc "$1/proc" && mount --rbind /dev "$1/dev" && shift_root="$1" && shift
    exec chroot "$shift_root" env -i HOME=/root PATH=/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 "$@"' \
    sh "$system" "${passed_on[@]}" "$@"
}

# shellcheck disable=SC2016
versions() {
  inside sh -c 'dpkg-query -W -f "\${Package} \${Version}\n" libvisp-core-dev libopencv-core-dev libembree-dev \
    libavcodec-dev libfmt-dev libeigen3-dev g++ cmake 2>/dev/null || true'
}

# Of all commands so far, in seconds; `times` counts those of the shell that calls it, not of a $(...).
processor_time() {
  times >"$folder/times"
  processor=$(awk 'END { split($1 $2, t, /[ms]/); print int(60 * (t[1] + t[3]) + t[2] + t[4]) }' "$folder/times")
}

make_minimal_system
unpack_system
commit=$(git -C "$sources" rev-parse --short=10 HEAD)
processor_time
start=$SECONDS processor_start=$processor
case "$what" in
demo | test)
  git clone -q "$sources" "$system/root/bole"
  inside sh -c "cd /root/bole && ./setup.sh $what"
  ;;
package)
  git clone -q "$sources" "$system/root/bole"
  inside sh -c "cd /root/bole && ./setup.sh package"
  mkdir -p "$folder/$suite-packages"
  cp "$system"/root/bole/build/demo/packages/*.deb "$folder/$suite-packages/"
  ;;
installed)
  mkdir -p "$system/root/packages"
  cp "$folder/$suite-packages"/*.deb "$system/root/packages/"
  cp -r "$sources/tests/install/outside" "$system/root/outside"
  printf '#include <bole/open_source.h>\nint main(int, char **a) { bole::openSource(a[1]); }\n' >"$system/root/outside/main.cpp"
  inside sh -c 'cd /tmp && apt-get update -qq && apt-get install -y -qq --no-install-recommends /root/packages/bole_*.deb \
    /root/packages/libbole0*.deb >/dev/null && bole --version && bole track park-forward -o run && bole evaluate run park-forward'
  inside sh -c 'apt-get install -y -qq --no-install-recommends cmake g++ make /root/packages/*.deb >/dev/null && cd /root/outside &&
    cmake -B build && cmake --build build && build/outside /usr/share/bole/data/park-forward'
  ;;
*)
  sed -n '3,9p' "$0"
  exit 2
  ;;
esac
seconds=$((SECONDS - start))
processor_time
versions
echo "$suite $what: passed in $((seconds / 60)) min $((seconds % 60)) s, $((processor - processor_start)) s of processor time, on $(nproc)" \
  "processors, $(date -u +%Y-%m-%d), load $(cut -d' ' -f1 /proc/loadavg), commit $commit"
rm -rf "$system"
