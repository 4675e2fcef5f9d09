#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the packages, builds with warnings as errors and runs every test.
set -euo pipefail
cd "$(dirname "$0")/../.."
deploy/scripts/install_deps.sh
cmake --preset ci
cmake --build --preset ci
ctest --preset ci "$@"
