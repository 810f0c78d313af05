#!/usr/bin/env bash
# Purpose: the Blender extension in a real window: Debian 13's Blender (4.3.2, Python 3.13) in a root of its own, under Xvfb with
# OpenGL by software. clicks.py presses the buttons as a hand would; pictures of the screen lie in build/window, and the one in
# docs/blender.md is made of them. By command, never in CI: it downloads 500 MB. Needs root and mmdebstrap.
# Usage: tests/blender/window.sh
# Environment: ROOT, a root of an earlier run; KEEP=1 keeps the root; EULERFSI_LIBRARY (build/release), TMPDIR.
set -euo pipefail
repo=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
# shellcheck source=tests/checks/bare_root.sh
source "$repo/tests/checks/bare_root.sh"
root=${ROOT:-$work/trixie}
settings=()
[[ -d $root ]] || make_root trixie "$root" blender,python3-numpy,xvfb,imagemagick,libgl1-mesa-dri

zip=$("$repo/.venv/bin/python" "$repo/tests/blender/run.py" --package 3.13)
place=$root/srv/window
rm -rf "$place"
mkdir "$place"
cp "$zip" "$place/extension.zip"
cp "$repo/tests/blender/clicks.py" "$place/"
status=0
cat >"$place/run.sh" <<'END'
rm -f /tmp/.X9-lock
Xvfb :9 -screen 0 1280x900x24 &
sleep 2
export DISPLAY=:9 LIBGL_ALWAYS_SOFTWARE=1 BLENDER_USER_RESOURCES=/srv/window/user
timeout 900 blender --factory-startup --enable-event-simulate --window-geometry 0 0 1280 900 --python-exit-code 1 --python clicks.py
END
LINES_SHOWN=40 run_in "$root" /srv/window "bash run.sh" || status=1
mkdir -p "$repo/build/window"
cp "$place"/*.png "$repo/build/window/" || status=1
echo "pictures: $repo/build/window"
[[ $status != 0 ]] || "$repo/.venv/bin/python" "$repo/examples/render/make_window.py" || status=1
exit "$status"
