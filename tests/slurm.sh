#!/usr/bin/env bash
# Runs a scan in shards by a real Slurm on this machine: an array, a shard that is killed, a shard that
# is asked to end before its time limit, a second array, and the join; the bits equal one run.
# Fails where Slurm does not start. The daemons are of this script alone and end with it. Needs root.
#   tests/slurm.sh PROGRAM
set -euo pipefail
program=$(realpath "$1")
tests=$(realpath "$(dirname "$0")")
PATH=$PATH:/usr/sbin:/sbin
place=$(mktemp -d)
daemons=()
finish() {
    scancel -s KILL --full -u root 2>/dev/null || true
    [ ${#daemons[@]} = 0 ] || kill "${daemons[@]}" 2>/dev/null || true
    for _ in $(seq 20); do
        [ -n "$(jobs -r)" ] || break
        sleep 0.1
    done
    [ ${#daemons[@]} = 0 ] || kill -KILL "${daemons[@]}" 2>/dev/null || true
    wait 2>/dev/null || true
    rm -rf "$place"
}
trap finish EXIT
trap 'exit 130' INT TERM
say() { echo "slurm: $*" >&2; }
fail() {
    say "FAILED: $*"
    tail -n 20 "$place"/*.log "$place"/run/slurm/*.log >&2 2>/dev/null || true
    exit 1
}

# Ports that nobody uses on a machine without Slurm.
host=$(hostname -s)
export SLURM_CONF=$place/slurm.conf
mkdir "$place/state" "$place/spool"
cat >"$SLURM_CONF" <<CONF
ClusterName=beamlet
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=36817
SlurmdPort=36818
AuthType=auth/none
CredType=cred/none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=batch_sched_delay=0,sched_interval=1
ReturnToService=2
SlurmUser=root
SlurmdUser=root
StateSaveLocation=$place/state
SlurmdSpoolDir=$place/spool
SlurmctldPidFile=$place/slurmctld.pid
SlurmdPidFile=$place/slurmd.pid
KillWait=5
NodeName=$host NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF

# wait_for SECONDS WHAT COMMAND…: until the command succeeds.
wait_for() {
    local until=$((SECONDS + $1)) what=$2
    shift 2
    until "$@" >/dev/null 2>&1; do
        [ "$SECONDS" -lt "$until" ] || fail "$what: not within the time"
        sleep 0.2
    done
}

slurmctld -D -c -L "$place/slurmctld.log" >"$place/slurmctld.out.log" 2>&1 &
daemons+=($!)
slurmd -D -L "$place/slurmd.log" >"$place/slurmd.out.log" 2>&1 &
daemons+=($!)
is_idle() { sinfo -h -o %T | grep -qx idle; }
wait_for 30 "Slurm starts" is_idle
say "$SECONDS s: started"

cd "$place"
cat >scan.toml <<'TOML'
[source]
distance = "1.2 m"
spot = "20 um"
energy = "30 keV"
[detector]
distance = "1.8 m"
pixels = [32, 24]
pitch = "150 um"
photons = 2000
[sample_mask]
distance = "1.1 m"
material = "gold"
thickness = "225 um"
projected_aperture = "30 um"
[detector_mask]
material = "gold"
thickness = "225 um"
projected_aperture = "30 um"
[sampling]
tolerance = 1e-3
[scan]
mask_offsets = { from = "-25 um", to = "25 um", count = 5 }
angles = { from = "0 deg", to = "360 deg", count = 24 }
[[object]]
name = "rod"
shape = { cylinder = { radius = "1.5 mm", height = "5 mm" } }
material = "polyethylene"
position = ["0.2 mm", "0 mm", "0 mm"]
TOML
"$program" plan scan.toml --shards 4 --slurm --at-once 2 --format npy --backend bvh -o run \
    --sbatch-option time=10 --sbatch-option cpus-per-task=1

# The first array: one shard is killed, one receives the signal of a time limit. Shards wait at a gate (a pipe
# that nobody has opened for writing) once they have committed a view.
mkfifo gate
cc -shared -fPIC -O1 -o gate.so "$tests/support/gate.c"
env LD_PRELOAD="$place/gate.so" BEAMLET_GATE=sync BEAMLET_GATE_FILE=/progress.log BEAMLET_GATE_AT=sample/ \
    BEAMLET_GATE_PIPE="$place/gate" sh run/slurm/submit.sh >/dev/null
array=$(squeue -h -r -o %i -n beamlet-run | sed 's/_.*//' | head -n 1)
begun() { grep -q sample/ "run/shards/000$1/progress.log"; }
wait_for 60 "shard 0 begins" begun 0
wait_for 60 "shard 1 begins" begun 1
kill_shard() { scancel -s KILL --full "${array}_1"; }
wait_for 20 "shard 1 is killed" kill_shard
scancel -s TERM --batch "${array}_0"
wait_for 60 "shard 0 is interrupted" grep -q "stopping; press" run/slurm/shard-0.log
: >gate
is_queued_again() { scontrol show job "${array}_0" | grep -q 'Restarts=1'; }
wait_for 60 "shard 0 is queued again" is_queued_again
say "$SECONDS s: shard 1 killed, shard 0 in the queue again"
"$program" join run --status
# A shard that is cancelled as it starts puts its task into the queue again.
has_ended() { scancel -n beamlet-run && [ -z "$(squeue -h)" ]; }
wait_for 60 "the first array ends" has_ended
say "$SECONDS s: the first array has ended"
if "$program" join run 2>refused; then fail "a run with shards that are missing was joined"; fi
grep -q "shards are missing" refused || fail "$(cat refused)"
if "$program" retrieve run 2>refused; then fail "a run that is not joined was retrieved"; fi
grep -q "beamlet join" refused || fail "$(cat refused)"

# One shard by hand, the others by a second array with its join.
"$program" simulate run/scene.toml --shard 1/4 -o run -q
sh run/slurm/submit.sh >/dev/null
is_joined() { [ ! -e run/plan.json ]; }
wait_for 120 "the shards are joined" is_joined
say "$SECONDS s: joined"
wait_for 60 "the second array ends" bash -c '[ -z "$(squeue -h)" ]'

"$program" simulate scan.toml --format npy --backend bvh -o whole -q
for file in flat.npy sample.npy dark.npy counts/flat.npy counts/sample.npy geometry.json; do
    cmp "run/$file" "whole/$file" || fail "$file differs from that of one run"
done
cmp <(sort run/progress.log) <(sort whole/progress.log) || fail "progress.log differs"
"$program" check run | grep -q 'whole    yes' || fail "the joined run is not whole"
say "24 views in 4 shards, one killed and one queued again: the bits of one run, in $SECONDS s"
