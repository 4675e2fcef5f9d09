#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Writes the tables of measured results from the JSON that `emit bench` wrote, between the markers of
# renderer/docs/measured/README.md, server/docs/measured/README.md and README.md.
# Usage: measured_pages.sh [--check]. With --check it writes nothing and exits 1 when a page is out of date.
set -euo pipefail
cd "$(dirname "$0")/../.."
if ! command -v python3 >/dev/null; then
  echo "measured_pages.sh: python3 is missing (deploy/scripts/install_deps.sh --with-checkers)" >&2
  exit 1
fi
exec python3 deploy/scripts/measured_pages.py "$@"
