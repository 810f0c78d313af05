#!/usr/bin/env bash
# Purpose: does a fresh machine get from clone to cache with the README's two commands? Makes an empty Debian root, clones this
# checkout's last commit into it and runs them there. Needs root and mmdebstrap; leaves nothing behind.
# Usage: tests/checks/bare_machine.sh [COMMAND...]   (default: the README's two commands, one string each)
# Environment: SUITE (bookworm), KEEP=1 keeps the root, TMPDIR.
set -euo pipefail
repo=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
commands=("$@")
[[ $# -gt 0 ]] || commands=("./eulerfsi simulate examples/scenes/ball.usda" "./eulerfsi test")
# shellcheck source=tests/checks/bare_root.sh
source "$repo/tests/checks/bare_root.sh"

make_root "${SUITE:-bookworm}" "$work/bare" git # git is what a user clones with
git clone --quiet --no-hardlinks "$repo" "$work/bare/srv/eulerfsi"
echo "commit: $(git -C "$repo" log -1 --format='%h %s')"
status=0
for command in "${commands[@]}"; do
  run_in "$work/bare" /srv/eulerfsi "$command" || status=1
done
exit "$status"
