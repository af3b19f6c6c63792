#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Tells Snakemake what became of the Slurm job $1: running, success or failed.
state=$(scontrol -o show job "$1" 2>/dev/null | sed -n 's/.* JobState=\([A-Z_]*\).*/\1/p')
[ -n "$state" ] || state=$(sacct -j "$1" -X -n -P -o State 2>/dev/null | head -n 1)
case "$state" in
COMPLETED*) echo success ;;
PENDING* | CONFIGURING* | RUNNING* | COMPLETING* | SUSPENDED* | REQUEUED* | "") echo running ;;
*) echo failed ;;
esac
