#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Tries the service of the packages under a systemd that boots: a clean Debian 12 starts as a container with the service
# enabled. The trial waits until it is ready, takes frames, kills it, stops it, and gives it a wrong configuration.
# Usage, as root: try_service.sh FOLDER
#   FOLDER   has the .deb files
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
# shellcheck source=deploy/scripts/clean_system.sh
source "$root/deploy/scripts/clean_system.sh"
if [[ $# -ne 1 || ! -d $1 || $(id -u) -ne 0 ]]; then
  echo "usage, as root: try_service.sh FOLDER" >&2
  exit 2
fi
command -v systemd-nspawn >/dev/null || { echo "try_service: systemd-nspawn is not installed" >&2; exit 1; }
version=$(<"$root/version.txt")
work=$(mktemp -d)
system=$work/system
end() {
  local code=$?
  rm -rf --one-file-system "$work"
  if ((code == 0)); then echo "try_service: all steps passed"; else echo "try_service: FAILED ($code)"; fi
}
trap end EXIT
say() { printf '== %s  %s\n' "$(date +%T)" "$*"; }

say "clean system with the packages"
make_clean_system "$system"
mkdir "$system/packages"
for package in emitd emit-tools emit-data; do
  cp "$1/${package}_${version}"_*.deb "$system/packages/"
done
in_clean_system "$system" bash -c '
  set -e
  export DEBIAN_FRONTEND=noninteractive
  apt-get update -q
  apt-get install -q -y --no-install-recommends systemd-sysv dbus libgl1-mesa-dri /packages/*.deb' >"$work/log" 2>&1 ||
  { tail -n 20 "$work/log" >&2; exit 1; }
# Take a scene whose surface is ready in seconds, and enable the service as an operator does.
sed -i 's/^scenario = .*/scenario = "box"/' "$system/etc/emitd/emitd.toml"
printf '\n[source]\nfirst_time_s = 12600.0\n' >>"$system/etc/emitd/emitd.toml"
in_clean_system "$system" systemctl enable emitd >/dev/null 2>&1

cat >"$system/trial.sh" <<'TRIAL'
set -euo pipefail
say() { printf '== %s  %s\n' "$(date +%T)" "$*"; }
fail() {
  echo "FAILED: $*"
  systemctl status emitd --no-pager || true
  journalctl -u emitd --no-pager -n 20 || true
  exit 1
}
property() { systemctl show emitd -p "$1" --value; }
wait_until_active() {
  local attempt
  for attempt in $(seq 600); do
    [[ $(property ActiveState) == active ]] && return
    [[ $(property ActiveState) == failed ]] && fail "the service failed"
    sleep 1
  done
  fail "the service is not ready after $attempt s"
}

say "the boot started it"
wait_until_active
pid=$(property MainPID)
printf '%s\n' "$(property StatusText)"
[[ $(stat -c %U "/proc/$pid") == emitd ]] || fail "it runs as $(stat -c %U "/proc/$pid")"
grep -E "^Max (realtime priority|locked memory)" "/proc/$pid/limits"
# A container without the right to raise limits has no real-time priority to give.
if (ulimit -r 60) 2>/dev/null; then
  grep -qE "^Max realtime priority +60 " "/proc/$pid/limits" || fail "no real-time priority"
else
  echo "limits cannot be raised on this machine: not checked"
fi
[[ $(property LimitRTPRIO) == 60 && $(property LimitMEMLOCK) == infinity ]] || fail "limits of the unit"
[[ $(stat -c '%U %a' /var/lib/emitd) == "emitd 7"* ]] || fail "/var/lib/emitd: $(stat -c '%U %a' /var/lib/emitd)"
journalctl -u emitd --no-pager -o cat >/tmp/journal
grep -q "ready control=" /tmp/journal || fail "the journal lacks its start"

say "frames"
cd /tmp
emit make-log box --rate-hz 10 --out box.mcap
emit receive tcp://127.0.0.1:7000 --frames 3 --timeout-s 300 >receive.log 2>&1 &
sleep 3
emit send box.mcap --to tcp://127.0.0.1:7000 --step --frames 3 --timeout-s 300 || fail "emit send"
wait $! || { cat receive.log; fail "emit receive"; }
grep "^frames:" receive.log

say "killed, it starts again"
kill -KILL "$pid"
sleep 3
wait_until_active
[[ $(property NRestarts) == 1 && $(property MainPID) != "$pid" ]] || fail "$(property NRestarts) restarts"

say "stopped, it ends well"
systemctl stop emitd
[[ $(property ActiveState) == inactive && $(property Result) == success && $(property ExecMainStatus) == 0 ]] ||
  fail "$(property ActiveState), $(property Result), $(property ExecMainStatus)"

say "a wrong configuration is not tried again and again"
echo 'no_such_key = 1' >/etc/emitd/emitd.toml
if systemctl start emitd; then fail "it started"; fi
sleep 3
printf 'exit status %s, %s restarts\n' "$(property ExecMainStatus)" "$(property NRestarts)"
[[ $(property ActiveState) == failed && $(property NRestarts) == 0 ]] || fail "it is $(property ActiveState)"
journalctl -u emitd --no-pager -o cat >/tmp/journal
grep "emitd.toml:1:.*no_such_key" /tmp/journal || fail "the journal does not name the key"
echo "trial passed"
TRIAL
cat >"$system/etc/systemd/system/trial.service" <<'UNIT'
[Service]
Type=simple
ExecStart=/bin/bash /trial.sh
StandardOutput=file:/trial.log
StandardError=inherit
ExecStopPost=/bin/systemctl poweroff --no-block
[Install]
WantedBy=multi-user.target
UNIT
in_clean_system "$system" systemctl enable trial >/dev/null 2>&1
rm -f "$system/usr/sbin/policy-rc.d"

say "boot"
timeout --kill-after 30 1800 systemd-nspawn -q -D "$system" --boot --private-network --register=no --keep-unit \
  -M "emitd-trial-$$" </dev/null >"$work/boot.log" 2>&1 || true
if [[ ! -f $system/trial.log ]]; then
  tail -n 30 "$work/boot.log" >&2
  echo "try_service: the system did not boot" >&2
  exit 1
fi
cat "$system/trial.log"
[[ $(tail -n 1 "$system/trial.log") == "trial passed" ]]
