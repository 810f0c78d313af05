#!/usr/bin/env bash
# Purpose: jobs of `submit --slurm` against a slurmctld and a slurmd of this machine: an array, a signal before the time
# limit, a signal, a requeue, a node that goes down. What was stopped ends with the content hashes of a run left alone.
#
# As root, with Debian's slurmctld, slurmd, slurm-client and munge; without them it says so and ends with 0, or with 1
# where EFSI_NEED_SLURM is set. Takes less than a minute on a quiet machine. Daemons are ended by their process ids,
# whatever happens.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

if [[ $(id -u) != 0 ]] || ! { command -v slurmctld && command -v slurmd && command -v munged && command -v sbatch; } >/dev/null
then
  echo "skipped: no SLURM"
  [[ -z ${EFSI_NEED_SLURM-} ]]
  exit
fi

work=$(mktemp -d /tmp/efsi-slurm-XXXXXX)
host=$(hostname -s)
daemons=()
leave() {
  local code=$? pid
  [[ $code == 0 ]] || tail -n 20 "$work"/*.slurm-*.log "$work"/log/* >&2 || true
  scancel --quiet --user=root >/dev/null 2>&1 || true
  for ((i = ${#daemons[@]} - 1; i >= 0; i--)); do # slurmd first: it ends the jobs
    kill "${daemons[i]}" 2>/dev/null || true
  done
  for pid in "${daemons[@]}"; do
    for _ in $(seq 30); do kill -0 "$pid" 2>/dev/null && sleep 0.1 || break; done
    kill -9 "$pid" 2>/dev/null || true
  done
  for pid in $(find /proc/[0-9]*/fd -lname "$work/*" 2>/dev/null | cut -d / -f 3 | sort -u); do # what outlived its job
    [[ $pid == $$ ]] || kill -9 "$pid" 2>/dev/null || true
  done
  rm -rf "$work"
  exit "$code"
}
trap leave EXIT
trap 'exit 143' TERM
trap 'exit 130' INT

fail() {
  echo "slurm.sh: $*" >&2
  exit 1
}
most=120 # seconds for one step on a busy machine; a quiet one takes under a minute for all
within() { # SECONDS COMMAND...: until the command succeeds
  local until=$((SECONDS + $1))
  shift
  until "$@"; do
    ((SECONDS < until)) || fail "not in time: $*"
    sleep 0.2
  done
}
begun=$SECONDS
passed() { echo "ok: $* ($((SECONDS - begun)) s)"; }

# --- one machine -----------------------------------------------------------------------------------------------------

start_daemons() {
  mkdir -p "$work"/{state,spool,log,munge}
  head -c 1024 /dev/urandom >"$work/munge/key"
  chmod 700 "$work/munge"
  chmod 400 "$work/munge/key"
  munged --force --foreground --key-file="$work/munge/key" --socket="$work/munge/socket" --pid-file="$work/munge/pid" \
    --log-file="$work/munge/log" --seed-file="$work/munge/seed" --num-threads=2 >/dev/null 2>&1 &
  daemons+=($!)
  # Six processors, whatever there are: jobs wait more than they compute. No RequeueExit: the script asks for it itself.
  cat >"$work/slurm.conf" <<CONF
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
CryptoType=crypto/munge
SlurmctldPort=16917
SlurmdPort=16918
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/log/slurmctld
SlurmdLogFile=$work/log/slurmd
SlurmdParameters=config_overrides
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=batch_sched_delay=1
JobRequeue=1
KillWait=10
ReturnToService=2
MailProg=/bin/true
NodeName=$host NodeAddr=127.0.0.1 CPUs=6 RealMemory=4000 State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
  export SLURM_CONF=$work/slurm.conf
  within 5 test -S "$work/munge/socket"
  slurmctld -D -f "$SLURM_CONF" >"$work/log/slurmctld.out" 2>&1 &
  daemons+=($!)
  slurmd -D -f "$SLURM_CONF" >"$work/log/slurmd.out" 2>&1 &
  daemons+=($!)
  within 15 is_node idle
}
is_node() { [[ $(sinfo -h -o %t 2>/dev/null) == "$1"* ]]; }

# --- jobs ------------------------------------------------------------------------------------------------------------

eulerfsi() { "$work/eulerfsi" "$@"; }
submit() { # NAME OPTIONS...: writes NAME.sh for the cache or wedge NAME, in the work folder
  eulerfsi submit "$scene" --slurm "$work/$1.sh" -o "$work/$1" --program "$work/eulerfsi" --threads 1 "${@:2}" >/dev/null
}
facts() { scontrol show --oneliner job "$1" 2>/dev/null | sed -n "s/.*\<$2=\([^ ]*\).*/\1/p"; } # JOB NAME
is() { # JOB STATE: of every task of an array
  local states
  states=$(facts "$1" JobState | sort -u)
  [[ $states != *FAILED* && $states != *CANCELLED* && $states != *TIMEOUT* ]] || fail "job $1 ended as $states"
  [[ $states == "$2" ]]
}
has_frame() { [[ -n $(ls "$work/$1"/frames/*."$2".* 2>/dev/null) ]]; } # CACHE FRAME
is_requeued() { [[ $(facts "$1" Restarts) == 1 && $(facts "$1" JobState) == PENDING ]]; }
go_on() { # JOB: a job that was requeued waits two minutes otherwise
  within "$most" is_requeued "$1"
  scontrol update JobId="$1" StartTime=now
}
same() { # CACHE: has the content hashes of the run left alone
  "$root/.venv/bin/python" - "$work/alone" "$work/$1" <<'PY'
import json, sys
alone, other = (
    {number: [frame["state"], [facts["content"] for facts in frame["files"].values()]]
     for number, frame in json.load(open(f"{folder}/manifest.json"))["frames"].items()}
    for folder in sys.argv[1:]
)
sys.exit(0 if alone and alone == other else f"{sys.argv[2]}: other content hashes than those of a run left alone")
PY
}

cat >"$work/eulerfsi" <<PROGRAM
#!/bin/bash
export PYTHONPATH=$root/batch:$root/usd_plugin EULERFSI_LIBRARY=${EULERFSI_LIBRARY:-$root/build/release/libeulerfsi/libeulerfsi.so}
export OMP_WAIT_POLICY=passive
exec env --block-signal=HUP,INT,TERM $root/.venv/bin/python -m eulerfsi "\$@"
PROGRAM
chmod +x "$work/eulerfsi"
scene=$root/examples/scenes/ball.usda
coarse=(--set Domain.voxelSize=0.05)
frames=1-96

start_daemons
passed "daemons"
submit alone "${coarse[@]}" --frames $frames
for name in signalled requeued down; do sed "s|$work/alone|$work/$name|g" "$work/alone.sh" >"$work/$name.sh"; done
submit limit "${coarse[@]}" --frames 1-100000
submit wedge "${coarse[@]}" --frames 1-3 --vary Ball.youngsModulus=1e4,4e4

# The time limit of a minute, a signal when 50 seconds are left: SLURM looks every 30 seconds.
limit=$(sbatch --parsable --time=1 --signal=B:TERM@50 "$work/limit.sh")
signalled=$(sbatch --parsable "$work/signalled.sh")
requeued=$(sbatch --parsable "$work/requeued.sh")

within "$most" has_frame signalled 0002
scancel --signal=TERM --batch "$signalled"
within "$most" has_frame requeued 0002
scontrol requeue "$requeued"
go_on "$signalled"
passed "a signal: checkpoint, 75, requeued"
go_on "$requeued"
array=$(sbatch --parsable "$work/wedge.sh")
eulerfsi simulate "$scene" "${coarse[@]}" --frames $frames -o "$work/alone" --progress none >/dev/null
within "$most" is "$array" COMPLETED
[[ $(ls "$work"/wedge/*/manifest.json | wc -l) == 2 ]] || fail "the array has left $(ls "$work/wedge")"
passed "an array"
within "$most" is "$signalled" COMPLETED
same signalled
within "$most" is "$requeued" COMPLETED
same requeued
passed "requeued jobs have the bits of one left alone"

within "$most" is_requeued "$limit"
scancel "$limit"
grep -q "not done yet" "$work"/limit.slurm-*.log || fail "the time limit came without a word"
if has_frame limit 0001; then # on a very busy machine the signal comes while it starts
  code=0
  eulerfsi verify "$work/limit" >/dev/null || code=$?
  [[ $code == 75 ]] || fail "verify of a run stopped at its time limit ends with $code, not 75"
fi
passed "the signal before the time limit: an intact cache, 75"

down=$(sbatch --parsable "$work/down.sh")
within "$most" has_frame down 0002
scontrol update NodeName="$host" State=DOWN Reason=test
go_on "$down"
grep -q "JobId=$down due to failure of node" "$work/log/slurmctld" || fail "the node did not fail"
within "$most" is "$down" COMPLETED
same down
passed "a node that went down"
