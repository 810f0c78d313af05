#!/usr/bin/env bash
# Purpose: a SLURM of this machine alone, for tests: one node, without systemd, as root. Sourced, it has the functions;
# run with a folder, it starts the daemons, says "ready", and ends them when standard input does or at a signal.
#
# $work: folder of all files. Daemons are ended by their process ids, and with them what they have left.
host=$(hostname -s)
daemons=()

has_slurm() {
  [[ $(id -u) == 0 ]] && { command -v slurmctld && command -v slurmd && command -v munged && command -v sbatch; } >/dev/null
}

fail() {
  echo "slurm: $*" >&2
  exit 1
}

most=120 # seconds for one step on a busy machine
within() { # SECONDS COMMAND...: until the command succeeds
  local until=$((SECONDS + $1))
  shift
  until "$@"; do
    ((SECONDS < until)) || fail "not in time: $*"
    sleep 0.2
  done
}

start_machine() {
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
  within "$most" test -S "$work/munge/socket"
  slurmctld -D -f "$SLURM_CONF" >"$work/log/slurmctld.out" 2>&1 &
  daemons+=($!)
  start_node
}
start_node() {
  slurmd -D -f "$SLURM_CONF" >>"$work/log/slurmd.out" 2>&1 &
  node=$!
  daemons+=($node)
  within "$most" is_node idle
}
crash_node() { # the node's daemon and its jobs are gone without a word, as when it loses power
  local ours
  kill -9 "$node"
  wait "$node" 2>/dev/null || true
  ours=$(printf '%s,' "${daemons[@]}")
  # shellcheck disable=SC2046
  kill_others $$ "$PPID" "${daemons[@]}" $(pgrep --parent "${ours%,}") # slurmctld runs its scripts in a child
  scontrol update NodeName="$host" State=DOWN Reason=crash
}
is_node() { [[ $(sinfo -h -o %t 2>/dev/null) == "$1"* ]]; }

stop_machine() {
  local pid i
  scancel --quiet --user=root >/dev/null 2>&1 || true
  for ((i = ${#daemons[@]} - 1; i >= 0; i--)); do # slurmd first: it ends the jobs
    kill "${daemons[i]}" 2>/dev/null || true
  done
  for pid in "${daemons[@]}"; do
    for _ in $(seq 30); do kill -0 "$pid" 2>/dev/null && sleep 0.1 || break; done
    kill -9 "$pid" 2>/dev/null || true
  done
  kill_others $$ "$PPID"
}
kill_others() { # PID...: what has files of the work folder open, but for these processes
  local pid
  for pid in $(find /proc/[0-9]*/fd -lname "$work/*" 2>/dev/null | cut -d / -f 3 | sort -u); do
    [[ " $* " == *" $pid "* ]] || kill -9 "$pid" 2>/dev/null || true
  done
}

if [[ ${BASH_SOURCE[0]} == "$0" ]]; then
  set -euo pipefail
  work=$1
  has_slurm || fail "no SLURM"
  trap stop_machine EXIT
  trap 'exit 143' TERM
  trap 'exit 130' INT
  start_machine
  echo ready
  while read -r _; do :; done
fi
