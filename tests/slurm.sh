#!/usr/bin/env bash
# Runs a scan in parts by a real Slurm on this machine, by the script of docs/how-to/cluster.md: an array, a part
# that is killed, a part that is asked to end before its time limit, a second array, and the join; the bits equal
# one run.
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
    tail -n 20 "$place"/*.log >&2 2>/dev/null || true
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
# The script and the lines that submit it, as docs/how-to/cluster.md has them, with four parts of this scan.
block() { awk -v n="$1" '/^```/ { inside = /^```bash$/ && ++at == n; next } inside' "$tests/../docs/how-to/cluster.md"; }
block 1 | sed -e 's/--array=0-39%10/--array=0-3%2/' -e 's/^parts=40 views=1440 .*/parts=4 views=24/' \
    -e 's/--partition=gpu --gres=gpu:1 --time=4:00:00/--time=10 --cpus-per-task=1/' >scan.sbatch
[ "$(grep -cE -- '--array=0-3%2|^parts=4 views=24$|--time=10' scan.sbatch)" = 3 ] || fail "the script of cluster.md is another"
block 2 >submit.sh
mkdir bin
ln -s "$program" bin/beamlet
PATH=$place/bin:$PATH

# The first array: one part is killed, one receives the signal of a time limit. Parts wait at a gate (a pipe
# that nobody has opened for writing) once they have committed a view.
mkfifo gate
cc -shared -fPIC -O1 -o gate.so "$tests/support/gate.c"
array=$(env LD_PRELOAD="$place/gate.so" BEAMLET_GATE=sync BEAMLET_GATE_FILE=/progress.log BEAMLET_GATE_AT=sample/ \
    BEAMLET_GATE_PIPE="$place/gate" bash -c '. ./submit.sh >/dev/null; echo "$array"')
begun() { grep -q sample/ "parts/$1/progress.log"; }
wait_for 60 "part 0 begins" begun 0
wait_for 60 "part 1 begins" begun 1
kill_part() { scancel -s KILL --full "${array}_1"; }
wait_for 20 "part 1 is killed" kill_part
scancel -s TERM --batch "${array}_0"
wait_for 60 "part 0 is interrupted" grep -q "stopping; press" part-0.log
: >gate
is_queued_again() { scontrol show job "${array}_0" | grep -q 'Restarts=1'; }
wait_for 60 "part 0 is queued again" is_queued_again
say "$SECONDS s: part 1 killed, part 0 in the queue again"
# A part that is cancelled as it starts puts its task into the queue again.
has_ended() { scancel -u root && [ -z "$(squeue -h)" ]; }
wait_for 60 "the first array ends" has_ended
say "$SECONDS s: the first array has ended"
if beamlet join parts/* -o run 2>refused; then fail "parts that are not complete were joined"; fi
grep -qE "exposures|no part" refused || fail "$(cat refused)"
if beamlet retrieve parts/0 2>refused; then fail "a part was retrieved"; fi
grep -q "beamlet join" refused || fail "$(cat refused)"

# One part by hand, the others by a second array with its join.
beamlet simulate scan.toml --resume -o parts/1 -q
# shellcheck source=/dev/null
. ./submit.sh >/dev/null
is_joined() { grep -q '"done"' run/run.json; }
wait_for 120 "the parts are joined" is_joined
say "$SECONDS s: joined"
wait_for 60 "the second array ends" bash -c '[ -z "$(squeue -h)" ]'

beamlet simulate scan.toml -o whole -q
diff -rq -x run.json -x progress.log run whole || fail "files differ from those of one run"
cmp <(sort run/progress.log) <(sort whole/progress.log) || fail "progress.log differs"
beamlet check run | grep -q 'whole    yes' || fail "the joined run is not whole"
say "24 views in 4 parts, one killed and one queued again: the bits of one run, in $SECONDS s"
