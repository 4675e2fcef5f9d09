#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Fails when a source file is not as clang-format (Debian 12: version 14) would write it.
# With --fix, rewrites the files instead.
set -euo pipefail
cd "$(dirname "$0")/../.."
mode=(--dry-run --Werror)
[[ "${1:-}" == "--fix" ]] && mode=(-i)
git ls-files -- '*.cpp' '*.hpp' | grep -v 'shaders/' | xargs -r clang-format "${mode[@]}"
echo "check_format: done"
