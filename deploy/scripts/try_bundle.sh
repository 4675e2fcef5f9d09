#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Tries a bundle in a minimal Debian 12 that has nothing of emitd: `emit doctor` without Mesa, then with Mesa, and the
# demo from a second path.
# Usage, as root: try_bundle.sh BUNDLE.tar.zst
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
# shellcheck source=deploy/scripts/clean_system.sh
source "$root/deploy/scripts/clean_system.sh"
if [[ $# -ne 1 || ! -f $1 || $(id -u) -ne 0 ]]; then
  echo "usage, as root: try_bundle.sh BUNDLE.tar.zst" >&2
  exit 2
fi
bundle=$(realpath "$1")
name=$(basename "$bundle" .tar.zst)
work=$(mktemp -d)
system=$work/system
end() {
  local code=$?
  rm -rf --one-file-system "$work"
  if ((code == 0)); then echo "try_bundle: all steps passed"; else echo "try_bundle: FAILED ($code)"; fi
}
trap end EXIT
make_clean_system "$system"
mkdir -p "$system/opt/first path"
tar -C "$system/opt/first path" -x --zstd -f "$bundle"

cat >"$system/trial.sh" <<'TRIAL'
set -euo pipefail
export DEBIAN_FRONTEND=noninteractive
say() { printf '== %s  %s\n' "$(date +%T)" "$*"; }
fail() { echo "FAILED: $*"; exit 1; }
top="/opt/first path/$1"

say "checksums, and where the loader finds what"
(cd "$top" && sha256sum --quiet -c SHA256SUMS)
for program in "$top"/bin/*; do
  # Words two and three of ldd are the path, which has a space here.
  ldd "$program" | sed -n 's/.* => \(.*\) (0x.*/\1/p' | sed "s#^$top/##; s#bin/\.\./##" >>/tmp/paths
  if ldd "$program" | grep "not found"; then fail "libraries are missing"; fi
done
printf 'from the bundle: %s\nfrom the machine: %s\n' "$(grep -c '^lib/' /tmp/paths)" \
  "$(grep '^/' /tmp/paths | sort -u | xargs -n 1 basename | tr '\n' ' ')"

say "without Mesa"
"$top/bin/emit" --version
"$top/bin/emitd" --version
"$top/bin/emit-lab" --version
"$top/bin/emit" doctor >/tmp/doctor 2>&1 && fail "emit doctor finds no failure" || code=$?
head -n 6 /tmp/doctor
tail -n 1 /tmp/doctor
[[ $code == 1 ]] && grep -q "^fail .*libEGL.so.1" /tmp/doctor || fail "emit doctor exits with $code"
"$top/bin/emit" render box --time-s 0 --out /tmp/box.exr && fail "a picture without OpenGL" || echo "emit render exits with $?"

say "with EGL, but neither its dispatch of OpenGL nor a driver"
apt-get update -q >/dev/null
apt-get install -q -y --no-install-recommends libegl1 >/tmp/log 2>&1 || { cat /tmp/log; exit 1; }
"$top/bin/emit" doctor >/tmp/doctor 2>&1 && fail "emit doctor finds no failure" || code=$?
grep "^fail" -A 1 /tmp/doctor || true
[[ $code == 1 ]] || fail "emit doctor exits with $code"

say "with Mesa"
apt-get install -q -y --no-install-recommends libopengl0 libgl1-mesa-dri >/tmp/log 2>&1 || { cat /tmp/log; exit 1; }
"$top/bin/emit" doctor | tee /tmp/doctor || fail "emit doctor finds a failure"

say "the demo, from another path"
mkdir /srv/rig
mv "$top" /srv/rig/emitd
cd /tmp
/srv/rig/emitd/bin/emit demo --out /tmp/demo
ls /tmp/demo | head -n 4
say "numbers of a fit, by the libraries of linear algebra"
/srv/rig/emitd/bin/emit materials --check lawn | tail -n 3
TRIAL
in_clean_system "$system" bash /trial.sh "$name"
