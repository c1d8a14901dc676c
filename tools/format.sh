#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Formats all C++ files of the tree; with --check only says which are not formatted.
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.."
case "${1:-}" in
  "") arguments=(-i) ;;
  --check) arguments=(--dry-run --Werror) ;;
  *) echo "usage: tools/format.sh [--check]" >&2; exit 2 ;;
esac
git ls-files -z -- '*.h' '*.cc' | xargs -0 -r -n 50 clang-format-14 "${arguments[@]}"
echo "format: $(git ls-files -- '*.h' '*.cc' | wc -l) files, done"
