#!/usr/bin/env bash
# Purpose: Deadline Cloud's own library reads, offline, the bundles of `submit --openjd`: parameters, values, assets.
# Needs the network for pip, once; the library goes to build/deadline, since its packages do not go with those of .venv.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
version=0.60.10
python=$root/build/deadline/bin/python
if [[ $("$python" -m pip list 2>/dev/null) != *"deadline "*"$version"* ]]; then
  rm -rf "$root/build/deadline"
  "$root/.venv/bin/python" -m venv "$root/build/deadline"
  "$python" -m pip install --quiet --disable-pip-version-check "deadline==$version"
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export PYTHONPATH=$root/batch:$root/usd_plugin
scene=$root/examples/scenes/ball.usda
submit() { "$root/.venv/bin/python" -m eulerfsi submit "$scene" --set Domain.voxelSize=0.05 -o "$work/out" "$@" >/dev/null; }
submit --openjd "$work/one" --threads 2 --parameter deadline:priority=70
submit --openjd "$work/wedge" --vary Ball.youngsModulus=1e4,4e4 --vary Ball.density=500,1000,2000
unset PYTHONPATH
"$python" - "$work" "$scene" <<'PY'
import sys

from deadline.client.job_bundle.loader import is_job_bundle_dir, read_yaml_or_json_object
from deadline.client.job_bundle.parameters import apply_job_parameters, read_job_bundle_parameters
from deadline.client.job_bundle.submission import AssetReferences

work, scene = sys.argv[1:]
for name in ("one", "wedge"):
    bundle = f"{work}/{name}"
    assert is_job_bundle_dir(bundle), bundle
    found = {one["name"]: one for one in read_job_bundle_parameters(bundle)}
    assert found["Scene"]["value"] == scene and found["Scene"]["dataFlow"] == "IN", found
    assert found["OutputFolder"]["value"] == f"{work}/out" and found["OutputFolder"]["dataFlow"] == "OUT", found
    assert ("Threads" in found) == (name == "one"), found
    references = read_yaml_or_json_object(bundle_dir=bundle, filename="asset_references", required=True)
    assets = AssetReferences.from_dict(references)
    assert assets.input_filenames == {scene} and assets.output_directories == {f"{work}/out"}, assets
    before = len(assets.input_filenames)
    apply_job_parameters([], bundle, list(found.values()), assets)
    assert len(assets.input_filenames) == before, assets  # the scene was known already
print("ok: Deadline Cloud's library reads two bundles")
PY
