#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the fuzz targets (clang, libFuzzer, address and undefined-behaviour sanitizers: packages of
# install_deps.sh --with-checkers) and runs them one after the other on one core, at low priority.
# Usage: fuzz.sh [RUNS | SECONDSs] [TARGET...]
#   fuzz.sh                    a minute for each target
#   fuzz.sh 1000000 gltf exr   a million executions of two of them
# What was found that reaches further than the seeds is kept in build/fuzz/found and used again.
# Prints the executions per target; exits 1 after the first finding, whose input is named.
set -euo pipefail
cd "$(dirname "$0")/../.."
amount=${1:-60s}
shift || true
case $amount in
  *[!0-9s]* | "" | s*) echo "usage: $0 [RUNS | SECONDSs] [TARGET...]" >&2; exit 2 ;;
  *s) limit=-max_total_time=${amount%s} ;;
  *) limit=-runs=$amount ;;
esac
for tool in clang++ cmake; do
  command -v $tool >/dev/null || { echo "$0: $tool is not installed" >&2; exit 2; }
done

cmake --preset fuzz >/dev/null
cmake --build --preset fuzz
build=build/fuzz
targets=("$@")
if [[ ${#targets[@]} -eq 0 ]]; then
  for folder in tests/fuzz/corpus/*/; do targets+=("$(basename "$folder")"); done
fi

# What the fuzzed code must not see of this machine.
unset "${!EMIT_@}"
printf '%-18s %14s %10s %8s\n' target executions 'per second' inputs
for target in "${targets[@]}"; do
  found=$build/found/$target
  log=$build/found/$target.log
  mkdir -p "$found" "$build/findings"
  if ! nice -n 19 "$build/fuzz/fuzz_$target" "$limit" -print_final_stats=1 -print_funcs=0 \
      -timeout=100 -rss_limit_mb=2048 -malloc_limit_mb=512 \
      -artifact_prefix="$build/findings/$target-" "$found" "tests/fuzz/corpus/$target" >"$log" 2>&1; then
    tail -n 40 "$log"
    echo "$target: a finding; its input is in $build/findings, all output in $log" >&2
    exit 1
  fi
  awk -v target="$target" '
    /stat::number_of_executed_units/ { runs = $2 }
    /stat::average_exec_per_sec/ { rate = $2 }
    match($0, / corp: [0-9]+/) { inputs = substr($0, RSTART + 7, RLENGTH - 7) }
    END { printf "%-18s %14d %10d %8d\n", target, runs, rate, inputs }' "$log"
done
