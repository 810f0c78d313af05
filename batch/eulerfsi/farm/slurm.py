"""`submit --slurm FILE`: a batch script for sbatch; a wedge is an array."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Sequence
from pathlib import Path

from .. import files
from ..errors import CacheIOError, UsageError
from . import wedge
from .submission import Submission

SIGNAL_SECONDS = 120  # before the time limit: SIGTERM, for a checkpoint
SHORTEST = 300  # seconds: with less, the signal, which may be a minute early, leaves no time to get on

# The signal comes to this shell alone (B:), which hands it on and waits for the checkpoint.
_FUNCTIONS = """\
child=
trap '[[ -z $child ]] || kill -TERM "$child" 2>/dev/null' TERM

run() { # COMMAND...: ends with its code, also where a signal comes while the shell waits
  local code=0
  "$@" &
  child=$!
  wait "$child" || code=$?
  while kill -0 "$child" 2>/dev/null; do
    code=0
    wait "$child" || code=$?
  done
  child=
  return "$code"
}

again_if() { # CODE: not done yet, or stopped by a signal: the job goes back to the queue
  [[ $1 == 75 || $1 == 143 ]] || return 0
  echo "not done yet: to be run again"
  scontrol requeue "${SLURM_ARRAY_JOB_ID:+${SLURM_ARRAY_JOB_ID}_}${SLURM_ARRAY_TASK_ID:-$SLURM_JOB_ID}"
  exit 75
}
"""
_STEPS = """\
code=0
how=(--resume --allow-restart --requeue-on-signal --progress plain)
run "${program[@]}" simulate "${scene[@]}" -o "$cache" "${how[@]}" || code=$?
again_if $code
[[ $code == 0 ]] || exit $code
run "${program[@]}" verify "$cache" || code=$?
again_if $code
exit $code
"""


def write_script(path: Path, job: Submission, program: Sequence[str], seconds: int | None) -> Path:
    """Writes the script. program: words of the command on a node; seconds: time limit of a task.

    seconds None: the limit of the partition.
    Raises UsageError for a folder that sbatch cannot write a log beside, MismatchError for one of another wedge.
    """
    log = f"{str(job.folder).replace('%', '%%')}.slurm-{'%A_%a' if job.jobs else '%j'}.log"
    if any(character.isspace() or character in "\"'\\" for character in log):
        raise UsageError(
            f"submit --slurm: {job.folder}: must have no space, quote or backslash in it: logs go beside it"
        )
    if seconds is not None and seconds < SHORTEST:
        raise UsageError(f"submit --slurm: --timeout {seconds}: must be at least {SHORTEST} seconds")
    made = job.folder if job.jobs else job.folder.parent
    try:
        made.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CacheIOError(f"{made}: cannot be made: {error.strerror}") from error
    if job.jobs:  # `wedge --resume` on the folder makes table and contact sheet of what the array has left
        wedge.prepare(job.folder, job.scene, job.jobs, job.attributes, dataclasses.replace(job.options, resume=True))
    options = [f"--job-name={job.name}", f"--output={log}", "--open-mode=append", "--requeue"]
    options += [f"--array=1-{len(job.jobs)}"] if job.jobs else []
    options += [f"--cpus-per-task={job.options.threads or 1}", f"--mem={-(-job.memory // 2**20)}M"]
    options += [f"--signal=B:TERM@{SIGNAL_SECONDS}", *([f"--time={-(-seconds // 60)}"] if seconds else [])]
    maps = [f"--path-map={rule}" for rule in job.options.path_map]
    scene = shlex.join([str(job.scene), f"--frames={job.frames}", *job.fixed(), *maps, *job.settings()])
    lines = ["#!/bin/bash", *(f"#SBATCH {option}" for option in options), _FUNCTIONS, *_tasks(job)]
    lines += [
        f"program=({shlex.join(program)})",
        f'scene=({scene} "${{values[@]}}" --threads "${{SLURM_CPUS_PER_TASK:-1}}")',
        _STEPS,
    ]
    files.write_text(path, "\n".join(lines))
    path.chmod(0o755)
    return path


def _tasks(job: Submission) -> list[str]:
    """Lines that set the cache and the values of this task."""
    if not job.jobs:
        return [f"cache={shlex.quote(str(job.folder))} values=()"]
    lines = ["case $SLURM_ARRAY_TASK_ID in"]
    for number, one in enumerate(job.jobs, 1):
        values = shlex.join([word for setting in one.settings() for word in ("--set", setting)])
        lines.append(f"  {number}) cache={shlex.quote(str(job.folder / one.folder))} values=({values}) ;;")
    return [*lines, '  *) echo "no task $SLURM_ARRAY_TASK_ID in this wedge" >&2; exit 2 ;;', "esac"]
