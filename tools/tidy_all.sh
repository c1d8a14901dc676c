#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs clang-tidy 14 on every source file: before a release, since it takes long.
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.."
empty_tree=$(git hash-object -t tree /dev/null)
LOCI_TIDY_SECONDS=1000000 LOCI_TIDY_FILES=100000 exec tools/tidy_diff.sh "$empty_tree"
