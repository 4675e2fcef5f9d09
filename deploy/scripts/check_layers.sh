#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Shows that the include arrows of the architecture hold: folder = layer, arrows point down.
#   physics -> nothing; image, protocol, config -> physics; scene -> physics;
#   reference -> physics and the plain scene description; renderer -> physics, scene, image;
#   server -> all. Besides, config may read the plain header
#   emit/scene/scene_desc.hpp, because it fills those structs.
# Third-party libraries stay in the one folder that wraps them.
set -euo pipefail
cd "$(dirname "$0")/../.."
violations=0

# check NAME "folders" "allowed include prefixes (extended regex)" ["excluded path regex"]
# Looks at the project's own includes: "emit/...", "gl/...", "passes/..." and so on.
check() {
  local name=$1 folders=$2 allowed=$3 excluded=${4:-^$}
  local lines
  # shellcheck disable=SC2086
  lines=$(grep -rnE '^#include "' $folders --include='*.hpp' --include='*.cpp' --include='*.h' 2>/dev/null |
    grep -vE "$excluded" | grep -vE "#include \"($allowed)" || true)
  if [[ -n $lines ]]; then
    echo "layer $name includes what it may not:"
    echo "$lines" | sed 's/^/  /'
    violations=$((violations + $(echo "$lines" | wc -l)))
  fi
}

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

# Headers without a folder stand beside their file: private to the layer.
beside='(\.\./)?[a-z0-9_]+\.hpp"'
check physics  renderer/physics  "emit/physics/|$beside"
check image    renderer/image    "emit/image/|emit/physics/|$beside"
check scene    renderer/scene    "emit/scene/|emit/scenegen/|emit/physics/|$beside"
check threads  renderer/threads  "threads/"
check gl       renderer/gl       "gl/|threads/|emit/physics/"
check renderer "renderer/passes renderer/history renderer/surface renderer/include renderer/renderer.cpp" \
      "emit/(renderer|physics|scene|image)/|gl/|threads/|passes/|history/|surface/|shared/"
check reference renderer/reference "emit/(reference|physics)/|emit/scene/(scene_desc|mesh|trajectory)\.hpp|$beside"
# The truth does not use the formulas that it judges (fitting compares the two, so it has both).
formulas='equilibrium|surface_balance|relaxation|planck|band_radiance_lut|foster'
judged=$(grep -rnE "^#include \"emit/physics/($formulas)\.hpp\"" renderer/reference \
  --include='*.hpp' --include='*.cpp' | grep -vE '/fit[a-z_]*\.(hpp|cpp):' || true)
if [[ -n $judged ]]; then
  echo "the reference includes formulas of the real-time path:"
  echo "$judged" | sed 's/^/  /'
  violations=$((violations + $(echo "$judged" | wc -l)))
fi
check evaluate renderer/evaluate "emit/(evaluate|physics|reference|renderer|scene)/|gl/|shared/|$beside"
check protocol protocol          "emit/(protocol|physics)/|emit/v1/|record/|$beside"
check config   config            "emit/(config|physics)/|emit/scene/scene_desc\.hpp|$beside"

only OpenGL   'epoxy/|GL/'        'renderer/gl/|renderer/passes/|renderer/evaluate/|server/cli/view'
only GLFW     'GLFW/'             'server/cli/view'
only OpenEXR  'Imf|OpenEXR/'      'renderer/image/'
only tinygltf 'tiny_gltf'         'renderer/scene/'
only meshoptimizer 'meshoptimizer' 'renderer/scene/'
only toml++   'toml\+\+|toml\.hpp' 'config/'
only Boost    'boost/'            'server/'
only ISA-L    'isa-l'             'protocol/src/erasure_code'
only Protobuf 'google/protobuf/'  'protocol/|server/'
only spdlog   'spdlog/'           'server/'
only Embree   'embree3/'          'renderer/reference/|renderer/surface/caster_'
only Eigen    'Eigen/'            'renderer/reference/'
only Ceres    'ceres/'            'renderer/reference/'
only OpenSSL  'openssl/'          'protocol/src/|server/io/tls_'
only CLI11    'CLI/'              'server/'
only "the renderer's insides" 'gl/|threads/|passes/|history/|surface/' 'renderer/'

missing=$(git ls-files -- '*.cpp' '*.hpp' '*.h' '*.glsl' '*.comp' '*.vert' '*.frag' '*.sh' '*.cmake' \
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
