# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash
# Functions for scripts that try something in a clean Debian 12. Read it with `source`.

# The mirrors of this machine, as lines of sources.list.
apt_sources() {
  apt-get indextargets --format 'deb $(REPO_URI) $(RELEASE) $(COMPONENT)' "Created-By: Packages" "Origin: Debian" |
    sort -u | grep -E ' bookworm(-updates|-security)? '
}

# Prints the path of an archive with a minimal Debian 12. The first call downloads it; later ones take it from the cache.
clean_base() {
  local cache=${XDG_CACHE_HOME:-$HOME/.cache}/emit/bookworm-minbase.tar.zst
  if [[ ! -f $cache ]]; then
    local mirror made
    # This runs inside a substitution too, where bash goes on after a failure.
    mirror=$(apt_sources | awk '$3 == "bookworm" {print $2; exit}') && [[ -n $mirror ]] ||
      { echo "apt has no source of Debian 12" >&2; return 1; }
    made=$(mktemp -d) || return 1
    debootstrap --variant=minbase --include=ca-certificates bookworm "$made" "$mirror" >"$made.log" 2>&1 ||
      { tail -n 5 "$made.log" >&2; return 1; }
    mkdir -p "$(dirname "$cache")" || return 1
    tar -C "$made" --one-file-system -c . | zstd -q -f -T0 -o "$cache.part" || return 1
    mv "$cache.part" "$cache" || return 1
    rm -rf --one-file-system "$made" "$made.log"
  fi
  printf '%s\n' "$cache"
}

# The settings of apt without which the mirrors of this machine do not answer: proxies, and snapshots of old lists.
apt_settings() {
  apt-config dump | grep -E '^Acquire::(Check-Valid-Until|Check-Date|http::Proxy|https::Proxy) ' || true
}

# make_clean_system FOLDER: a minimal Debian 12 that uses the mirrors of this machine.
make_clean_system() {
  local base
  base=$(clean_base)
  mkdir -p "$1"
  tar -C "$1" -x --zstd -f "$base"
  # The folder that debootstrap filled was one of mktemp, which users other than root may not enter.
  chmod 755 "$1"
  apt_sources >"$1/etc/apt/sources.list"
  apt_settings >"$1/etc/apt/apt.conf.d/90of-the-host"
  cp /etc/resolv.conf "$1/etc/resolv.conf"
  # No service starts in this system.
  printf '#!/bin/sh\nexit 101\n' >"$1/usr/sbin/policy-rc.d"
  chmod +x "$1/usr/sbin/policy-rc.d"
}

# in_clean_system FOLDER COMMAND...: runs a command there, with processes and mounts of its own.
in_clean_system() {
  local system=$1
  shift
  # shellcheck disable=SC2016 # the inner shell expands these
  unshare --mount --pid --fork --kill-child bash -c '
    system=$1
    shift
    mount -t proc proc "$system/proc"
    mount -t tmpfs shm "$system/dev/shm" 2>/dev/null || { mkdir -p "$system/dev/shm"; mount -t tmpfs shm "$system/dev/shm"; }
    mount -t tmpfs run "$system/run"
    exec env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 chroot "$system" "$@"' sh "$system" "$@"
}
