#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs clang-tidy with the compile commands of a configured preset.
#   check_tidy.sh PRESET            the .cpp files that differ from HEAD, and new ones
#   check_tidy.sh PRESET all        every .cpp file of the project that the preset compiles
#   check_tidy.sh PRESET FILE...    these
# Exits 1 when there is a finding, 2 on bad usage.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

if [[ $# -lt 1 ]]; then
  echo "usage: $0 PRESET [all | FILE...]" >&2
  exit 2
fi
build="build/$1"
shift
commands="$build/compile_commands.json"
if [[ ! -f $commands ]]; then
  echo "$0: $commands is missing: configure that preset first" >&2
  exit 2
fi
command -v clang-tidy >/dev/null || { echo "$0: clang-tidy is not installed" >&2; exit 2; }

if [[ $# -eq 0 ]]; then
  mapfile -t files < <({ git diff --name-only --diff-filter=d HEAD -- '*.cpp'
                         git ls-files --others --exclude-standard -- '*.cpp'; } | sort -u)
elif [[ $1 == all ]]; then
  mapfile -t files < <(git ls-files -- '*.cpp')
else
  files=("$@")
fi

# Files that the preset does not compile have no flags to check them with.
known=()
for file in "${files[@]}"; do
  if grep -qF "\"$PWD/${file#"$PWD/"}\"" "$commands"; then
    known+=("$file")
  else
    echo "$file: not compiled by this preset, skipped" >&2
  fi
done
if [[ ${#known[@]} -eq 0 ]]; then
  echo "no file to check"
  exit 0
fi
echo "checking ${#known[@]} files"
printf '%s\0' "${known[@]}" |
  xargs -0 -n 1 -P "${EMIT_TIDY_JOBS:-$(nproc)}" \
    clang-tidy --quiet --warnings-as-errors='*' -p "$build" || exit 1
echo "no findings"
