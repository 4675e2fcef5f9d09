#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Tries the packages of a folder in a clean Debian 12: installs packages of a lower version, upgrades, runs the tool, the
# daemon as its user with its installed configuration, a C++ and a Python client, then purges and looks for what is left.
# Usage, as root: try_packages.sh FOLDER [--keep]
#   FOLDER   has the .deb files
#   --keep   leaves the tried system in place and prints its path
# The base system comes from the sources of apt on this machine, by debootstrap, and is kept in the user's cache.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
# shellcheck source=deploy/scripts/clean_system.sh
source "$root/deploy/scripts/clean_system.sh"

if [[ $# -lt 1 || ! -d $1 || $(id -u) -ne 0 ]]; then
  echo "usage, as root: try_packages.sh FOLDER [--keep]" >&2
  exit 2
fi
folder=$(cd "$1" && pwd)
keep=false
if [[ ${2:-} == --keep ]]; then keep=true; fi
version=$(<"$root/version.txt")
packages=(emitd emit-tools emit-data emit-doc libemit-client-dev python3-emit-client)

work=$(mktemp -d)
system=$work/system
end() {
  local code=$?
  if $keep; then echo "try_packages: kept $system"; else rm -rf --one-file-system "$work"; fi
  if ((code == 0)); then echo "try_packages: all steps passed"; else echo "try_packages: FAILED ($code)"; fi
}
trap end EXIT
say() { printf '== %s  %s\n' "$(date +%T)" "$*"; }

say "clean system"
make_clean_system "$system"
mkdir -p "$system/packages/new" "$system/packages/old"
files=()
for package in "${packages[@]}"; do
  file=$(compgen -G "$folder/${package}_${version}_*.deb") ||
    { echo "try_packages: $folder has no $package of version $version" >&2; exit 1; }
  cp "$file" "$system/packages/new/"
  files+=("$(basename "$file")")
done

say "packages of a lower version, made from these"
lower=0.0.9
for file in "${files[@]}"; do
  dpkg-deb -R "$system/packages/new/$file" "$work/unpacked"
  sed -i "s/^Version: .*/Version: $lower/; s/(= $version)/(= $lower)/g" "$work/unpacked/DEBIAN/control"
  if [[ -f $work/unpacked/etc/emitd/emitd.toml ]]; then
    # An older version had another default, so that the upgrade meets a changed file.
    sed -i 's/^level = .*/level = "debug"/' "$work/unpacked/etc/emitd/emitd.toml"
  fi
  dpkg-deb --root-owner-group -Znone -b "$work/unpacked" "$system/packages/old/${file/_${version}_/_${lower}_}" >/dev/null
  rm -rf "$work/unpacked"
done

cat >"$system/programs.sh" <<'PROGRAMS'
# This part runs in a network of its own, so that the ports of its daemons cannot meet those of others.
set -euo pipefail
say() { printf '== %s  %s\n' "$(date +%T)" "$*"; }
quiet() { "$@" >/tmp/log 2>&1 || { cat /tmp/log; return 1; }; }
fail() { echo "FAILED: $*"; exit 1; }
ip link set lo up

say "emit doctor"
emit doctor || fail "emit doctor finds a failure"

say "emit render of a shipped scene"
cd /tmp
time emit render box --time-s 0 --out box.exr --png box.png
ls -l box.exr box.png

say "the daemon as its user with the installed configuration"
as_emitd=(setpriv --reuid emitd --regid emitd --init-groups)
cd /var/lib/emitd
"${as_emitd[@]}" emitd --config /etc/emitd/emitd.toml --check
"${as_emitd[@]}" emitd --config /etc/emitd/emitd.toml >/tmp/emitd.log 2>&1 &
daemon=$!
for attempt in $(seq 900); do
  if grep -q "ready control=" /tmp/emitd.log; then break; fi
  kill -0 $daemon 2>/dev/null || { cat /tmp/emitd.log; fail "the daemon ended"; }
  sleep 1
done
emit receive tcp://127.0.0.1:7000 --frames 3 --timeout-s 600 --out /tmp/frames >/tmp/receive.log 2>&1 &
receiver=$!
sleep 2
emit send /usr/share/emit/logs/airfield.mcap --to tcp://127.0.0.1:7000 --step --frames 3 --timeout-s 600
wait $receiver || { cat /tmp/receive.log /tmp/emitd.log; fail "emit receive"; }
tail -n 5 /tmp/receive.log
ls -l /tmp/frames | head -n 4
[[ $(stat -c %U /proc/$daemon) == emitd ]] || fail "the daemon runs as $(stat -c %U /proc/$daemon)"
kill -TERM $daemon
wait $daemon || fail "the daemon ends with $?"

say "a C++ client and a Python client, as the tutorial has them"
emitd --config /usr/share/emit/profiles/canned.toml --set pacing.mode=host-step >/tmp/canned.log 2>&1 &
daemon=$!
mkdir -p /tmp/client && cd /tmp/client
page=/usr/share/doc/emit-doc/deploy/docs/tutorials/client.md
snippet() { awk -v lang="\`\`\`$1" '$0 == lang {on = 1; next} /^```$/ {if (on) exit} on' $page; }
snippet cmake >CMakeLists.txt
snippet cpp >main.cpp
snippet py >client.py
quiet cmake -B build -DCMAKE_BUILD_TYPE=Release
quiet cmake --build build
build/my_client tcp://127.0.0.1:7000 | tee /tmp/cpp.log
/usr/bin/python3 client.py tcp://127.0.0.1:7000 | tee /tmp/python.log
[[ $(grep -c "^frame" /tmp/cpp.log) == 5 && $(grep -c "^frame" /tmp/python.log) == 5 ]] || fail "frames are missing"
kill -TERM $daemon
wait $daemon
PROGRAMS

cat >"$system/trial.sh" <<'TRIAL'
set -euo pipefail
export DEBIAN_FRONTEND=noninteractive
version=$1
say() { printf '== %s  %s\n' "$(date +%T)" "$*"; }
quiet() { "$@" >/tmp/log 2>&1 || { cat /tmp/log; return 1; }; }
listing() {
  find /etc /usr /lib /opt /srv /var -xdev \( -path /var/cache -o -path /var/log -o -path /var/lib/dpkg -o \
    -path /var/lib/apt \) -prune -o -print | sort
}
installed_version() { dpkg-query -W -f='${Version} ${Status}' "$1"; }
fail() { echo "FAILED: $*"; exit 1; }

quiet apt-get update -q
# What the packages depend on stays out of the comparison of files before and after: it is installed first.
say "dependencies"
depends=$(apt-get install -s --no-install-recommends /packages/new/*.deb | awk '/^Inst / && !/emit/ {print $2}')
quiet apt-get install -q -y --no-install-recommends $depends libgl1-mesa-dri iproute2 g++ cmake make
listing >/tmp/before

say "install of $(ls /packages/old | tr '\n' ' ')"
quiet apt-get install -q -y --no-install-recommends /packages/old/*.deb
[[ $(installed_version emitd) == "0.0.9 install ok installed" ]] || fail "the lower version is not installed"
sed -i 's/^udp = .*/&  # changed by the operator/' /etc/emitd/emitd.toml
install -d -o emitd -g emitd -m 700 /var/lib/emitd
setpriv --reuid emitd --regid emitd --clear-groups touch /var/lib/emitd/journal.mcap

say "upgrade to $version"
quiet apt-get install -q -y --no-install-recommends -o Dpkg::Options::=--force-confold /packages/new/*.deb
for package in emitd emit-tools emit-data emit-doc libemit-client-dev python3-emit-client; do
  [[ $(installed_version $package) == "$version install ok installed" ]] || fail "$package is not upgraded"
done
grep -q "changed by the operator" /etc/emitd/emitd.toml || fail "the operator's configuration is lost"
[[ -f /etc/emitd/emitd.toml.dpkg-dist ]] || fail "the new configuration is not beside the operator's"
[[ -f /var/lib/emitd/journal.mcap ]] || fail "the upgrade took the journal"
mv /etc/emitd/emitd.toml.dpkg-dist /etc/emitd/emitd.toml
id emitd
emitd --version
emit --version
emit-lab --version
[[ $(emitd --version) == "emitd $version "* && $(emit --version) == "emit $version "* ]] || fail "wrong version"
for page in man1/emit.1 man1/emit-render.1 man8/emitd.8; do
  [[ -s /usr/share/man/$page.gz ]] || fail "no manual page $page"
done
[[ -s /usr/share/bash-completion/completions/emit ]] || fail "no completion"

say "programs"
unshare --net bash /programs.sh

if command -v systemd-analyze >/dev/null; then
  say "the unit"
  # The pages were looked for above; the clean system has no program that shows them.
  systemd-analyze verify --man=no /lib/systemd/system/emitd.service || fail "systemd-analyze verify"
  systemd-analyze security --offline=true --no-pager emitd.service | tail -n 1
fi

say "purge"
quiet apt-get purge -q -y emitd emit-tools emit-data emit-doc libemit-client-dev python3-emit-client
listing >/tmp/after
left=$(comm -13 /tmp/before /tmp/after)
gone=$(comm -23 /tmp/before /tmp/after)
printf 'left behind:\n%s\ntaken away:\n%s\n' "$left" "$gone"
# Backups of the user data base are adduser's and systemd-sysusers' own. The user stays, as Debian recommends.
left=$(grep -vE '^(/etc/(passwd|group|shadow|gshadow)-?)$' <<<"$left" || true)
[[ -z $left && -z $gone ]] || fail "the purge left something behind or took too much away"
TRIAL

say "trial"
in_clean_system "$system" bash /trial.sh "$version"
