#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The table of simulated buildings: each scenario's runs are streamed one after the other to a server of
# their own, each from its true start, and the map is held against the truth.
#
#   bench/simulated.sh [SCENARIO...]      default: all of `loci simulate --help`
set -euo pipefail
cd "$(dirname "$0")/.."
source bench/server.sh
scenarios=("$@")
[ ${#scenarios[@]} -gt 0 ] || scenarios=(office office-days loop self-similar long-corridor)

echo "| scenario | rms as it is | rms aligned | closures | IoU where known | IoU everywhere |"
echo "|---|---|---|---|---|---|"
for scenario in "${scenarios[@]}"; do
  rm -rf "$work/truth" "$work/data"
  "$bin/loci" simulate "$scenario" --out "$work/truth" > /dev/null
  start_server
  jq -r '.runs[] | [.session, .robot, .log, .truth, (.start | map(tostring) | join(","))] | @tsv' \
    "$work/truth/scenario.json" > "$work/runs.tsv"
  while IFS=$'\t' read -r session robot log _ start; do
    "$bin/loci" stream "$work/truth/$log" --map m --robot "$robot" --session "$session" "--start=$start" \
      > /dev/null 2> "$work/stream.err" || fail "$scenario: $(tail -n 1 "$work/stream.err")"
  done < "$work/runs.tsv"
  : > "$work/runs.json"
  while IFS=$'\t' read -r session _ _ truth _; do
    "$bin/loci" export trajectory --map m --session "$session" --out "$work/run.tum" > /dev/null
    "$bin/loci" eval trajectory "$work/run.tum" "$work/truth/$truth" --json >> "$work/runs.json"
  done < "$work/runs.tsv"
  "$bin/loci" export grid --map m --out "$work/grid.yaml" > /dev/null
  "$bin/loci" eval grid "$work/grid.yaml" "$work/truth/$(jq -r .floor_plan "$work/truth/scenario.json")" --json \
    > "$work/grid.json"
  "$bin/loci" map info m --json > "$work/info.json"
  jq -rn --arg scenario "$scenario" --slurpfile runs "$work/runs.json" --slurpfile grid "$work/grid.json" \
    --slurpfile info "$work/info.json" '
    def rounded: . * 1000 | round / 1000;
    def rms(part): [$runs[] | part | rounded | tostring] | join(", ") + " m";
    [$scenario, rms(.translation_m.rms), rms(.aligned_translation_m.rms), $info[0].closures,
     ($grid[0].iou | rounded), ($grid[0].iou_everywhere | rounded)]
    | "| " + (map(tostring) | join(" | ")) + " |"'
  stop_server
done
