#!/usr/bin/env bash
# Purpose: does the wheel install and simulate where nothing is but Python? Makes bare roots of Debian, installs the wheel there
# and compares the state hashes of two scenes with those of the library of this checkout. Needs root and mmdebstrap.
# Usage: tests/checks/wheel.sh [WHEEL]   (default: makes one)
# Environment: SUITES (bookworm trixie forky: Python 3.11, 3.13 and, of the distribution to come, 3.14), EULERFSI_LIBRARY (build/release), KEEP=1, TMPDIR.
set -euo pipefail
repo=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
# shellcheck source=tests/checks/bare_root.sh
source "$repo/tests/checks/bare_root.sh"
export PYTHONPATH=$repo/batch:$repo/usd_plugin
python=$repo/.venv/bin/python
scenes="ball heap"
frames=1-3

hashes() { # CACHE: the state hash of every frame
  "$python" -c 'import json, sys
for frame, facts in json.load(open(sys.argv[1] + "/manifest.json"))["frames"].items(): print(frame, facts["state"])' "$1"
}

wheel=${1:-$("$python" -m eulerfsi package wheel -o "$work")}
bytes=$(stat -c %s "$wheel")
notices=$("$python" -m zipfile -l "$wheel" | grep -c '/licenses/bundled/')
echo "$(basename "$wheel"): $bytes bytes, notices of $notices packages"
[[ $bytes -le 20000000 && $notices -gt 0 ]]

for scene in $scenes; do
  "$python" -m eulerfsi simulate "$repo/examples/scenes/$scene.usda" --frames $frames --progress none -o "$work/here_$scene"
done
status=0
for suite in ${SUITES:-bookworm trixie forky}; do
  root=$work/$suite
  make_root "$suite" "$root" python3,python3-venv
  mkdir "$root/srv/wheel"
  cp "$wheel" "$root/srv/wheel/"
  cp -r "$repo/examples" "$root/srv/"
  run_in "$root" /srv "python3 -m venv venv && venv/bin/pip install --quiet wheel/*.whl && venv/bin/eulerfsi info" || status=1
  for scene in $scenes; do
    run_in "$root" /srv "venv/bin/eulerfsi simulate examples/scenes/$scene.usda --frames $frames --progress none -o $scene" &&
      diff <(hashes "$work/here_$scene") <(hashes "$root/srv/$scene") &&
      echo "$suite: $scene: the same bits" || status=1
  done
  [[ ${KEEP-} ]] || rm -rf --one-file-system "$root"
done
exit "$status"
