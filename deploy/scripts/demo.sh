#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the packages, builds the release preset and runs the demo; arguments go to `emit demo`.
set -euo pipefail
cd "$(dirname "$0")/../.."
deploy/scripts/install_deps.sh
cmake --preset release
cmake --build --preset release --target emit emitd config_data emit_scenes emit_logs
build/release/bin/emit demo --out out/demo "$@"
