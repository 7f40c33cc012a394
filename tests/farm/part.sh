#!/bin/sh
# One part of a still: the work of one task of a job array, on whatever machine it runs.
#
#   part.sh TASK TASKS SPP FOLDER SCENE [FLAGS OF penumbra render …]
#
# Traces its share of the sample indices 0..SPP into FOLDER/part-TASK.film, TASK counting from 0. Started again
# after it was stopped, it goes on from what there is; started again when it was done, it does nothing.
set -eu
task=$1 tasks=$2 spp=$3 folder=$4
shift 4
from=$((task * spp / tasks)) to=$(((task + 1) * spp / tasks))
film=$(printf '%s/part-%04d.film' "$folder" "$task")
if [ -f "$film" ]; then
    set -- "$@" --resume "$film"
fi
# In place of the shell, so that the scheduler's signals arrive: on SIGTERM and SIGINT the film is saved.
exec "${PENUMBRA:-penumbra}" render "$@" --sample-range "$from..$to" -o "$film"
