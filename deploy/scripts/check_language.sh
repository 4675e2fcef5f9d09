#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Counts what is hard to read in comments and documents, and compares with deploy/scripts/language_limits.txt:
#   fragments   documentation blocks (/// or //) of C++ and GLSL that begin with a dangling word such as "Of" or "By"
#   long_lines  lines over 120 columns in *.md, without the generated config/README.md
#   long_cells  table cells over 25 words in *.md
# The numbers only fall: a count above its limit fails, and so does one that is well below it, until the limit follows.
# Fails also where a document names a file or folder of the repository that does not exist.
# Usage: check_language.sh [--list | --update]
# --list prints every place with file and line. --update lowers the limits to what is there; it raises none.
set -euo pipefail
cd "$(dirname "$0")/../.."
limits=deploy/scripts/language_limits.txt
slack=5 # a count this far below its limit may wait for the next --update

mode=${1:-}
case $mode in
  '' | --list | --update) ;;
  *)
    echo "usage: check_language.sh [--list | --update]" >&2
    exit 2
    ;;
esac

sources() { git ls-files -co --exclude-standard -- '*.hpp' '*.cpp' '*.h' '*.glsl' '*.comp' '*.frag' '*.vert'; }
documents() { git ls-files -co --exclude-standard -- '*.md'; }
existing() { while IFS= read -r file; do if [[ -f $file ]]; then printf '%s\0' "$file"; fi; done; }

# A block is a run of lines that hold nothing but a comment. Prints "total N" and FILE:LINE: FIRST LINE of fragments.
blocks=$(sources | existing | xargs -0 awk '
  BEGIN {
    count = split("Of By That What Where Whose How As Than Behind Way With Without For In At On From Until While Because",
                  words, " ")
    for (i = 1; i <= count; ++i) dangling[words[i]] = 1
  }
  FNR == 1 { inside = 0 }
  /^[ \t]*\/\/.*SPDX-License-Identifier/ { next }
  /^[ \t]*\/\// {
    if (inside) next
    text = $0
    sub(/^[ \t]*\/\/[\/!]?<?[ \t]*/, "", text)
    if (text == "") next
    inside = 1
    ++total
    first = text
    sub(/[^A-Za-z].*/, "", first)
    if (first in dangling) print FILENAME ":" FNR ": " text
    next
  }
  { inside = 0 }
  END { print "total " total }')
fragments=$(grep -v '^total ' <<<"$blocks" || true)
total=$(awk '/^total / {sum += $2} END {print sum + 0}' <<<"$blocks")

long_lines=$(documents | grep -v '^config/README\.md$' | existing |
  xargs -0 awk 'length($0) > 120 {print FILENAME ":" FNR ": " length($0) " columns"}')

long_cells=$(documents | existing | xargs -0 awk '
  FNR == 1 { fenced = 0 }
  /^[ \t]*```/ { fenced = !fenced }
  !fenced && /^[ \t]*\|/ {
    line = $0
    gsub(/\\\|/, "", line)
    cells = split(line, cell, "|")
    for (i = 1; i <= cells; ++i) {
      words = split(cell[i], word, /[ \t]+/)
      for (w = 1; w in word; ++w) if (word[w] == "") --words
      if (words > 25) print FILENAME ":" FNR ": a cell of " words " words"
    }
  }')

# Names in backticks that look like something of the repository, as FILE:LINE:NAME:
# - below a folder that stands at the top of the repository: the very path, wildcards allowed;
# - ending like a source file: the end of some path;
# - links in parentheses: relative to the document.
names=$(documents | existing | xargs -0 awk '
  FNR == 1 { fenced = 0 }
  /^[ \t]*```/ { fenced = !fenced; next }
  fenced { next }
  {
    rest = $0
    while (match(rest, /`[^` ]+`/)) {
      name = substr(rest, RSTART + 1, RLENGTH - 2)
      rest = substr(rest, RSTART + RLENGTH)
      if (name ~ /[<>$]|\/[A-Z]+(\/|$)/) continue # a placeholder such as NAME
      if (name ~ /^(\.ci|config|deploy|protocol|renderer|server|tests)\//) print FILENAME ":" FNR ":path:" name
      else if (name ~ /^[A-Za-z0-9_.\/-]+\.(cpp|hpp|glsl|glsl\.h|comp|frag|vert|sh|proto|cmake)$/)
        print FILENAME ":" FNR ":end:" name
    }
    rest = $0
    while (match(rest, /\]\([^) ]+\)/)) {
      name = substr(rest, RSTART + 2, RLENGTH - 3)
      rest = substr(rest, RSTART + RLENGTH)
      sub(/#.*/, "", name)
      if (name != "" && name !~ /^[a-z]+:/) print FILENAME ":" FNR ":link:" name
    }
  }')
shopt -s nullglob
missing=
while IFS=: read -r file line kind name; do
  folder=.
  if [[ $file == */* ]]; then folder=${file%/*}; fi
  # shellcheck disable=SC2206 # unquoted, because names hold wildcards
  case $kind in
    path) matches=($name) ;;
    link) matches=("$folder"/$name) ;;
    *) continue ;;
  esac
  if ((${#matches[@]} == 0)) || [[ ! -e ${matches[0]} ]]; then missing+="$file:$line: $name does not exist"$'\n'; fi
done <<<"$names"
# Ends of paths: every path is known by all of its ends.
missing+=$({ git ls-files -co --exclude-standard; echo "--"; printf '%s\n' "$names"; } | awk -F: '
  $0 == "--" { listed = 1; next }
  !listed {
    path = $0
    known[path] = 1
    while (sub(/^[^\/]*\//, "", path)) known[path] = 1
    next
  }
  $3 == "end" && !($4 in known) { print $1 ":" $2 ": " $4 " does not exist" }')

count() { if [[ -n $1 ]]; then wc -l <<<"$1"; else echo 0; fi; }
declare -A counts=([fragments]=$(count "$fragments") [long_lines]=$(count "$long_lines")
  [long_cells]=$(count "$long_cells"))
order=(fragments long_lines long_cells)

if [[ $mode == --list ]]; then
  for each in "$fragments" "$long_lines" "$long_cells"; do
    if [[ -n $each ]]; then printf '%s\n' "$each"; fi
  done
fi

failed=false
declare -A lowered=()
for name in "${order[@]}"; do
  now=${counts[$name]}
  limit=$(awk -v name="$name" '$1 == name {print $2}' "$limits")
  if [[ ! $limit =~ ^[0-9]+$ ]]; then
    echo "check_language: $limits has no limit for $name" >&2
    exit 2
  fi
  lowered[$name]=$((now < limit ? now : limit))
  echo "check_language: $name $now, limit $limit$([[ $name == fragments ]] && echo " ($total blocks)" || true)"
  if ((now > limit)); then
    echo "check_language: $name grew from $limit to $now; deploy/scripts/check_language.sh --list shows where"
    failed=true
  elif ((now < limit - slack)) && [[ $mode != --update ]]; then
    echo "check_language: $name fell to $now; lower its limit: deploy/scripts/check_language.sh --update"
    failed=true
  fi
done
if [[ $mode == --update ]]; then
  {
    grep '^#' "$limits"
    for name in "${order[@]}"; do echo "$name ${lowered[$name]}"; done
  } >"$limits.new"
  mv "$limits.new" "$limits"
fi
if [[ -n $missing ]]; then
  printf '%s\n' "${missing%$'\n'}"
  failed=true
fi
if $failed; then exit 1; fi
