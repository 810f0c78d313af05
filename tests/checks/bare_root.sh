# Purpose: roots of Debian with nothing but apt, for checks that source this file. Needs root and mmdebstrap.

[[ $(id -u) == 0 ]] || { echo "needs root (chroot)"; exit 2; }
command -v mmdebstrap >/dev/null || { echo "needs mmdebstrap: apt-get install mmdebstrap"; exit 2; }

work=$(mktemp -d "${TMPDIR:-/tmp}/bare_root.XXXXXX")
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

make_root() { # SUITE TARGET PACKAGE,...: settings of the network in the array `settings`
  local suite=$1 target=$2 start=$SECONDS files=() sources=() file name value
  mapfile -t files < <(list_sources)
  for file in ${files[@]+"${files[@]}"}; do # the same mirrors for every suite
    name=$work/$suite-$(basename "$file")
    sed -E "s/\b(bookworm|trixie)\b/$suite/g" "$file" >"$name"
    sources+=("$name")
  done
  [[ ${#sources[@]} -gt 0 ]] || sources=("deb http://deb.debian.org/debian $suite main")
  # https mirrors need certificates
  mmdebstrap --quiet --mode=root --variant=minbase --include="ca-certificates,$3" --aptopt="$work/apt.conf" \
    "$suite" "$target" "${sources[@]}" 2>&1 | grep -v '^I:' || [[ ${PIPESTATUS[0]} == 0 ]]
  echo "root of $suite: $((SECONDS - start)) s, $(du -sm "$target" | cut -f1) MB"

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
}

run_in() { # ROOT FOLDER COMMAND: its last lines and its exit code
  local start=$SECONDS rc=0
  echo "--- $3"
  # an own mount name space: /proc is there during the command and gone with it
  unshare --mount --pid --fork --kill-child chroot "$1" /usr/bin/env -i HOME=/root LANG=C.UTF-8 TERM=dumb \
    PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin ${settings[@]+"${settings[@]}"} \
    bash -c "mount -t proc proc /proc; cd $2 && $3" </dev/null >"$work/log" 2>&1 || rc=$?
  tail -n "${LINES_SHOWN:-15}" "$work/log"
  echo "--- exit code $rc after $((SECONDS - start)) s: $3"
  return "$rc"
}
