#!/usr/bin/env bash
# Purpose: compares the C ABI of the built library with the baseline in libeulerfsi/abi, or writes that baseline.
# Usage: tests/checks/abi.sh check|write [LIBRARY]. New functions pass, and so does a struct that has grown at its end,
# which old clients do not notice; a removed function or any other change of a struct fails (exit 1). Written again for
# a release.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
library=${2-$root/build/release/libeulerfsi/libeulerfsi.so}
baseline=$root/libeulerfsi/abi/eulerfsi-0.abi

growth='^ *$|changes summary: 0 Removed|some indirect sub-type changes?:$'
growth+="|(parameter [0-9]+ of|return) type .* has sub-type changes:$"
growth+="|in (pointed to|unqualified underlying) type '.*:$"
growth+="|underlying type 'struct .* changed(:$|; details (are|were) )"
growth+="|details (are|were|were being) reported (later|earlier)"
growth+="|type size changed from|data member insertions?:$|^ +'.*', at offset [0-9]+ \(in bits\)"

describe() { # FILE: the functions and the types of the public headers; what stands behind opaque types is left out
  abidw --exported-interfaces-only --no-show-locs --no-corpus-path --no-comp-dir-path \
    --headers-dir "$root/libeulerfsi/include" --drop-private-types "$library" --out-file "$1"
}

case "${1-}" in
  write)
    mkdir -p "$(dirname "$baseline")"
    describe "$baseline"
    echo "wrote $baseline"
    ;;
  check)
    [[ -f $baseline ]] || { echo "$baseline is missing; write it with: $0 write"; exit 1; }
    current=$(mktemp)
    trap 'rm -f "$current"' EXIT
    describe "$current"
    # abidiff's code calls a changed struct "maybe harmless" (4). All that may stand in its report are members inserted
    # into structs whose other members keep their places; a suppression of these would hide what else becomes of such a
    # struct.
    code=0
    report=$(abidiff --no-added-syms "$baseline" "$current") || code=$?
    if ((code & ~4)) || grep -vE "$growth" <<<"$report"; then
      echo "$report"
      echo "the C ABI changed. If that is meant: a CHANGELOG line, '$0 write', and another SOVERSION once 1.0 is out"
      exit 1
    fi
    echo "C ABI: compatible with $(basename "$baseline")"
    ;;
  *)
    echo "usage: $0 check|write [LIBRARY]"
    exit 2
    ;;
esac
