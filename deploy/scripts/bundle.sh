#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes emitd-VERSION-x86_64.tar.zst for machines without a package manager or network: programs, data, documents, the
# Python client and the shared libraries that they need. The folder runs from any path.
# Usage: bundle.sh PACKAGES OUT
#   PACKAGES  folder with the .deb files of this version, whose programs the bundle has
#   OUT       folder for the bundle and its .spdx.json
# Needs patchelf, zstd and the libraries of the packages installed here. SOURCE_DATE_EPOCH sets the times in it.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
if [[ $# -ne 2 || ! -d $1 ]]; then
  echo "usage: bundle.sh PACKAGES OUT" >&2
  exit 2
fi
for tool in patchelf zstd dpkg-deb dpkg-query objdump; do
  command -v "$tool" >/dev/null || { echo "bundle: $tool is not installed" >&2; exit 1; }
done
packages=$(cd "$1" && pwd)
mkdir -p "$2"
out=$(cd "$2" && pwd)
version=$(<"$root/version.txt")
epoch=${SOURCE_DATE_EPOCH:-$(git -C "$root" log -1 --format=%ct)}
limit_mib=64

# The machine has these, or the program could not draw on it:
# - glibc, because its parts must fit the loader of the machine;
# - the C++ and GCC runtimes and the compression libraries. A driver of the machine uses them too, in a process only one
#   of each is loaded, and the newer one serves both. A machine with glibc of at least Debian 12 has new enough ones;
# - the dispatch of EGL and OpenGL, which belongs to the machine's driver. It is opened at run time.
of_the_machine='^(linux-vdso|ld-linux|libc|libm|libdl|libpthread|librt|libresolv|libstdc\+\+|libgcc_s|libz|liblzma|libzstd'
of_the_machine+='|libEGL|libGL|libGLX|libGLdispatch|libOpenGL|libdrm|libgbm)[-.]'
# The window of `emit view` uses these. A driver may use them as well, so that the machine's own come first.
machine_first='^(libX11|libxcb|libXau|libXdmcp|libbsd|libmd)\.'
machine_folders=/usr/lib/x86_64-linux-gnu:/usr/lib64

name=emitd-$version-x86_64
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
top=$work/$name
mkdir -p "$top/lib/fallback" "$top/licenses" "$top/share"
for package in emitd emit-tools emit-data emit-doc python3-emit-client; do
  file=$(compgen -G "$packages/${package}_${version}_*.deb") ||
    { echo "bundle: $packages has no $package of version $version" >&2; exit 1; }
  dpkg-deb -x "$file" "$work/files"
done

# Programs and data.
mv "$work/files/usr/bin" "$top/bin"
mv "$work/files/usr/share/emit" "$work/files/usr/share/man" "$work/files/usr/share/bash-completion" "$top/share/"
mkdir -p "$top/share/emit/python" "$top/share/doc" "$top/share/systemd"
mv "$work/files"/usr/lib/python3/dist-packages/* "$work/files/usr/share/doc/python3-emit-client/examples" \
  "$top/share/emit/python/"
mv "$work/files/usr/share/doc/emit-doc" "$top/share/doc/emitd"
rm -f "$top"/share/doc/emitd/{LICENSE,changelog.gz,copyright}
cp "$root/LICENSE" "$top/share/doc/emitd/"
mv "$work/files/lib/systemd/system/emitd.service" "$work/files/usr/lib/sysusers.d/emitd.conf" "$top/share/systemd/"

# Libraries. The reference BLAS is taken where another one is chosen on this machine.
blas=/usr/lib/x86_64-linux-gnu/blas:/usr/lib/x86_64-linux-gnu/lapack
missing=$(LD_LIBRARY_PATH=$blas ldd "$top"/bin/* | grep 'not found' || true)
if [[ -n $missing ]]; then
  printf 'bundle: libraries are missing here:\n%s\n' "$missing" >&2
  exit 1
fi
LD_LIBRARY_PATH=$blas ldd "$top"/bin/* | awk '$2 == "=>" {print $1, $3}' | sort -u >"$work/libraries"
# Lines PACKAGE:ARCHITECTURE: PATH. Debian 12 knows libraries by a path in /usr/lib or by one in /lib.
cut -d' ' -f2 "$work/libraries" | xargs readlink -f | sed 'p; s#^/usr##' |
  xargs dpkg-query -S >"$work/owners" 2>/dev/null || true
: >"$work/taken"
while read -r soname path; do
  if [[ $soname =~ $of_the_machine ]]; then continue; fi
  folder=lib
  search="\$ORIGIN:\$ORIGIN/fallback"
  if [[ $soname =~ $machine_first ]]; then
    folder=lib/fallback
    search="$machine_folders:\$ORIGIN"
  elif [[ $soname == libglfw.* ]]; then
    search="$machine_folders:\$ORIGIN/fallback"
  fi
  real=$(readlink -f "$path")
  install -m 644 "$real" "$top/$folder/$soname"
  patchelf --set-rpath "$search" "$top/$folder/$soname"
  package=$(awk -v a="$real" -v b="${real#/usr}" '$2 == a || $2 == b {sub(/:.*/, ""); print; exit}' "$work/owners")
  if [[ -z $package ]]; then
    echo "bundle: no package owns $real, so its licence is unknown" >&2
    exit 1
  fi
  echo "$package $folder/$soname" >>"$work/taken"
  cp -L "/usr/share/doc/$package/copyright" "$top/licenses/$package"
done <"$work/libraries"
for program in "$top"/bin/*; do patchelf --set-rpath "\$ORIGIN/../lib" "$program"; done

# Licences: that of emitd, those of the libraries, and the full texts that Debian's copyright files refer to.
cp "$root/LICENSE" "$top/licenses/emitd"
mkdir -p "$top/licenses/common"
grep -d skip -ohE '/usr/share/common-licenses/[A-Za-z0-9.-]+[A-Za-z0-9]' "$top"/licenses/* | sort -u |
  while read -r text; do if [[ -f $text ]]; then cp -L "$text" "$top/licenses/common/"; fi; done

glibc=$(objdump -T "$top"/bin/* "$top"/lib/*.so* "$top"/lib/fallback/* 2>/dev/null |
  grep -oE 'GLIBC_[0-9.]+' | sed 's/GLIBC_//' | sort -uV | tail -n 1)
cat >"$top/README.txt" <<TEXT
emitd $version for x86_64, from any folder

  bin/emit doctor     says what this machine lacks
  bin/emit demo       plays a recorded log and receives frames
  bin/emitd --config share/emit/profiles/default.toml

The machine needs glibc $glibc or newer (Debian 12 or newer has it), libstdc++ and zlib of the same age, and
OpenGL 4.5 through EGL: a GPU's driver, or Mesa (Debian: libegl1, libopengl0, libgl1-mesa-dri).

lib/ has all other shared libraries. lib/fallback has those of X11, which are used where the machine has none.
licenses/ has their licences, sbom.spdx.json their versions and source packages. sha256sum -c SHA256SUMS checks all.
share/doc/emitd/deploy/docs/packages.md says how to run it as a service.
TEXT

"$root/deploy/scripts/sbom.py" --name "$name" --version "$version" --epoch "$epoch" --folder "$top" \
  --libraries "$work/taken" --out "$top/sbom.spdx.json"
(cd "$top" && find . -type f -print0 | LC_ALL=C sort -z | xargs -0 sha256sum) >"$work/SHA256SUMS"
mv "$work/SHA256SUMS" "$top/"

tar -C "$work" --sort=name --mtime="@$epoch" --owner=0 --group=0 --numeric-owner -cf - "$name" |
  zstd -q -T0 -16 -f -o "$out/$name.tar.zst"
cp "$top/sbom.spdx.json" "$out/$name.spdx.json"
bytes=$(stat -c %s "$out/$name.tar.zst")
mib() { awk -v bytes="$1" 'BEGIN {printf "%.1f MiB", bytes / 1048576}'; }
echo "bundle: $out/$name.tar.zst, $(mib "$bytes") ($(mib "$(du -sb "$top" | cut -f1)") unpacked)," \
  "$(find "$top" -type f | wc -l) files, $(wc -l <"$work/taken") libraries, glibc $glibc"
if ((bytes >= limit_mib * 1024 * 1024)); then
  echo "bundle: $bytes bytes are more than $limit_mib MiB" >&2
  exit 1
fi
