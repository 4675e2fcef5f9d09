#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the packages, builds a preset (default: release, as demo.sh does) and runs every test.
# Usage: test.sh [PRESET [ctest arguments]...]; continuous integration takes "ci": warnings are errors.
set -euo pipefail
cd "$(dirname "$0")/../.."
preset=${1:-release}
deploy/scripts/install_deps.sh
cmake --preset "$preset"
cmake --build --preset "$preset"
ctest --preset "$preset" "${@:2}"
