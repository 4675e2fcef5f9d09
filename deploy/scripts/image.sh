#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes the container image of the packages in a folder by the Containerfile, as an OCI archive. Its base is a minimal
# Debian 12 from the mirrors of this machine, so that it needs no registry.
# Usage, as root: image.sh PACKAGES OUT
# It writes OUT/emitd-VERSION-oci.tar.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
# shellcheck source=deploy/scripts/clean_system.sh
source "$root/deploy/scripts/clean_system.sh"
if [[ $# -ne 2 || ! -d $1 || ! -d $2 || $(id -u) -ne 0 ]]; then
  echo "usage, as root: image.sh PACKAGES OUT" >&2
  exit 2
fi
for tool in buildah debootstrap zstd; do
  command -v "$tool" >/dev/null || { echo "image: $tool is not installed" >&2; exit 1; }
done
packages=$(realpath "$1")
out=$(realpath "$2")
version=$(<"$root/version.txt")
work=$(mktemp -d)
base=localhost/emitd-base:$$
image=localhost/emitd-build:$$  # a name of its own, so that no image of the operator is replaced
container=
end() {
  if [[ -n $container ]]; then buildah rm "$container" >/dev/null || true; fi
  buildah rmi "$image" >/dev/null 2>&1 || true
  buildah rmi "$base" >/dev/null 2>&1 || true
  rm -rf "$work"
}
trap end EXIT

# The context of the build has these packages alone, so that no older one beside them is installed.
mkdir "$work/packages"
for package in emitd emit-tools emit-data; do
  file=$(compgen -G "$packages/${package}_${version}_*.deb") ||
    { echo "image: $packages has no $package of version $version" >&2; exit 1; }
  ln "$file" "$work/packages/" 2>/dev/null || cp "$file" "$work/packages/"
done

# The base names no mirror. Those of this machine are mounted while the image is built, and leave no trace.
archive=$(clean_base)
container=$(buildah from scratch)
system=$(buildah mount "$container")
tar -C "$system" -x --zstd -f "$archive"
chmod 755 "$system"
# debootstrap copies names of the machine, and leaves packages, lists and logs.
rm -rf "$system"/etc/{resolv.conf,hostname} "$system"/var/cache/apt/{archives/*.deb,*.bin} \
  "$system"/var/lib/apt/lists/* "$system"/var/log/{bootstrap.log,dpkg.log,alternatives.log,apt}
echo "# An image made from this one names its mirror of Debian 12 here." >"$system/etc/apt/sources.list"
cp -r "$system/etc/apt/apt.conf.d" "$work/"
buildah umount "$container" >/dev/null
buildah commit -q --rm "$container" "$base" >/dev/null
container=
apt_sources >"$work/sources.list"
apt_settings >"$work/apt.conf.d/90of-the-host"

epoch=${SOURCE_DATE_EPOCH:-$(git -C "$root" log -1 --format=%ct)}
buildah bud --isolation chroot --pull-never --timestamp "$epoch" --build-arg BASE="$base" \
  -v "$work/sources.list:/etc/apt/sources.list:ro" -v "$work/apt.conf.d:/etc/apt/apt.conf.d" \
  --label org.opencontainers.image.title=emitd --label org.opencontainers.image.version="$version" \
  -f "$root/deploy/container/Containerfile" -t "$image" "$work/packages" >"$work/log" 2>&1 || {
  tail -n 30 "$work/log" >&2
  echo "image: the image does not build" >&2
  exit 1
}
rm -f "$out/emitd-$version-oci.tar"
buildah push -q "$image" "oci-archive:$out/emitd-$version-oci.tar:emitd:$version"
ls -l "$out/emitd-$version-oci.tar"
