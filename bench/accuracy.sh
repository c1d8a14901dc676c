#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The accuracy table: relations error of each log, with the default settings, with places half as
# long and half as long again, and with three seeds.
#
#   bench/accuracy.sh [FOLDER WITH carmen/]      default: $LOCI_DATASETS or ../shared/datasets
set -euo pipefail
cd "$(dirname "$0")/.."
data=${1:-${LOCI_DATASETS:-../shared/datasets}}/carmen
map_log=build/release/bin/map_log
[ -x "$map_log" ] || { echo "accuracy.sh: build the release preset first: $map_log is missing" >&2; exit 1; }
[ -d "$data" ] || { echo "accuracy.sh: $data is missing; skipped"; exit 0; }

echo "| log | place length, seed | mean | max | closures | places | factor |"
echo "|---|---|---|---|---|---|---|"
for log in "$data"/*.clf.bz2; do
  name=$(basename "$log" .clf.bz2)
  relations=$data/$name.relations
  [ -f "$relations" ] || relations=$data/$name.pseudo.relations
  for variant in "5 0" "5 1" "5 2" "2.5 0" "7.5 0"; do
    read -r length seed <<<"$variant"
    "$map_log" "$log" --relations "$relations" --place-length "$length" --seed "$seed" |
      awk -v name="$name" -v length_m="$length" -v seed="$seed" '{
        for (i = 1; i < NF; ++i) { at[$i] = $(i + 1); if ($i == "mean") m = i; if ($i == "max") x = i }
        printf "| %s | %s m, %s | %s m / %s deg | %s m / %s deg | %s | %s | %s |\n", name, length_m,
          seed, $(m + 1), $(m + 3), $(x + 1), $(x + 3), at["closures"], at["places"], at["factor"] }'
  done
done
