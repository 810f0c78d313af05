#!/usr/bin/env bash
# Purpose: jobs of `submit --slurm` against a slurmctld and a slurmd of this machine: an array, a signal before the time
# limit, a signal, a requeue, a node that goes down. What was stopped ends with the content hashes of a run left alone.
#
# As root, with Debian's slurmctld, slurmd, slurm-client and munge; without them it says so and ends with 0, or with 1
# where EFSI_NEED_SLURM is set. Takes less than a minute on a quiet machine. Daemons are ended by their process ids,
# whatever happens.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# shellcheck source=tests/slurm_machine.sh
source "$root/tests/slurm_machine.sh"
if ! has_slurm; then
  echo "skipped: no SLURM"
  [[ -z ${EFSI_NEED_SLURM-} ]]
  exit
fi
work=$(mktemp -d /tmp/efsi-slurm-XXXXXX)
leave() {
  local code=$?
  [[ $code == 0 ]] || tail -n 20 "$work"/*.slurm-*.log "$work"/log/* >&2 || true
  stop_machine
  rm -rf "$work"
  exit "$code"
}
trap leave EXIT
trap 'exit 143' TERM
trap 'exit 130' INT

begun=$SECONDS
passed() { echo "ok: $* ($((SECONDS - begun)) s)"; }

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
is_requeued() { [[ $(facts "$1" Restarts) -gt 0 && $(facts "$1" JobState) == PENDING ]]; }
go_on() { # JOB: a job that was requeued waits two minutes otherwise
  within "$most" is_requeued "$1"
  scontrol update JobId="$1" StartTime=now+3seconds # a node refuses the job in the second in which it ended
}
is_done() { # JOB: it is; where its node failed again, as SLURM still ends the old run on the node that is back, it goes on
  ! is_requeued "$1" || scontrol update JobId="$1" StartTime=now
  is "$1" COMPLETED
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

start_machine
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
crash_node
within "$most" is_requeued "$down"
start_node
go_on "$down"
grep -q "JobId=$down due to failure of node" "$work/log/slurmctld" || fail "the node did not fail"
within "$most" is_done "$down"
same down
passed "a node that went down"
