#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Flies four flights through Snakemake, killed once on the way, and looks at what it left. Skipped (77) without Snakemake.
# usage: small.sh BOLE SOURCE_FOLDER
set -eu
command -v snakemake >/dev/null || { echo "skipped: snakemake is not installed (./setup.sh campaign installs it)"; exit 77; }
bole=$1
source=$2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat >"$folder/campaign.yaml" <<YAML
name: four
flights: {seeds: 1-4, density: 0.05, light: [sun, overcast], path: forward, frames: 12, samples: 1}
runs: {default: {}, broken: {arguments: [--no-such-option]}}
compare: [[default, broken]]
strata: [light]
servo: {hold: {task: hold, seeds: 1, arguments: [--perception, truth, --duration, 2], sweep: {latency: [0, .1]}}}
YAML
fly() {
  BOLE=$bole snakemake -s "$source/apps/campaign/Snakefile" --configfile "$folder/campaign.yaml" --cores 2 \
    -d "$folder" --rerun-incomplete --quiet >"$folder/log.txt" 2>&1
}
# killed as soon as one result is there; the same command must go on
fly &
pid=$!
while kill -0 $pid 2>/dev/null && ! ls "$folder"/results/default/*.json >/dev/null 2>&1; do sleep 0.2; done
sleep 1 # the engine notes what it has seen finished
kill -KILL $pid 2>/dev/null || true
wait $pid 2>/dev/null || true
pkill -KILL -f "$folder" 2>/dev/null || true
# an orphan would write the flight that the next one writes
for _ in $(seq 100); do
  readlink /proc/[0-9]*/cwd 2>/dev/null | grep -q "$folder" || break
  sleep 0.2
done
first=$(stat -c %Y "$folder"/results/default/*.json | sort -n | head -n 1)
BOLE=$bole snakemake -s "$source/apps/campaign/Snakefile" --configfile "$folder/campaign.yaml" --cores 2 -d "$folder" \
  --unlock >/dev/null 2>&1
BOLE=$bole snakemake -s "$source/apps/campaign/Snakefile" --configfile "$folder/campaign.yaml" --cores 2 -d "$folder" \
  so_far >/dev/null 2>&1
grep -q 'of 10 results' "$folder/page.html" && ! grep -q '10 of 10 results' "$folder/page.html" ||
  { echo "no page of what was flown so far"; exit 1; }
fly || { cat "$folder/log.txt"; exit 1; }
[ "$(ls "$folder"/results/default | wc -l)" -eq 4 ] || { echo "not four results"; exit 1; }
[ "$(stat -c %Y "$folder"/results/default/*.json | sort -n | head -n 1)" -eq "$first" ] || { echo "a finished flight was flown twice"; exit 1; }
tr '\n' ' ' <"$folder/page.html" | grep -q 'Sweeps.*<img' || { echo "no curve of the sweep"; exit 1; }
[ "$(tail -n +2 "$folder/failures.csv" | wc -l)" -eq 4 ] || { echo "the four failures are not reported"; exit 1; }
grep -q '^default,all,,recall,' "$folder/summary.csv" || { echo "no recall in summary.csv"; exit 1; }
grep -q '10 of 10 results' "$folder/page.html" || { echo "no page"; exit 1; }
[ -z "$(ls "$folder/flights" 2>/dev/null)" ] || { echo "pictures were not cleared"; exit 1; }
