#!/usr/bin/env bash
# Purpose: does a fresh machine get from clone to cache with the README's two commands? Makes an empty Debian root, clones this
# checkout's last commit into it and runs them there. Needs root and mmdebstrap; leaves nothing behind.
# Usage: tests/checks/bare_machine.sh [COMMAND...]   (default: the README's two commands, one string each)
# Environment: SUITE (bookworm), KEEP=1 keeps the root, TMPDIR.
set -euo pipefail
repo=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
suite=${SUITE:-bookworm}
commands=("$@")
[[ $# -gt 0 ]] || commands=("./eulerfsi simulate examples/scenes/ball.usda" "./eulerfsi test")

[[ $(id -u) == 0 ]] || { echo "needs root (chroot)"; exit 2; }
command -v mmdebstrap >/dev/null || { echo "needs mmdebstrap: apt-get install mmdebstrap"; exit 2; }

work=$(mktemp -d "${TMPDIR:-/tmp}/bare_machine.XXXXXX")
target=$work/root
# shellcheck disable=SC2317 # called by the trap
cleanup() {
  if [[ ${KEEP-} ]]; then echo "kept: $work"; else rm -rf --one-file-system "$work"; fi
}
trap cleanup EXIT

# Network settings of this machine, handed on as they are: apt's sources and options, pip's, certificates, name servers.
list_sources() { # deb822 files or lists, those that apt itself would read
  find /etc/apt/sources.list /etc/apt/sources.list.d -type f \( -name '*.sources' -o -name 'sources.list' -o -name '*.list' \) \
    2>/dev/null || true
}
apt-config dump | grep -E '^Acquire::(Check-|http|https|Retries)' | grep -v '::$\|""' >"$work/apt.conf" || true
mapfile -t sources < <(list_sources)
[[ ${#sources[@]} -gt 0 ]] || sources=("deb http://deb.debian.org/debian $suite main")

start=$SECONDS
# --include: https mirrors need certificates; git is what a user clones with
mmdebstrap --quiet --mode=root --variant=minbase --include=ca-certificates,git --aptopt="$work/apt.conf" \
  "$suite" "$target" "${sources[@]}" 2>&1 | grep -v '^I:' || [[ ${PIPESTATUS[0]} == 0 ]]
echo "empty root: $((SECONDS - start)) s, $(du -sm "$target" | cut -f1) MB"

cp -L /etc/resolv.conf /etc/hosts "$target/etc/" 2>/dev/null || true
settings=()
hand_on() { # FILE or FOLDER: copied to the same place, never through a link of the new root; its own folders stay
  [[ -f $1 || (-d $1 && ! -e $target$1) ]] || return 0
  mkdir -p "$target$(dirname "$1")"
  cp -rL --remove-destination "$1" "$target$1"
}
hand_on /etc/pip.conf
while IFS='=' read -r name value; do
  settings+=("$name=$value")
  case "$value" in /*) hand_on "$value" ;; esac
done < <(env | grep -E '^(PIP_[A-Z_]+|REQUESTS_CA_BUNDLE|SSL_CERT_FILE|SSL_CERT_DIR|CURL_CA_BUNDLE|[a-zA-Z]+_proxy|[A-Z]+_PROXY)=')

git clone --quiet --no-hardlinks "$repo" "$target/srv/eulerfsi"
echo "commit: $(git -C "$repo" log -1 --format='%h %s')"

status=0
for command in "${commands[@]}"; do
  start=$SECONDS
  echo "--- $command"
  rc=0
  # an own mount name space: /proc is there during the command and gone with it
  unshare --mount --pid --fork --kill-child chroot "$target" /usr/bin/env -i HOME=/root LANG=C.UTF-8 TERM=dumb \
    PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin ${settings[@]+"${settings[@]}"} \
    bash -c 'mount -t proc proc /proc; cd /srv/eulerfsi && '"$command" </dev/null >"$work/log" 2>&1 || rc=$?
  tail -n "${LINES_SHOWN:-15}" "$work/log"
  echo "--- exit code $rc after $((SECONDS - start)) s: $command"
  [[ $rc == 0 ]] || status=1
done
exit "$status"
