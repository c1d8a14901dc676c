#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs clang-tidy 14 on the source files that differ from where this branch left main, newest first, and
# stops after a while: it says what it left out. tools/tidy_all.sh reads the whole tree.
set -euo pipefail

usage() {
  cat <<'TEXT'
usage: tools/tidy_diff.sh [BASE]

Lints the .cc files changed since BASE (a commit; default: the branch point from main, or the last
commit when this is main). LOCI_TIDY_SECONDS bounds the time (300), LOCI_TIDY_FILES the number (40).
TEXT
}
case "${1:-}" in
  -h | --help) usage; exit 0 ;;
esac

cd "$(dirname "${BASH_SOURCE[0]}")/.."
seconds_max=${LOCI_TIDY_SECONDS:-300}
files_max=${LOCI_TIDY_FILES:-40}

base=${1:-}
if [ -z "$base" ]; then
  base=$(git merge-base HEAD origin/main 2> /dev/null || git merge-base HEAD main 2> /dev/null || true)
  if [ -z "$base" ] || [ "$base" = "$(git rev-parse HEAD)" ]; then
    base=$(git rev-parse --verify --quiet HEAD~1 || true)
  fi
fi
if [ -z "$base" ]; then
  echo "tidy: no commit to compare with (a shallow clone?); nothing is linted" >&2
  exit 0
fi

mapfile -t files < <(git diff --name-only --diff-filter=d "$base" -- \
  'core/*.cc' 'storage/*.cc' 'server/*.cc' 'clients/*.cc' | xargs -r ls -t)
if [ ${#files[@]} -eq 0 ]; then
  echo "tidy: no source file differs from ${base:0:10}"
  exit 0
fi

# clang-tidy needs a database of compile commands, made for clang, and the generated headers.
cmake --preset tidy > /dev/null
cmake --build --preset tidy --target loci_generated > /dev/null

export LOCI_TIDY_END=$(($(date +%s) + seconds_max))
lint() {
  if [ "$(date +%s)" -ge "$LOCI_TIDY_END" ]; then
    echo "tidy: left out, no time: $1"
    return 0
  fi
  # A header's findings show with each file that includes it; warnings of others are not ours.
  clang-tidy-14 -p build/tidy --quiet "$1" 2> /dev/null || { echo "tidy: findings in $1"; return 1; }
}
export -f lint

echo "tidy: ${#files[@]} files differ from ${base:0:10}"
for file in "${files[@]:files_max}"; do
  echo "tidy: left out, more than $files_max files: $file"
done
printf '%s\0' "${files[@]:0:files_max}" | xargs -0 -n 1 -P "$(nproc)" bash -c 'lint "$0"'
echo "tidy: done"
