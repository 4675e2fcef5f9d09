#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes all files of a release in one folder: Debian packages, bundle, container image, source tarball, bill of
# materials, checksums.
# Usage, as root: release.sh OUT
# OUT must be empty or not there. It refuses a tree with changes and versions that differ. The packages are built from a
# clean clone of HEAD; DEB_BUILD_OPTIONS applies ("nocheck parallel=2" leaves the tests out). lintian must find nothing.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
if [[ $# -ne 1 || $(id -u) -ne 0 ]]; then
  echo "usage, as root: release.sh OUT" >&2
  exit 2
fi
changes=$(git -C "$root" status --porcelain)
if [[ -n $changes ]]; then
  printf 'release: the tree has changes that are not committed:\n%s\n' "$changes" >&2
  exit 1
fi
"$root/deploy/scripts/check_version.sh"
if [[ -d $1 && -n $(ls -A "$1") ]]; then
  echo "release: $1 is not empty" >&2
  exit 1
fi
for tool in dpkg-buildpackage dh dh_python3 lintian patchelf zstd buildah debootstrap; do
  command -v "$tool" >/dev/null || { echo "release: $tool is not installed" >&2; exit 1; }
done
mkdir -p "$1"
out=$(cd "$1" && pwd)
version=$(<"$root/version.txt")
export SOURCE_DATE_EPOCH
SOURCE_DATE_EPOCH=$(git -C "$root" log -1 --format=%ct)
say() { printf '== %s  %s\n' "$(date +%T)" "$*"; }

say "source"
git -C "$root" archive --format=tar --prefix="emitd-$version/" HEAD | zstd -q -19 -T0 -o "$out/emitd-$version.tar.zst"

say "packages"
build=$out/build
mkdir "$build"
git clone -q "$root" "$build/emitd-$version"
(cd "$build/emitd-$version" && dpkg-buildpackage -us -uc -b) >"$build/log" 2>&1 || {
  tail -n 30 "$build/log" >&2
  echo "release: the packages do not build; $build/log has all" >&2
  exit 1
}
programs=("$build/emitd-$version"/debian/{emitd/usr/bin/emitd,emit-tools/usr/bin/emit})
"$root/deploy/scripts/check_version.sh" "${programs[@]}"
lintian --fail-on error,warning "$build"/*.changes
mv "$build"/*.{deb,buildinfo,changes} "$out/"
rm -rf "$build"

say "bundle"
"$root/deploy/scripts/bundle.sh" "$out" "$out"

say "image"
"$root/deploy/scripts/image.sh" "$out" "$out"

(cd "$out" && find . -maxdepth 1 -type f ! -name SHA256SUMS -printf '%f\0' | LC_ALL=C sort -z | xargs -0 sha256sum) \
  >"$build.sums"
mv "$build.sums" "$out/SHA256SUMS"
say "done"
ls -l "$out"
