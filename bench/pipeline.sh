#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The table of the whole pipeline: each log streamed to a server of its own, every batch durable.
#
#   bench/pipeline.sh [LOG...]      default: all in carmen/ of $LOCI_DATASETS or ../shared/datasets
#
# The sizes are those after a clean stop, with all of the map in a checkpoint: what a map has written
# before depends on when its last checkpoint was due.
set -euo pipefail
shopt -s nullglob
cd "$(dirname "$0")/.."
source bench/server.sh
logs=("$@")
if [ ${#logs[@]} -eq 0 ]; then
  data=${LOCI_DATASETS:-../shared/datasets}/carmen
  logs=("$data"/*.clf "$data"/*.clf.gz "$data"/*.clf.bz2)
  [ ${#logs[@]} -gt 0 ] || { echo "pipeline.sh: $data has no logs; skipped"; exit 0; }
fi

# area_of NAME: square metres of the grid NAME.pgm with NAME.yaml that are not unknown (205).
area_of() {
  local width height side_m known
  read -r width height < <(sed -n '2p' "$1.pgm")
  side_m=$(sed -n 's/^resolution: *//p' "$1.yaml")
  known=$(tail -c "$((width * height))" "$1.pgm" | LC_ALL=C tr -d '\315' | wc -c)
  awk -v known="$known" -v side_m="$side_m" 'BEGIN { printf "%.1f", known * side_m * side_m }'
}

echo "| log | scans | log lasts | wall | scans/s | real-time factor | server's peak memory | file: map / history / log | mapped | bytes a m2 |"
echo "|---|---|---|---|---|---|---|---|---|---|"
for log in "${logs[@]}"; do
  rm -rf "$work/data"
  start_server
  "$bin/loci" stream "$log" --map m --json > "$work/stream.json" 2> "$work/stream.err" ||
    fail "$log: $(tail -n 1 "$work/stream.err")"
  peak_kib=$(awk '/^VmHWM:/ { print $2 }' "/proc/$server_pid/status")
  "$bin/loci" export grid --map m --out "$work/grid.yaml" > /dev/null
  stop_server
  start_server
  "$bin/loci" map info m --json > "$work/info.json" || fail "$log: the map did not come back"
  stop_server
  jq -rn --slurpfile stream "$work/stream.json" --slurpfile info "$work/info.json" \
    --arg log "$(basename "$log" | sed 's/\.clf\(\.gz\|\.bz2\)\{0,1\}$//')" \
    --arg peak_kib "$peak_kib" --arg area "$(area_of "$work/grid")" '
    def rounded(digits): pow(10; digits) as $scale | . * $scale | round / $scale;
    $stream[0] as $s | $info[0].file_bytes as $bytes | ($area | tonumber) as $area_m2
    | [$log, $s.scans_sent, "\($s.log_seconds | rounded(0)) s", "\($s.seconds | rounded(1)) s",
       ($s.scans_sent / $s.seconds | rounded(0)), ($s.real_time_factor | rounded(1)),
       "\($peak_kib | tonumber / 1024 | rounded(0)) MiB",
       ([$bytes.map, $bytes.history, $bytes.log] | map(. / 1e6 | rounded(2) | tostring)
        | join(" / ") + " MB"),
       "\($area_m2 | rounded(0)) m2", ($bytes.map / $area_m2 | rounded(0))]
    | "| " + (map(tostring) | join(" | ")) + " |"'
done
