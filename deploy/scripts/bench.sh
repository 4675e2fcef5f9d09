#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the packages, builds the release preset, runs every benchmark of this machine's device and
# writes into one folder bench.json (all results), bench.md (their tables, for a README), diagrams as SVG
# and JSON, table and log of each suite.
# Usage: bench.sh [--quick] [--no-install] [--out DIR] [SUITE]...
# --quick: fewer frames and smaller scenes, to see that all is well; such figures are no measurement.
# --no-install: the packages are there already (a machine without network).
# --out DIR: default out/bench in the repository, wherever this is called from.
# SUITE: default all. Exits 1 when one failed: bench.json has it and its exit code under "failed",
# bench.md in its heading; the others' results are written all the same. 130: interrupted.
set -euo pipefail
out=
quick=false
install=true
suites=()
while (($#)); do
  case $1 in
    --quick) quick=true ;;
    --no-install) install=false ;;
    --out)
      out=${2:?bench.sh: --out needs a folder}
      shift
      ;;
    --help | -h)
      sed -n '3,13s/^# \{0,1\}//p' "$0"
      exit 0
      ;;
    -*)
      echo "bench.sh: unknown option $1" >&2
      exit 2
      ;;
    *) suites+=("$1") ;;
  esac
  shift
done
if [[ -n $out ]]; then out=$(realpath -m "$out"); fi
cd "$(dirname "$0")/../.."
out=${out:-$PWD/out/bench}
known=(paper error-vs-time scaling crowd turn live budget thermal-truth convergence subpixel gas clutter uncertainty stability stream isolation)
if ((${#suites[@]} == 0)); then suites=("${known[@]}"); fi
for suite in "${suites[@]}"; do
  if [[ " ${known[*]} " != *" $suite "* ]]; then
    echo "bench.sh: no suite '$suite': ${known[*]}" >&2
    exit 2
  fi
done

arguments() { # of a suite, when quick
  case $1 in
    paper) echo "--scene box --steps 27 --frames 5 --no-errors" ;;
    error-vs-time) echo "--quick --scene ribbed --frames 1 --rays 64 --refine 0.5 --pixels 200" ;;
    scaling) echo "--quick --pairs 15 --per-frame-frames 1" ;;
    crowd) echo "--instances 100 --pairs 15 --set thermal.tolerance_k=5 --set thermal.steps=3" ;;
    turn) echo "--runs 1 --frames 20 --set thermal.tolerance_k=5" ;;
    live) echo "--seconds 2 --rate 10 --every 1 --set thermal.tolerance_k=5" ;;
    budget) echo "--frames 30 --set thermal.tolerance_k=5" ;;
    thermal-truth) echo "--width 64 --height 48 --steps 9" ;;
    subpixel) echo "--phases 10 --pairs 15" ;;
    gas) echo "--pairs 15 --set thermal.tolerance_k=50" ;;
    clutter) echo "--scenario box --pairs 15 --set thermal.tolerance_k=50 --set thermal.steps=3" ;;
    uncertainty) echo "box --set thermal.tolerance_k=10 --set thermal.steps=9" ;;
    stability) echo "--cases 100000 --part equilibrium" ;;
    stream) echo "--frames 300 --repeats 1" ;;
    isolation) echo "--pairs 2" ;;
  esac
}

if $install; then deploy/scripts/install_deps.sh --with-yardsticks; fi
cmake --preset release
cmake --build --preset release --target emit emit_lab emitd config_data emit_scenes emit_logs
mkdir -p "$out"
rm -f "$out"/bench.{json,md} # of an earlier run: this one may be interrupted
# Without it a suite that ends in good order on Ctrl-C is followed by the next.
trap 'exit 130' INT TERM
declare -A exit_codes=()
for suite in "${suites[@]}"; do
  more=()
  if $quick; then read -r -a more <<<"$(arguments "$suite")"; fi
  case $suite in
    error-vs-time | convergence) more+=(--plot "$out/$suite.svg") ;;
  esac
  rm -f "$out/$suite".{json,svg}
  echo "== bench $suite ${more[*]}"
  code=0
  build/release/bin/emit bench "$suite" --json "$out/$suite.json" "${more[@]}" \
    >"$out/$suite.txt" 2>"$out/$suite.log" || code=$?
  if ((code)); then
    tail -n 5 "$out/$suite.log" >&2
    exit_codes[$suite]=$code
  fi
done

{
  echo "# Benchmarks"
  echo
  for suite in "${suites[@]}"; do
    code=${exit_codes[$suite]:-}
    echo "## emit bench $suite${code:+ (failed: exit $code)}"
    if [[ -s $out/$suite.txt ]]; then
      printf '```\n%s\n```\n\n' "$(cat "$out/$suite.txt")"
    else
      printf 'no result\n\n'
    fi
    if [[ -s $out/$suite.svg ]]; then printf '![%s](%s.svg)\n\n' "$suite" "$suite"; fi
  done
} >"$out/bench.md"
{
  echo "{"
  echo "  \"host\": \"$(uname -srm)\","
  echo "  \"cores\": $(nproc),"
  echo "  \"quick\": $quick,"
  printf '  "failed": ['
  separator=""
  for suite in "${suites[@]}"; do
    [[ -v exit_codes[$suite] ]] || continue
    printf '%s{"suite": "%s", "exit_code": %d}' "$separator" "$suite" "${exit_codes[$suite]}"
    separator=", "
  done
  echo "],"
  echo "  \"suites\": ["
  separator=""
  for suite in "${suites[@]}"; do
    [[ -s $out/$suite.json ]] || continue
    printf '%s' "$separator"
    sed 's/^/    /' "$out/$suite.json"
    separator=","
  done
  echo "  ]"
  echo "}"
} >"$out/bench.json"
echo "written: $out/bench.json, $out/bench.md"
if ((${#exit_codes[@]})); then
  echo "bench.sh: failed: ${!exit_codes[*]}" >&2
  exit 1
fi
