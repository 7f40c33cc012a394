#!/usr/bin/env bash
# Renders a still with a Slurm job array, merges it in a job that waits for the array, and compares with a
# single run, bit for bit. On the way a task is stopped and put back into the queue, and goes on.
#
#   apt-get install slurm-wlm munge && cargo build --release && sudo tests/farm/slurm.sh
#
# It needs no cluster: it makes one of this machine, with its own configuration, key, ports and folder, and
# takes it away again. On a real cluster the lines between the two rules are all there is to do, in a folder
# that all nodes share.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
export PENUMBRA="${PENUMBRA:-$here/../../target/release/penumbra}"
[[ $(id -u) == 0 ]] || { echo "slurm.sh: starts daemons and so has to be root" >&2; exit 1; }
[[ -x $PENUMBRA ]] || { echo "slurm.sh: no $PENUMBRA; run cargo build --release, or set PENUMBRA" >&2; exit 1; }
folder=$(mktemp -d)
daemons=()

clean_up() {
    local code=$?
    if ((code != 0)); then
        tail -n 20 "$folder"/*.log "$folder"/*.out 2>/dev/null >&2 || true
    fi
    # The last started first.
    for ((i = ${#daemons[@]} - 1; i >= 0; i--)); do
        kill "${daemons[i]}" 2>/dev/null || true
        wait "${daemons[i]}" 2>/dev/null || true
    done
    rm -rf "$folder"
}
trap clean_up EXIT

# ---- a cluster of one machine ----
mkdir "$folder/state" "$folder/spool"
head -c 1024 /dev/urandom >"$folder/munge.key"
chmod 0400 "$folder/munge.key"
chmod 0755 "$folder"
port=$((20000 + RANDOM % 20000))
cat >"$folder/slurm.conf" <<EOF
ClusterName=onenode
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmctldPort=$port
SlurmdPort=$((port + 1))
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket
CredType=cred/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
ReturnToService=2
KillWait=30
SlurmdParameters=config_overrides
NodeName=$(hostname -s) NodeAddr=127.0.0.1 CPUs=2
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
EOF
export SLURM_CONF=$folder/slurm.conf
munged --force --foreground --num-threads=2 --socket="$folder/munge.socket" --key-file="$folder/munge.key" \
    --pid-file="$folder/munge.pid" --log-file="$folder/munged.log" --seed-file="$folder/munge.seed" \
    >"$folder/munged.out" 2>&1 &
daemons+=($!)
for ((i = 0; i < 50; i++)); do
    [[ -S $folder/munge.socket ]] && break
    sleep 0.1
done
slurmctld -D -f "$SLURM_CONF" >"$folder/slurmctld.log" 2>&1 &
daemons+=($!)
slurmd -D -f "$SLURM_CONF" -N "$(hostname -s)" >"$folder/slurmd.log" 2>&1 &
daemons+=($!)
for ((i = 0; i < 100; i++)); do
    [[ $(sinfo -h -o %T 2>/dev/null) == idle ]] && break
    sleep 0.2
done
sinfo

scene=(gallery --resolution 160x120 --integrator path)
tasks=6 spp=600

# ---- the recipe ------------------------------------------------------------------------------------------
array=$(sbatch --parsable --array=0-$((tasks - 1)) --cpus-per-task=1 --requeue --open-mode=append \
    --output="$folder/part-%a.out" --wrap="exec $here/part.sh \$SLURM_ARRAY_TASK_ID $tasks $spp $folder ${scene[*]} -t 1")
merge=$(sbatch --parsable --dependency="afterok:$array" --kill-on-invalid-dep=yes --output="$folder/merge.out" \
    --wrap="$PENUMBRA merge $folder/part-*.film --sample-range 0..$spp -o $folder/still.exr -o $folder/still.film")
# ----------------------------------------------------------------------------------------------------------

# A node goes down: task 0 is stopped, and starts again.
for ((i = 0; i < 200; i++)); do
    [[ $(squeue -h -j "${array}_0" -t running 2>/dev/null) ]] && break
    sleep 0.05
done
sleep 0.5
scontrol requeue "${array}_0"
# By itself it would wait for two minutes.
for ((i = 0; i < 200; i++)); do
    [[ -f $folder/part-0000.film ]] && break
    sleep 0.1
done
for ((i = 0; i < 600; i++)); do
    scontrol update "JobId=${array}_0" StartTime=now 2>/dev/null || true
    [[ $(squeue -h -j "$merge" 2>/dev/null) ]] || break
    sleep 0.5
done
grep -h "" "$folder"/part-0.out "$folder/merge.out"

"$PENUMBRA" render "${scene[@]}" --spp $spp -q -o "$folder/single.exr" -o "$folder/single.film"
cmp "$folder/still.film" "$folder/single.film"
cmp "$folder/still.exr" "$folder/single.exr"
grep -q "goes on from" "$folder/part-0.out"
echo "slurm: an array of $tasks tasks, one of them stopped on its way, is the single run, bit for bit"
