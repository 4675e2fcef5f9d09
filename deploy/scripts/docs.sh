#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the documentation site from the repository's Markdown pages, without network, and checks every link and anchor
# of the pages and of the site. Broken ones are printed with file and line and fail the command.
# Usage: docs.sh [--out DIR] [--check-sources]
# --out DIR: folder of the site, build/site by default; it is replaced. Open its index.html, or serve the folder.
# --check-sources: checks the links of the pages and the navigation alone, and needs Python alone.
# The reference of commands comes from the program itself: EMIT_BIN names its folder, or build/*/bin has it.
set -euo pipefail
cd "$(dirname "$0")/../.."
out=build/site
arguments=()
while (($#)); do
  case $1 in
    --out)
      out=${2:?docs.sh: --out needs a folder}
      shift 2
      ;;
    --check-sources)
      arguments=(--check-sources)
      shift
      ;;
    *)
      echo "usage: docs.sh [--out DIR] [--check-sources]" >&2
      exit 2
      ;;
  esac
done
if ((${#arguments[@]} == 0)); then
  if ! command -v mkdocs >/dev/null || [[ ! -d /usr/share/mkdocs/themes/material ]]; then
    echo "docs.sh: mkdocs and mkdocs-material are missing (deploy/scripts/install_deps.sh --with-docs)" >&2
    exit 1
  fi
  emit=
  named=${EMIT_BIN:-}
  unset EMIT_BIN # the program refuses variables of this kind that it does not know
  for folder in ${named:+"$named"} build/release/bin build/ci/bin build/dev/bin; do
    if [[ -z $emit && -x $folder/emit ]]; then emit=$folder/emit; fi
  done
  arguments=(--out "$out" --emit "$emit")
fi
exec /usr/bin/python3 deploy/scripts/docs_site.py "${arguments[@]}"
