#!/usr/bin/env bash
# Purpose: compares the C ABI of the built library with the baseline in libeulerfsi/abi, or writes that baseline.
# Usage: tests/checks/abi.sh check|write [LIBRARY]. New functions pass; a removed function or a changed struct fails (exit 1),
# also one that has grown at its end, which old clients do not notice: write the baseline again.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
library=${2-$root/build/release/libeulerfsi/libeulerfsi.so}
baseline=$root/libeulerfsi/abi/eulerfsi-0.abi

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
    # abidiff's code calls a changed struct "maybe harmless" (4); here every change but a new function counts
    if ! abidiff --no-added-syms "$baseline" "$current"; then
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
