#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Renders every shipped scene by day, at dusk, at night and under clouds, in 3-5 and 8-12 um, for deploy/docs/gallery.md.
# The words of that page come from looking at the pictures: look again when they change. Where two cores without a GPU
# are busy with other work, it takes half an hour.
# Usage: gallery.sh [SCENE...]   all scenes by default; needs ffmpeg; EMIT_BIN names the folder of the programs
set -euo pipefail
cd "$(dirname "$0")/../.."
folder=deploy/docs/gallery
page=deploy/docs/gallery.md
bands=(3-5 8-12)

# Scene: the time of its trajectories that is shown, size of the picture, conditions, further keys.
# `ribbed` has a table of one warm night.
scenes='
airfield       13     320 256 all
block-on-road  12600  320 256 all
box            12600  320 240 all
decoys         2.6    320 256 all
engage         4      320 256 all
fair-weather   12600  320 256 day,dusk
ribbed         7200   320 256 all weather.file=
sea            0      320 256 all
statue         12600  320 240 day,dusk
'
# Condition: UTC of 21 June 2014, limits of the colours in K, sky, further keys. The sun is highest at
# 11:15 and sets at 19:18.
conditions='
day       11:00 285 325 clear
dusk      19:30 280 305 clear
night     23:30 275 300 clear
overcast  11:00 285 310 clouds weather.cloud_frac=1
'

emit=
named=${EMIT_BIN:-}
unset EMIT_BIN # the program refuses variables of this kind that it does not know
for each in ${named:+"$named"} build/release/bin build/ci/bin build/dev/bin; do
  if [[ -z $emit && -x $each/emit ]]; then emit=$each/emit; fi
done
if [[ -z $emit ]]; then
  echo "gallery.sh: there is no emit in build/*/bin; build it, or name its folder by EMIT_BIN" >&2
  exit 1
fi
command -v ffmpeg >/dev/null || { echo "gallery.sh: ffmpeg is missing" >&2; exit 1; }
for file in config/scenarios/*.toml; do
  name=$(basename "$file" .toml)
  if ! grep -q "^$name " <<<"$scenes"; then
    echo "gallery.sh: the scenario $name is shipped and not in the table of scenes" >&2
    exit 1
  fi
done

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$folder"
render() { # scene shown_s width_px height_px condition utc min_k max_k keys...
  local scene=$1 shown=$2 condition=$5 epoch keys=() key band
  # The epoch moves, not the time shown: camera and vehicles are then where the scenario has them.
  epoch=$(date -u -d "2014-06-21 $6 UTC - $shown seconds" +%Y-%m-%dT%H:%M:%SZ)
  for key in "sensor.width_px=$3" "sensor.height_px=$4" "epoch_utc=$epoch" "display.min_k=$7" "display.max_k=$8" \
    "${@:9}"; do
    keys+=(--set "$key")
  done
  "$emit" render "$scene" --time-s "$shown" "${keys[@]}" --band "${bands[0]}" --band "${bands[1]}" \
    --out "$work/{band}.exr" --png "$work/{band}.png" --json "$work/result.json"
  for band in "${bands[@]}"; do
    ffmpeg -y -loglevel error -i "$work/$band.png" -c:v libwebp -lossless 1 -compression_level 6 \
      "$folder/${scene}_${condition}_$band.webp"
  done
}

while read -r scene shown width height shown_in scene_keys; do
  if [[ -z $scene ]] || { (($#)) && [[ " $* " != *" $scene "* ]]; }; then continue; fi
  while read -r condition utc min_k max_k _ condition_keys; do
    if [[ -z $condition ]]; then continue; fi
    if [[ $shown_in != all && ",$shown_in," != *",$condition,"* ]]; then continue; fi
    # shellcheck disable=SC2086 # keys are words
    render "$scene" "$shown" "$width" "$height" "$condition" "$utc" "$min_k" "$max_k" $scene_keys $condition_keys </dev/null
  done <<<"$conditions"
done <<<"$scenes"

# The page has every picture, and states the limits of the colours.
failed=false
while read -r condition utc min_k max_k _; do
  if [[ -z $condition ]]; then continue; fi
  if ! grep -q "^| $condition | .*| $utc | $min_k to $max_k K |" "$page"; then
    echo "gallery.sh: $page does not say of $condition: $utc, $min_k to $max_k K" >&2
    failed=true
  fi
done <<<"$conditions"
for picture in "$folder"/*.webp; do
  if ! grep -q "gallery/${picture##*/}" "$page"; then
    echo "gallery.sh: $page does not show ${picture##*/}" >&2
    failed=true
  fi
  if (($(stat -c %s "$picture") > 40000)); then
    echo "gallery.sh: $picture is larger than 40 kB" >&2
    failed=true
  fi
done
du -ch "$folder"/*.webp | tail -1
if $failed; then exit 1; fi
