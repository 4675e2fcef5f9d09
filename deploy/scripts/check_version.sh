#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Fails when version.txt, CHANGELOG.md, debian/changelog and the --version of programs differ.
# Usage: check_version.sh [PROGRAM...]
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)

version=$(<"$root/version.txt")
failed=false
# expect WHERE FOUND
expect() {
  if [[ $2 != "$version" ]]; then
    echo "check_version: version.txt has '$version', $1 has '$2'" >&2
    failed=true
  fi
}

if [[ ! $version =~ ^[0-9]+\.[0-9]+\.[0-9]+$ ]]; then
  echo "check_version: version.txt has '$version', which is not MAJOR.MINOR.PATCH" >&2
  exit 1
fi
expect CHANGELOG.md "$(sed -n 's/^## \[\([^]]*\)\].*/\1/p' "$root/CHANGELOG.md" | head -n 1)"
expect debian/changelog "$(sed -n '1s/^emitd (\([^)]*\)).*/\1/p' "$root/debian/changelog")"
for program in "$@"; do
  expect "$program --version" "$("$program" --version | awk '{print $2; exit}')"
done
if $failed; then exit 1; fi
echo "check_version: $version everywhere"
