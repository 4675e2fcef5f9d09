#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Rewrites tests/golden/refs from the build of a preset (default dev). Say in the commit why they changed.
set -euo pipefail
cd "$(dirname "$0")/../.."
preset=${1:-dev}
EMIT_UPDATE_GOLDENS=1 ctest --preset "$preset" -L golden
git status --short tests/golden/refs
