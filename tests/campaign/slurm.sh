#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Flies four flights through Slurm with the profile config/campaign/slurm: one node on the loopback address, started here
# and stopped at the end. Skipped (77) without Slurm, munge or Snakemake (Debian: slurmctld slurmd slurm-client munge
# snakemake), or without root, which slurmd wants.
# usage: slurm.sh BOLE SOURCE_FOLDER
set -eu
for program in snakemake slurmctld slurmd sbatch munged; do
  command -v "$program" >/dev/null || { echo "skipped: $program is not installed"; exit 77; }
done
[ "$(id -u)" -eq 0 ] || { echo "skipped: slurmd wants root"; exit 77; }
bole=$1
source=$2
folder=$(mktemp -d)
chmod 755 "$folder"
stop() {
  for daemon in slurmd slurmctld munged; do
    [ ! -s "$folder/$daemon.pid" ] || kill "$(cat "$folder/$daemon.pid")" 2>/dev/null || true
  done
  sleep 1
  rm -rf "$folder"
}
trap stop EXIT

mkdir -m 700 "$folder/munge"
mkdir -m 755 "$folder/socket"
dd if=/dev/urandom of="$folder/munge/key" bs=1024 count=1 status=none
chmod 400 "$folder/munge/key"
munged --force --socket="$folder/socket/munge" --key-file="$folder/munge/key" --pid-file="$folder/munged.pid" \
  --log-file="$folder/munge/log" --seed-file="$folder/munge/seed" >/dev/null 2>&1

free_port() {
  python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'
}
mkdir "$folder/state" "$folder/spool"
cat >"$folder/slurm.conf" <<CONF
ClusterName=loopback
SlurmctldHost=$(hostname)(127.0.0.1)
SlurmctldPort=$(free_port)
SlurmdPort=$(free_port)
SlurmUser=root
AuthInfo=socket=$folder/socket/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
MpiDefault=none
ReturnToService=2
SchedulerParameters=batch_sched_delay=0,sched_interval=5,defer
NodeName=node NodeHostname=$(hostname) NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=$(($(awk '/MemTotal/ {print $2}' /proc/meminfo) / 1100)) State=UNKNOWN
PartitionName=all Nodes=node Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$folder/slurm.conf
slurmctld
slurmd -N node
for _ in $(seq 30); do
  [ "$(sinfo -h -o %T 2>/dev/null)" = idle ] && break
  sleep 1
done
[ "$(sinfo -h -o %T)" = idle ] || { echo "the node did not come up:"; tail -n 5 "$folder/slurmctld.log" "$folder/slurmd.log"; exit 1; }

cat >"$folder/campaign.yaml" <<YAML
name: slurm
flights: {seeds: 1-4, density: 0.05, light: [sun, overcast], path: forward, frames: 12, samples: 1}
strata: [light]
YAML
mkdir "$folder/flown"
BOLE=$bole timeout 300 snakemake -s "$source/apps/campaign/Snakefile" --configfile "$folder/campaign.yaml" \
  --profile "$source/config/campaign/slurm" --latency-wait 10 -d "$folder/flown" >"$folder/log.txt" 2>&1 ||
  { cat "$folder/log.txt" "$folder"/flown/logs/*.txt; exit 1; }
[ "$(ls "$folder/flown/results/default" | wc -l)" -eq 4 ] || { echo "not four results"; exit 1; }
[ "$(find "$folder/flown/logs" -name 'slurm-*' | wc -l)" -eq 8 ] || { echo "not every flight was a job of Slurm"; exit 1; }
grep -q '^default,all,,recall,' "$folder/flown/summary.csv" || { echo "no recall in summary.csv"; exit 1; }
