#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# budget.sh BOLE TABLE SEQUENCE: counts the instructions of each stage over 30 frames and compares them with TABLE, lines
# of "stage function millions_a_frame". Fails where a stage takes 10 % more. Change the table on purpose only.
bole=$1 table=$2 sequence=$3 frames=30 worse=0
command -v valgrind >/dev/null && command -v callgrind_annotate >/dev/null || { echo "no valgrind: skipped"; exit 77; }
grep -q avx2 /proc/cpuinfo || { echo "the table counts AVX2: skipped"; exit 77; }
run=$(mktemp -d) && trap 'rm -rf "$run"' EXIT
# One thread: those of OpenMP wait by spinning, for as long as the machine is busy.
OMP_NUM_THREADS=1 valgrind --tool=callgrind --callgrind-out-file="$run/counts" "$bole" track "$sequence" -o "$run/run" --no-video --quiet \
  --frames $frames >"$run/log" 2>&1
grep -q "Unrecognised instruction" "$run/log" && { echo "this valgrind does not know this processor: skipped"; exit 77; }
[ -s "$run/counts" ] || { cat "$run/log"; exit 1; }
callgrind_annotate --inclusive=yes --threshold=100 "$run/counts" >"$run/functions" || exit 1
while read -r stage function allowed; do
  case $stage in '#'* | '') continue ;; esac
  count=$(awk -v f="$function(" 'index($0, f) { gsub(",", "", $1); print $1; exit }' "$run/functions")
  if [ -z "$count" ]; then
    echo "$stage: $function was not called"
    worse=1
    continue
  fi
  awk -v s="$stage" -v n="$count" -v frames=$frames -v allowed="$allowed" 'BEGIN {
    m = n / frames / 1e6
    is_worse = m > 1.1 * allowed
    printf "%-12s %8.2f of %8.2f million instructions a frame%s\n", s, m, allowed, is_worse ? ": TOO MANY" : ""
    exit is_worse }' || worse=1
done <"$table"
exit $worse
