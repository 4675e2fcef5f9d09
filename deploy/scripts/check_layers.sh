#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Shows that the include arrows of the architecture hold. A folder is a layer. The table below has a row for every
# folder of sources, lowest first. A row names the folders that its files may include besides their own. Each of them
# stands in a row above, so that no circle of folders can be written down.
# The script also checks that third-party libraries stay in the one folder that wraps them, that no folder holds more
# than 30 source files, and that every source file has its licence line.
set -euo pipefail
cd "$(dirname "$0")/../.."
violations=0

layers='
renderer/physics:
renderer/image: renderer/physics
renderer/scene: renderer/physics
renderer/scene/src/cut: renderer/scene renderer/physics
renderer/scene/src/gltf: renderer/scene renderer/scene/src/cut renderer/physics
renderer/scene/src: renderer/scene renderer/scene/src/gltf renderer/physics
renderer/scene/generate: renderer/physics
renderer/threads: renderer/physics
renderer/embree: renderer/physics
renderer/reference: renderer/physics renderer/scene
renderer/reference/src/rays: renderer/embree renderer/reference renderer/physics renderer/scene renderer/threads
renderer/reference/src/conduction: renderer/reference renderer/reference/src/rays renderer/physics renderer/scene renderer/threads
renderer/reference/src/points: renderer/reference renderer/physics renderer/scene renderer/threads
renderer/reference/src: renderer/reference renderer/reference/src/rays renderer/reference/src/conduction renderer/reference/src/points renderer/physics renderer/scene renderer/threads
renderer/shaders/shared: renderer/physics
renderer/gl: renderer/physics renderer/threads
renderer/include: renderer/physics renderer/scene
renderer/history: renderer/include renderer/physics renderer/scene renderer/threads
renderer/surface/heat: renderer/history renderer/include renderer/physics renderer/scene
renderer/surface/mesh: renderer/physics renderer/scene renderer/threads
renderer/surface/rays: renderer/embree renderer/history renderer/physics renderer/scene renderer/threads renderer/surface/heat renderer/surface/mesh
renderer/surface/model: renderer/history renderer/physics renderer/scene renderer/surface/heat renderer/surface/mesh renderer/surface/rays
renderer/surface/shade: renderer/history renderer/physics renderer/scene renderer/threads renderer/shaders/shared renderer/surface/heat renderer/surface/mesh renderer/surface/rays
renderer/surface/state: renderer/history renderer/physics renderer/scene renderer/surface/mesh renderer/surface/model
renderer/surface/columns: renderer/physics renderer/threads renderer/surface/heat renderer/surface/mesh renderer/surface/model renderer/surface/rays
renderer/surface/warm_up: renderer/physics renderer/threads renderer/surface/columns renderer/surface/heat renderer/surface/mesh renderer/surface/model renderer/surface/rays
renderer/surface/run: renderer/history renderer/physics renderer/scene renderer/threads renderer/surface/heat renderer/surface/mesh renderer/surface/model renderer/surface/rays renderer/surface/shade renderer/surface/state renderer/surface/warm_up
renderer/draw: renderer/gl renderer/history renderer/physics renderer/scene renderer/shaders/shared renderer/threads renderer/surface/mesh renderer/surface/run
renderer/passes: renderer/draw renderer/gl renderer/physics renderer/scene renderer/shaders/shared renderer/surface/run
renderer/stages: renderer/draw renderer/gl renderer/history renderer/include renderer/passes renderer/physics renderer/scene renderer/shaders/shared renderer/surface/rays renderer/surface/run
renderer/budget: renderer/include renderer/physics renderer/scene renderer/surface/mesh
renderer/src: renderer/budget renderer/draw renderer/gl renderer/history renderer/include renderer/passes renderer/physics renderer/scene renderer/stages renderer/surface/rays
renderer/verify: renderer/physics
renderer/verify/src: renderer/verify renderer/gl renderer/physics
renderer/verify/src/visibility: renderer/verify renderer/verify/src renderer/include renderer/physics renderer/reference renderer/scene renderer/threads
renderer/verify/src/stability: renderer/verify renderer/verify/src renderer/gl renderer/physics renderer/shaders/shared
renderer/verify/src/models: renderer/verify renderer/verify/src renderer/verify/src/visibility renderer/physics renderer/reference
protocol: renderer/physics
config/include: protocol renderer/physics renderer/scene
config/src/keys: protocol config/include renderer/physics renderer/scene
config/src/tables: protocol config/include config/src/keys renderer/physics renderer/scene
config/src/resolve: protocol config/include config/src/keys config/src/tables renderer/physics renderer/scene
config/src: protocol config/include config/src/keys config/src/tables config/src/resolve renderer/physics renderer/scene
config/tools: config/include config/src config/src/keys config/src/resolve renderer/physics renderer/scene
server/rt: renderer/physics
server/host: server/rt config/include renderer/physics
server/net: server/rt protocol renderer/physics
server/client: server/net server/rt protocol renderer/physics
server/pacing: protocol renderer/include renderer/physics renderer/scene
server/motion: protocol renderer/physics
server/gnss: protocol renderer/physics
server/output: protocol renderer/image renderer/physics renderer/scene
server/engage: protocol renderer/physics
server/telemetry: server/host server/net server/rt config/include protocol renderer/physics
server/gateway: server/host server/motion server/net server/rt server/telemetry config/include protocol renderer/physics renderer/reference renderer/scene
server/axes: server/motion server/net server/rt server/telemetry config/include protocol renderer/physics
server/agents: server/gateway server/host server/motion server/output server/pacing server/rt server/telemetry config/include protocol renderer/include renderer/physics renderer/scene
server/agents/sender: server/agents server/net server/rt config/include protocol renderer/physics
server/agents/receiver: server/agents server/agents/sender server/net server/rt config/include protocol renderer/physics
server/agents/conductor: server/agents server/gateway server/motion server/net server/pacing server/rt config/include protocol renderer/physics
server/agents/recorder: server/agents server/net server/rt config/include protocol renderer/physics
server/agents/render: server/agents server/motion server/pacing renderer/image renderer/physics
server/agents/motion: server/agents server/axes server/motion server/net server/rt config/include protocol renderer/physics renderer/scene
server/agents/gateway: server/agents server/gateway server/net server/rt config/include protocol renderer/physics renderer/scene
server/console: server/agents server/agents/sender server/net server/rt server/telemetry config/include protocol renderer/image renderer/physics renderer/scene
server/app: server/axes server/console server/host server/agents server/agents/conductor server/agents/gateway server/gateway server/agents/motion server/agents/receiver server/agents/recorder server/agents/render server/agents/sender server/motion server/net server/rt server/telemetry config/include protocol renderer/include renderer/physics renderer/scene
server/tool/support: server/app server/pacing server/telemetry config/include protocol renderer/image renderer/include renderer/physics renderer/reference renderer/scene renderer/scene/generate
server/tool/command_line: server/tool/support config/include renderer/physics
server/tool/logger: server/tool/command_line server/tool/support config/include renderer/physics renderer/reference renderer/scene
server/tool/streams: server/tool/command_line server/tool/support server/app server/client server/rt protocol renderer/image renderer/physics renderer/scene
server/tool/replay: server/tool/command_line server/tool/streams server/tool/support server/agents server/app server/console server/net server/telemetry protocol renderer/physics
server/tool/foxglove: server/tool/command_line server/tool/streams server/tool/support protocol renderer/image renderer/physics
server/tool/report: server/tool/support renderer/physics
server/tool/engage: server/tool/command_line server/tool/report server/tool/support server/tool/streams server/client server/engage config/include protocol renderer/image renderer/include renderer/physics renderer/reference renderer/scene
server/bench/nature: server/tool/command_line server/tool/logger server/tool/support renderer/physics renderer/reference renderer/scene
server/bench/stability: server/tool/command_line server/tool/support renderer/image renderer/include renderer/physics renderer/scene renderer/verify
server/bench/accuracy: server/tool/command_line server/tool/support server/bench/stability renderer/image renderer/include renderer/physics renderer/reference renderer/scene renderer/threads renderer/verify
server/bench/frame_time: server/tool/command_line server/tool/support server/bench/accuracy server/bench/stability server/pacing renderer/include renderer/physics renderer/reference renderer/scene renderer/scene/generate
server/bench/stream: server/tool/command_line server/tool/support server/tool/streams server/agents server/client server/net server/output server/rt config/include protocol renderer/image renderer/physics renderer/scene
server/tool/fms_sim: server/axes server/motion server/net server/tool/support config/include protocol renderer/physics
server/tool/truth: server/tool/support renderer/physics renderer/reference renderer/scene
server/tool/doctor: server/tool/command_line server/tool/support config/include renderer/include
server/tool/nature: server/tool/command_line server/tool/support config/include renderer/physics renderer/scene
server/tool/offline: server/agents server/app server/tool/command_line server/tool/report server/tool/support server/tool/truth protocol renderer/include renderer/physics renderer/reference renderer/scene
server/tool/view: server/tool/support server/tool/streams server/tool/offline server/client renderer/image renderer/include renderer/physics renderer/scene
server/tool/campaign: server/app server/client server/rt server/tool/command_line server/tool/offline server/tool/report server/tool/streams server/tool/support config/include protocol renderer/image renderer/include renderer/physics renderer/reference renderer/scene
server/tool/scenes: server/tool/command_line server/tool/offline server/tool/support config/include renderer/image renderer/include renderer/physics renderer/reference renderer/scene renderer/scene/generate
server/tool/commands: server/tool/doctor server/tool/foxglove server/tool/scenes server/tool/nature server/tool/campaign server/tool/command_line server/tool/offline server/tool/engage server/tool/truth server/tool/support server/tool/replay server/tool/streams server/tool/view server/tool/fms_sim server/gnss server/motion server/agents server/agents/render server/app server/client server/net server/rt config/include protocol renderer/image renderer/include renderer/physics renderer/reference renderer/scene
server/tool/lab: server/tool/command_line server/tool/support server/tool/commands server/tool/logger server/bench/accuracy server/bench/frame_time server/bench/nature server/bench/stability server/bench/stream config/include renderer/image renderer/physics renderer/reference renderer/scene renderer/verify
server/tool: server/tool/commands server/tool/lab server/tool/support
'

# Every include of a project header as FILE:LINE:HEADER.
includes() {
  grep -rnE '^#include "' renderer protocol config server --include='*.hpp' --include='*.cpp' --include='*.h' |
    sed -E 's/^([^:]*:[0-9]*):#include "([^"]*)".*/\1:\2/' |
    grep -vE ':emit/(v1/|version\.hpp$)'
}

# The folder of a file as the table names it: the sources and public headers of a small module are one folder.
arrows=$(includes | awk -F: -v layers="$layers" '
  function folder(path,   f) {
    f = path
    if (!sub(/\/[^\/]*$/, "", f)) f = ""
    if (f ~ /^renderer\/include/) return "renderer/include"
    if (f ~ /^config\/include/) return "config/include"
    if (f ~ /^(renderer\/(physics|image|scene\/generate)|protocol)\/(include|src)/) sub(/\/(include|src).*/, "", f)
    sub(/\/include\/emit\/.*/, "", f)
    return f
  }
  BEGIN {
    owner["physics"] = "renderer/physics"; owner["image"] = "renderer/image"; owner["scene"] = "renderer/scene"
    owner["scenegen"] = "renderer/scene/generate"; owner["threads"] = "renderer/threads"
    owner["reference"] = "renderer/reference"; owner["renderer"] = "renderer/include"; owner["verify"] = "renderer/verify"
    owner["protocol"] = "protocol"; owner["config"] = "config/include"; owner["client"] = "server/client"
    count = split(layers, line, "\n")
    for (i = 1; i <= count; ++i) {
      if (line[i] == "") continue
      split(line[i], part, ":")
      number = split(part[2], used, " ")
      for (u = 1; u <= number; ++u) {
        dep = used[u]
        if (!(dep in row))
          print "row " part[1] " names " dep ", which has no row above it"
        allowed[part[1] "|" dep] = 1
      }
      row[part[1]] = 1
    }
  }
  {
    from = folder($1)
    if (!(from in row)) {
      if (!(from in reported)) print "folder " from " has no row in the table"
      reported[from] = 1
      next
    }
    header = $3
    if (match(header, /^emit\/[a-z]+\//)) {
      split(header, word, "/")
      to = owner[word[2]]
    } else if (header ~ /^foxglove\//) {
      to = "server/tool/foxglove"  # generated from its own .proto files
    } else if (header ~ /^\.\.\// || header !~ /\//) {
      to = from
    } else if (from ~ /^(config|renderer\/reference|renderer\/scene|renderer\/verify)\/src/) {
      root = from; sub(/\/src.*/, "/src", root); to = header ~ /^shared\// ? "renderer/shaders/shared" : \
          header ~ /^(embree|gl|threads)\// ? "renderer/" folder(header) : root "/" folder(header)
    } else if (from ~ /^protocol/) {
      to = "protocol"
    } else if (from ~ /^config\/tools/) {
      to = "config/src/" folder(header)
    } else {
      to = (header ~ /^shared\// ? "renderer/shaders/" : from ~ /^server/ ? "server/" : "renderer/") folder(header)
    }
    if (to == from || (from "|" to) in allowed) next
    print $1 ":" $2 ": " from " may not include " to " (\"" header "\")"
  }')
if [[ -n $arrows ]]; then
  echo "$arrows"
  violations=$((violations + $(echo "$arrows" | wc -l)))
fi

crowded=$(git ls-files -co --exclude-standard -- '*.cpp' '*.hpp' '*.h' '*.glsl' '*.comp' '*.vert' '*.frag' |
  sed -E 's#/[^/]*$##' | sort | uniq -c | awk '$1 > 30 {print "folder " $2 " holds " $1 " source files"}')
if [[ -n $crowded ]]; then
  echo "$crowded"
  violations=$((violations + $(echo "$crowded" | wc -l)))
fi

# only NAME "include regex" "folders that may" : a library is included nowhere else.
only() {
  local name=$1 pattern=$2 folders=$3
  local lines
  lines=$(grep -rnE "^#include [<\"]($pattern)" renderer protocol config server \
    --include='*.hpp' --include='*.cpp' --include='*.h' | grep -vE "^($folders)" || true)
  if [[ -n $lines ]]; then
    echo "$name is included outside ($folders):"
    echo "$lines" | sed 's/^/  /'
    violations=$((violations + $(echo "$lines" | wc -l)))
  fi
}

# The truth does not use the formulas that it judges (fitting compares the two, so it has both).
formulas='equilibrium|surface_balance|relaxation|planck|band_radiance_lut|foster'
judged=$(grep -rnE "^#include \"emit/physics/($formulas)\.hpp\"" renderer/reference \
  --include='*.hpp' --include='*.cpp' | grep -vE '/fit[a-z_]*\.(hpp|cpp):' || true)
if [[ -n $judged ]]; then
  echo "the reference includes formulas of the real-time path:"
  echo "$judged" | sed 's/^/  /'
  violations=$((violations + $(echo "$judged" | wc -l)))
fi
only OpenGL   'epoxy/|GL/'        'renderer/gl/|renderer/draw/|renderer/passes/|renderer/stages/|renderer/verify/|server/tool/view'
only GLFW     'GLFW/'             'server/tool/view'
only OpenEXR  'Imf|OpenEXR/'      'renderer/image/'
only tinygltf 'tiny_gltf'         'renderer/scene/'
only meshoptimizer 'meshoptimizer' 'renderer/scene/'
only GEOS     'geos_c'            'renderer/scene/'
only toml++   'toml\+\+|toml\.hpp' 'config/'
only Boost    'boost/'            'server/'
only ISA-L    'isa-l'             'protocol/src/erasure_code|renderer/surface/state/file_sink'
only Protobuf 'google/protobuf/'  'protocol/|server/'
only spdlog   'spdlog/'           'server/'
only Embree   'embree3/'          'renderer/embree/|renderer/reference/|renderer/surface/rays/caster_'
only Eigen    'Eigen/'            'renderer/reference/'
only Ceres    'ceres/'            'renderer/reference/'
only OpenSSL  'openssl/'          'protocol/src/|server/net/tls_|server/app/sha256'
only CLI11    'CLI/'              'server/tool/command_line/command_line.cpp'

missing=$(git ls-files -- '*.cpp' '*.hpp' '*.h' '*.glsl' '*.comp' '*.vert' '*.frag' '*.sh' '*.py' '*.cmake' \
    '*CMakeLists.txt' '*.proto' | xargs grep -L 'SPDX-License-Identifier: Apache-2.0' || true)
if [[ -n $missing ]]; then
  echo "files without licence line:"
  echo "$missing" | sed 's/^/  /'
  violations=$((violations + 1))
fi

if [[ $violations -gt 0 ]]; then
  echo "check_layers: $violations violation(s)"
  exit 1
fi
echo "check_layers: all include arrows hold"
