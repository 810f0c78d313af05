#!/usr/bin/env bash
# Purpose: ./eulerfsi test --blender in other versions of Blender as a Python module. By command, never in CI: it downloads 1.1 GB,
# once. Needs python3.11 and python3.13.
# Usage: tests/blender/versions.sh [NAME...]   (NAME: as of run.py)
# Environment: EULERFSI_LIBRARY (build/release).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
status=0
for pair in 3.11:4.2.23 3.11:4.5.15 3.13:5.3.0; do
  version=${pair#*:}
  place=.eulerfsi/bpy-$version
  if [[ ! -f $place/.ready ]]; then
    rm -rf "$place"
    "python${pair%:*}" -m venv "$place"
    "$place/bin/python" -m pip install --quiet --no-input "bpy==$version"
    touch "$place/.ready"
  fi
  echo "=== Blender $version"
  .venv/bin/python tests/blender/run.py --bpy "$place/bin/python" "$@" || status=1
done
exit "$status"
