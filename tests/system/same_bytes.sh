#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# same_bytes.sh OLD_BOLE NEW_BOLE OUT: flies both commands over rendered, simulated, plain and servoing flights, and says
# whether maps, hypotheses, paths and graphs are the same bytes. One line a flight; flights that are absent are skipped.
[ $# = 3 ] || { sed -n 3,4p "$0"; exit 2; }
declare -A bole=([old]=$(realpath "$1") [new]=$(realpath "$2"))
sources=$(realpath "$(dirname "$0")/../..")
mkdir -p "$3" && cd "$3" || exit 2
rendered=$sources/../shared/data/rendered differ=0

# compare NAME FILE...: of the runs old/NAME and new/NAME; what neither wrote is no difference
compare() {
  local name=$1 file unlike=""
  shift
  for file in "$@"; do
    [ -e "old/$name/$file" ] || [ -e "new/$name/$file" ] || continue
    cmp -s "old/$name/$file" "new/$name/$file" || unlike+=" $file"
  done
  [ -e "old/$name/$1" ] || unlike+=" (the old command made no $1)"
  echo "$name: ${unlike:+DIFFERS:}${unlike:-same}"
  [ -z "$unlike" ] || differ=1
}

# track NAME INPUT OPTION...
track() {
  local name=$1 input=$2 which
  shift 2
  [ -d "$input" ] || { echo "$name: skipped, no $input"; return; }
  for which in old new; do
    rm -rf "${which:?}/$name"
    "${bole[$which]}" track "$input" -o "$which/$name" --no-video -q "$@" >"$which-$name.log" 2>&1
  done
  compare "$name" trunks.csv hypotheses.csv trajectory.tum trajectory_online.tum graph.g2o
}

# servo NAME TASK SEED: all but what the loop took
servo() {
  local which
  for which in old new; do
    rm -rf "${which:?}/$1"
    "${bole[$which]}" servo "$2" --seed "$3" --duration 20 --no-video -q -o "$which/$1" >"$which-$1.log" 2>&1
    [ -e "$which/$1/seed-$3/samples.csv" ] && cut -d, -f1-16,18- "$which/$1/seed-$3/samples.csv" >"$which/$1/samples"
  done
  compare "$1" samples
}

mkdir -p old new
track park-forward "$sources/data/park-forward"
track winter-weave "$rendered/winter-weave"
track pine-arc "$rendered/pine-arc"
for seed in 9301 9302; do
  [ -d "wood-$seed" ] || "${bole[old]}" simulate -o "wood-$seed" --seed $seed --frames 80 --samples 2 -q >/dev/null
  track "wood-$seed" "wood-$seed"
done
track plain "$sources/data/park-forward" --odometry none
track online "$sources/data/park-forward" --online
track lag "$sources/data/park-forward" --set map.lag=3
servo hold hold 9311
servo gap gap 9312
exit $differ
