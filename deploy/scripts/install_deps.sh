#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the Debian 12 packages that emitd needs to build, run and pass its tests.
# Uses sudo when not root. Prints what it installs; installs nothing that is already there.
# Usage: install_deps.sh [--with-checkers] [--with-yardsticks] [--with-docs] [--with-peers]: what checks the source tree
# and reads its messages in tests; what `emit bench stream` is put beside; what builds the documentation site (11 MB);
# other programs that tests put emitd's files and messages before. Packages for Node.js among them, and JSBSim, go to
# $EMIT_PEERS_DIR, or to the folder emit/peers of the user's cache. Tests look there, and are skipped where a peer is
# missing.
set -euo pipefail

build_tools=(g++ cmake ninja-build pkg-config git ca-certificates)
libraries=(libepoxy-dev libegl-dev libglfw3-dev libglm-dev libtinygltf-dev libstb-dev
           libopenexr-dev libboost-dev libprotobuf-dev protobuf-compiler libspdlog-dev libfmt-dev
           libtomlplusplus-dev libcli11-dev libexpected-dev libembree-dev libtbb-dev libeigen3-dev
           libceres-dev libmeshoptimizer-dev libgeos-dev libisal-dev liblz4-dev libssl-dev libgtest-dev libgmock-dev
           python3-protobuf python3-numpy node-typescript)
runtime=(libegl-mesa0 libgl1-mesa-dri xvfb xauth)
checkers=(clang-format clang-tidy clang libclang-rt-dev python3 tshark chromium python3-websockets)
yardsticks=(iperf3 libzmq3-dev iceoryx libiceoryx-posh-dev)
docs=(python3 mkdocs mkdocs-material)
peers=(gpsd-tools proj-bin ffmpeg gdal-bin slurmctld slurmd slurm-client munge calculix-ccx)
node_peers=(@mcap/core@2 @mcap/support@1 @foxglove/schemas@2 protobufjs@7 open-dis@1 gps@0.9)
peers_folder=${EMIT_PEERS_DIR:-${XDG_CACHE_HOME:-$HOME/.cache}/emit/peers}

with_peers=false
packages=("${build_tools[@]}" "${libraries[@]}" "${runtime[@]}")
for option in "$@"; do
  case $option in
    --with-checkers) packages+=("${checkers[@]}") ;;
    --with-yardsticks) packages+=("${yardsticks[@]}") ;;
    --with-docs) packages+=("${docs[@]}") ;;
    --with-peers)
      with_peers=true
      packages+=("${peers[@]}")
      # Node.js may come from elsewhere.
      command -v node >/dev/null || packages+=(nodejs)
      command -v npm >/dev/null || packages+=(npm)
      ;;
    *)
      echo "usage: install_deps.sh [--with-checkers] [--with-yardsticks] [--with-docs] [--with-peers]" >&2
      exit 2
      ;;
  esac
done

missing=()
for package in "${packages[@]}"; do
  if ! dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q '^install ok installed$'; then
    missing+=("$package")
  fi
done
if [[ ${#missing[@]} -eq 0 ]]; then
  echo "install_deps: all ${#packages[@]} packages are present"
else
  as_root=()
  if [[ $(id -u) -ne 0 ]]; then
    command -v sudo >/dev/null || { echo "install_deps: run as root or install sudo" >&2; exit 1; }
    as_root=(sudo)
  fi
  echo "install_deps: installing ${missing[*]}"
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get update -q
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}"
fi

if $with_peers; then
  absent=()
  for peer in "${node_peers[@]}"; do
    if [[ ! -f $peers_folder/node_modules/${peer%@*}/package.json ]]; then absent+=("$peer"); fi
  done
  if [[ ${#absent[@]} -eq 0 ]]; then
    echo "install_deps: all ${#node_peers[@]} packages for Node.js are present in $peers_folder"
  else
    echo "install_deps: installing ${absent[*]} in $peers_folder"
    mkdir -p "$peers_folder"
    npm install --prefix "$peers_folder" --no-audit --no-fund --ignore-scripts "${absent[@]}"
  fi
  # FlightGear brings JSBSim. Its package depends on 1.8 GB of scenery that the program does not need.
  if [[ -x /usr/games/JSBSim || -x $peers_folder/JSBSim ]]; then
    echo "install_deps: JSBSim is present"
  else
    echo "install_deps: taking JSBSim from Debian's package flightgear (11 MB) to $peers_folder"
    mkdir -p "$peers_folder"
    unpacked=$(mktemp -d)
    trap 'rm -rf "$unpacked"' EXIT
    (cd "$unpacked" && apt-get download -q flightgear)
    dpkg-deb --fsys-tarfile "$unpacked"/flightgear_*.deb | tar -x -C "$unpacked" ./usr/games/JSBSim
    mv "$unpacked/usr/games/JSBSim" "$peers_folder/JSBSim"
  fi
fi
