#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the packages, builds the `release` preset and runs every test. One command, fresh clone to result.
set -euo pipefail

usage() {
  cat <<'TEXT'
usage: deploy/test.sh [CTEST ARGUMENTS...]

Installs what is missing, builds the preset `release` into build/release and runs every test there.
Arguments go to ctest: deploy/test.sh -L unit, deploy/test.sh -R Store. LOCI_JOBS sets how many run at once.
TEXT
}
case "${1:-}" in
  -h | --help) usage; exit 0 ;;
esac

cd "$(dirname "${BASH_SOURCE[0]}")/.."
jobs=${LOCI_JOBS:-$(nproc)}

./deploy/setup.sh
cmake --preset release
cmake --build --preset release --parallel "$jobs"
ctest --preset release --parallel "$jobs" "$@"
