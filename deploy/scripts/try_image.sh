#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Tries a container image: what it holds, the tool, and the daemon with its installed and with an operator's
# configuration, whose frames a client in a second container takes.
# Usage, as root: try_image.sh IMAGE.tar
# podman runs the containers, in a network of their own, so that their ports cannot meet those of others.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
if [[ $# -ne 1 || ! -f $1 || $(id -u) -ne 0 ]]; then
  echo "usage, as root: try_image.sh IMAGE.tar" >&2
  exit 2
fi
if [[ -z ${EMIT_TRIAL_NETWORK:-} ]]; then
  exec env EMIT_TRIAL_NETWORK=own unshare --net bash "$0" "$@"
fi
ip link set lo up
command -v podman >/dev/null || { echo "try_image: podman is not installed" >&2; exit 1; }
version=$(<"$root/version.txt")
work=$(mktemp -d)
volume=emitd-trial
daemon=emitd-trial
# Images and containers of the trial lie in a storage of their own, apart from those of the operator.
podman() { command podman --root "$work/storage" --runroot "$work/run" "$@"; }
end() {
  local code=$?
  podman rm -f -a -v -t 5 >/dev/null 2>&1 || true
  podman rmi -f -a >/dev/null 2>&1 || true
  umount "$work/storage/overlay" 2>/dev/null || true
  rm -rf --one-file-system "$work"
  if ((code == 0)); then echo "try_image: all steps passed"; else echo "try_image: FAILED ($code)"; fi
}
trap end EXIT
say() { printf '== %s  %s\n' "$(date +%T)" "$*"; }
fail() { echo "FAILED: $*"; exit 1; }
in_image() { podman run --rm --network host --entrypoint "$1" "$image" "${@:2}"; }
in_image_as_root() { podman run --rm --network host --user root --entrypoint "$1" "$image" "${@:2}"; }

say "load"
podman load -q -i "$1" | tee "$work/load"
image=$(sed -n 's/^Loaded image[^:]*: *//p' "$work/load")
podman inspect --format '{{.Config.User}} {{.Config.WorkingDir}} {{.Config.StopSignal}} {{.Config.Entrypoint}} {{.Config.Cmd}}
version {{index .Config.Labels "org.opencontainers.image.version"}}, {{.Size}} bytes' "$image" | tee "$work/config"
grep -q "^emitd /var/lib/emitd SIGTERM \[emitd\] \[--config /etc/emitd/emitd.toml\]" "$work/config" || fail "settings"
grep -q "^version $version," "$work/config" || fail "the label's version is not $version"

say "nothing of the machine that built it"
# shellcheck disable=SC2016 # the shell in the container expands these
in_image_as_root bash -c '
  set -e
  cat /etc/apt/sources.list
  if grep -rh "^deb\|^URIs" /etc/apt/sources.list /etc/apt/sources.list.d; then echo "FAILED: a mirror"; exit 1; fi
  left=$(find / -xdev \( -name "90of-the-host" -o -path "/var/lib/apt/lists/*" -o -name "*.deb" -o -name bootstrap.log \) \
    ! -name partial ! -name lock 2>/dev/null)
  if [[ -n $left ]]; then echo "FAILED: left behind: $left"; exit 1; fi
  for package in emitd emit-tools emit-data; do dpkg-query -W -f="\${Package} \${Version} \${Status}\n" $package; done'

# A later layer hides what an earlier one has, and podman lays files of its own over some: look into each layer.
mkdir "$work/layers"
tar -C "$work/layers" -xf "$1"
names='etc/(hostname|resolv\.conf)$|var/cache/apt/archives/.*\.deb$|var/lib/apt/lists/.*_|var/log/(bootstrap|dpkg)\.log$'
for blob in "$work"/layers/blobs/sha256/*; do
  # Empty files are places over which something is mounted.
  { tar -tvf "$blob" 2>/dev/null || true; } | awk '$3 > 0 {print $6}' | { grep -E "^(\./)?($names)" || true; }
done >"$work/left"
if [[ -s $work/left ]]; then
  sort -u "$work/left" | head
  fail "layers hold files of the machine that built them"
fi
rm -rf "$work/layers"

say "programs"
for program in emitd emit emit-lab; do
  line=$(in_image "$program" --version)
  echo "$line"
  [[ $line == "${program%-lab} $version "* ]] || fail "wrong version"
done
in_image emit doctor || fail "emit doctor finds a failure"
in_image emit render box --time-s 0 --out /tmp/box.exr
podman run --rm --network host "$image" --config /etc/emitd/emitd.toml --check

say "the daemon with an operator's configuration and a volume"
cat >"$work/emitd.toml" <<'TOML'
scenario = "box"
[source]
first_time_s = 12600.0
[pacing]
mode = "host-step"
[host]
udp = "127.0.0.1:7001"
[control]
tcp = "127.0.0.1:7000"
[journal]
file = "/var/lib/emitd/run.mcap"
TOML
chmod 755 "$work"
chmod 644 "$work/emitd.toml"
podman run -d --name "$daemon" --network host --shm-size 1g -v "$work/emitd.toml:/etc/emitd/emitd.toml:ro" \
  -v "$volume:/var/lib/emitd" "$image" >/dev/null
for attempt in $(seq 300); do
  podman logs "$daemon" >"$work/log" 2>&1
  if grep -q "ready control=" "$work/log"; then break; fi
  [[ $(podman inspect --format '{{.State.Running}}' "$daemon") == true ]] || { cat "$work/log"; fail "the daemon ended"; }
  sleep 1
done
grep -q "ready control=" "$work/log" || { cat "$work/log"; fail "the daemon is not ready after $attempt s"; }
podman exec "$daemon" stat -c %U /proc/1 | tee "$work/user"
[[ $(<"$work/user") == emitd ]] || fail "the daemon runs as another user"
in_image emit receive tcp://127.0.0.1:7000 --frames 3 --timeout-s 300 >"$work/receive" 2>&1 &
receiver=$!
sleep 3
in_image bash -c 'emit make-log box --rate-hz 10 --out /tmp/box.mcap && emit send /tmp/box.mcap --to tcp://127.0.0.1:7000 --step --frames 3 --timeout-s 300' ||
  { cat "$work/receive"; podman logs "$daemon"; fail "emit send"; }
wait $receiver || { cat "$work/receive"; podman logs "$daemon"; fail "emit receive"; }
tail -n 3 "$work/receive"

say "its end"
podman stop -t 60 "$daemon" >/dev/null
code=$(podman inspect --format '{{.State.ExitCode}}' "$daemon")
[[ $code == 0 ]] || { podman logs "$daemon" | tail; fail "the daemon ended with $code after SIGTERM"; }
podman run --rm --network host -v "$volume:/var/lib/emitd" --entrypoint emit "$image" log info /var/lib/emitd/run.mcap \
  >"$work/info"
head -n 8 "$work/info"
grep -q "complete, with index and footer" "$work/info" || fail "the journal is not complete"
