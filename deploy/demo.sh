#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Shows Loci at work: robots stream, the server is killed half way and goes on, and what came out is measured.
set -euo pipefail

usage() {
  cat <<'TEXT'
usage: deploy/demo.sh [LOG]

Installs what is missing, builds the preset `release`, and in a temporary folder
  starts locid, streams two simulated robots in one building (or the CARMEN log LOG), kills the server
  with SIGKILL half way, starts it again, lets the robots resume;
  checks that every acknowledged number is there and that a replay of the log gives the served digest;
  draws the map, and measures trajectory and occupancy against the simulation's truth.
The last line is a summary; the exit code is 0 only if every figure is good. On a terminal the server and
its viewer page stay open until Enter. LOCI_DEMO_KEEP=DIR leaves map, picture and figures in DIR.
TEXT
}

log=
case "${1:-}" in
  -h | --help) usage; exit 0 ;;
  -*) usage >&2; exit 2 ;;
  "") ;;
  *) log=$(realpath -e -- "$1") || { echo "demo: no such log: $1" >&2; exit 1; } ;;
esac
if [ $# -gt 1 ]; then
  usage >&2
  exit 2
fi

scenario=office
# What a good run reaches.
trajectory_rms_max_m=0.10
occupied_iou_min=0.60
# So long the streaming takes, if the machine keeps up: time enough to kill the server in the middle.
stream_s=15

cd "$(dirname "${BASH_SOURCE[0]}")/.."
./deploy/setup.sh
cmake --preset release > /dev/null
cmake --build --preset release --parallel "${LOCI_JOBS:-$(nproc)}" --target locid loci
bin=$PWD/build/release/bin
map=demo

work=$(mktemp -d "${TMPDIR:-/tmp}/loci-demo.XXXXXX")
server_pid=
replay_pid=
stream_pids=()
clean_up() {
  for pid in "${stream_pids[@]}" $server_pid $replay_pid; do
    kill "$pid" 2> /dev/null || true
  done
  wait 2> /dev/null || true
  if [ -n "${LOCI_DEMO_KEEP:-}" ]; then
    mkdir -p "$LOCI_DEMO_KEEP"
    cp -r "$work"/. "$LOCI_DEMO_KEEP"
  fi
  rm -rf "$work"
}
trap clean_up EXIT
trap 'exit 130' INT TERM

say() { echo "demo: $*"; }
fail() {
  say "FAILED: $*"
  tail -n 5 "$work/locid.log" >&2 || true
  exit 1
}

# start_server RPC HTTP: sets server_pid, LOCI_SERVER and http to where it really listens.
start_server() {
  : > "$work/locid.out"
  "$bin/locid" --data "$work/data" --listen "$1" --http "$2" > "$work/locid.out" 2>> "$work/locid.log" &
  server_pid=$!
  for _ in $(seq 100); do
    if grep -q '^listening ' "$work/locid.out"; then
      LOCI_SERVER=$(sed -n 's/^listening rpc=\([^ ]*\).*/\1/p' "$work/locid.out")
      http=$(sed -n 's/^listening .*http=\([^ ]*\).*/\1/p' "$work/locid.out")
      export LOCI_SERVER
      return
    fi
    kill -0 "$server_pid" 2> /dev/null || fail "locid did not start: $(tail -n 1 "$work/locid.log")"
    sleep 0.1
  done
  fail "locid did not listen within 10 s"
}

# Observations that the server has made durable, in all sessions.
durable_count() {
  "$bin/loci" session list --map "$map" --json 2> /dev/null |
    jq '[.sessions[] | (.last_durable_number // 0 | tonumber)] | add // 0' 2> /dev/null || echo 0
}

# stream SESSION ROBOT LOG [ARGUMENTS...]: plays LOG in the background; the answer goes to stream-SESSION.
stream() {
  local session=$1 robot=$2 file=$3
  shift 3
  "$bin/loci" stream "$file" --map "$map" --robot "$robot" --session "$session" --json "$@" \
    > "$work/stream-$session" 2> "$work/$session.err" &
  stream_pids+=($!)
}

uncompressed() {
  case "$1" in
    *.gz) gzip -dc -- "$1" ;;
    *.bz2) bzip2 -dc -- "$1" ;;
    *) cat -- "$1" ;;
  esac
}

# "SCANS SECONDS" of a CARMEN log; the third field from the end is a scan's stamp.
extent_of() {
  uncompressed "$1" | awk '/^(FLASER|ROBOTLASER1) / {
      if (scans++ == 0) first = $(NF - 2)
      last = $(NF - 2)
    }
    END { printf "%d %d\n", scans, last - first }'
}

# The multiple of real time at which so many seconds are played in `stream_s`.
speed_for() { echo $((1 + $1 / stream_s)); }

start_server tcp://127.0.0.1:0 127.0.0.1:0
say "locid listens on $LOCI_SERVER, viewer on http://$http/#$map"
"$bin/loci" map create "$map" > /dev/null

sessions=()
scans=0
if [ -n "$log" ]; then
  sessions=(demo-1)
  read -r scans seconds < <(extent_of "$log")
  [ "$scans" -gt 0 ] || fail "$log has no scan (FLASER or ROBOTLASER1)"
  speed=$(speed_for "$seconds")
  stream demo-1 robot "$log" --speed "$speed"
else
  "$bin/loci" simulate "$scenario" --out "$work/truth" > /dev/null
  jq -r '.runs[] | "\(.session) \(.robot) \(.log) \(.truth) \(.scans)
    \(.start | map(tostring) | join(","))" | gsub("\\s+"; " ")' \
    "$work/truth/scenario.json" > "$work/sessions.txt"
  speed=$(speed_for "$(jq '[.runs[].seconds] | max | floor' "$work/truth/scenario.json")")
  while read -r session robot file _ count start; do
    sessions+=("$session")
    scans=$((scans + count))
    stream "$session" "$robot" "$work/truth/$file" --start "$start" \
      --speed "$speed"
  done < "$work/sessions.txt"
fi
say "streaming $scans scans of ${#sessions[@]} robot(s) at $speed times real time"

# Half way: the server is killed in the middle of whatever it does.
until [ "$(durable_count)" -ge $((scans / 2)) ]; do
  running=0
  for pid in "${stream_pids[@]}"; do
    kill -0 "$pid" 2> /dev/null && running=1
  done
  if [ "$running" = 0 ]; then
    cat "$work"/*.err >&2
    fail "the robots ended before half of their scans were durable"
  fi
done
before_kill=$(durable_count)
kill -KILL "$server_pid"
wait "$server_pid" 2> /dev/null || true
say "killed the server with SIGKILL after $before_kill durable observations"
start_server "$LOCI_SERVER" "$http"
say "started it again; the robots resume"

index=0
for pid in "${stream_pids[@]}"; do
  session=${sessions[$index]}
  wait "$pid" || { cat "$work/$session.err" >&2; fail "session $session ended with an error"; }
  index=$((index + 1))
done
stream_pids=()

# Every number that a robot was told to be durable must be in the map, accepted or refused.
acknowledged=0
interruptions=0
"$bin/loci" session list --map "$map" --json > "$work/sessions.json"
for session in "${sessions[@]}"; do
  told=$(jq '.last_durable_number | tonumber' "$work/stream-$session")
  there=$(jq --arg name "$session" '.sessions[] | select(.session == $name) |
    (.accepted_count // 0 | tonumber) + (.refused_count // 0 | tonumber)' "$work/sessions.json")
  [ "$told" = "$there" ] ||
    fail "$session was told that $told observations are durable, the map has $there"
  acknowledged=$((acknowledged + told))
  interruptions=$((interruptions + $(jq '.interruptions | tonumber' "$work/stream-$session")))
done
[ "$acknowledged" -ge "$before_kill" ] || fail "$before_kill were durable before the kill, $acknowledged after"
[ "$interruptions" -ge 1 ] || fail "no robot noticed the kill"
say "all $acknowledged acknowledged observations are in the map"

"$bin/loci" map verify "$map" --json > "$work/verify.json" || fail "loci map verify found damage"
"$bin/loci" map info "$map" --json > "$work/info.json"
served=$(jq -r .state_digest "$work/info.json")

# Another server gets the log alone, without checkpoints: it has to make the map from nothing.
mkdir "$work/replay"
sqlite3 "$work/data/$map.loci" ".backup $work/replay/$map.loci"
sqlite3 "$work/replay/$map.loci" \
  'DELETE FROM checkpoint; DELETE FROM record; DELETE FROM blob;'
"$bin/locid" --data "$work/replay" --listen tcp://127.0.0.1:0 --http off \
  > "$work/replay.out" 2>> "$work/locid.log" &
replay_pid=$!
until grep -q '^listening ' "$work/replay.out"; do
  kill -0 "$replay_pid" 2> /dev/null || fail "the server of the replay did not start"
  sleep 0.1
done
replay_server=$(sed -n 's/^listening rpc=\([^ ]*\).*/\1/p' "$work/replay.out")
until "$bin/loci" map info "$map" --server "$replay_server" --json > "$work/replay.json" 2> "$work/replay.err"; do
  grep -q UNAVAILABLE "$work/replay.err" || fail "replay: $(cat "$work/replay.err")"
  sleep 0.2
done
kill "$replay_pid"
wait "$replay_pid" 2> /dev/null || true
replay_pid=
replayed=$(jq -r .state_digest "$work/replay.json")
[ "$served" = "$replayed" ] || fail "the map is $served, a replay of its log gives $replayed"
say "a replay of all $(jq -r .last_event "$work/info.json") events gives the served digest $served"

"$bin/loci" render --map "$map" --layer occupancy --out "$work/map.png" > /dev/null
"$bin/loci" export trajectory --map "$map" --format tum --out "$work/trajectory.tum" > /dev/null
"$bin/loci" export grid --map "$map" --out "$work/map.yaml" > /dev/null
closures=$(jq -r '.closures // 0' "$work/info.json")
summary="$acknowledged observations, killed once, 0 lost, replay equal, $closures closures"
if [ -z "$log" ]; then
  errors=()
  while read -r session _ _ truth _; do
    "$bin/loci" export trajectory --map "$map" --session "$session" --out "$work/$session.tum" \
      > /dev/null
    "$bin/loci" eval trajectory "$work/$session.tum" "$work/truth/$truth" --json \
      > "$work/eval-$session.json"
    errors+=("$work/eval-$session.json")
  done < "$work/sessions.txt"
  error=$(jq -s 'map(.translation_m.rms) | max' "${errors[@]}")
  plan=$work/truth/$(jq -r .floor_plan "$work/truth/scenario.json")
  iou=$("$bin/loci" eval grid "$work/map.yaml" "$plan" --json | jq .iou)
  say "trajectory error against the truth: rms $(printf '%.3f' "$error") m (worst robot); occupied cells: IoU $(printf '%.3f' "$iou")"
  jq -e -n "$error <= $trajectory_rms_max_m" > /dev/null ||
    fail "trajectory error $error m, must be at most $trajectory_rms_max_m m"
  jq -e -n "$iou >= $occupied_iou_min" > /dev/null ||
    fail "occupied IoU $iou, must be at least $occupied_iou_min"
  summary="$summary, trajectory rms $(printf '%.3f' "$error") m, occupied IoU $(printf '%.2f' "$iou")"
fi

picture=$work/map.png
if [ -n "${LOCI_DEMO_KEEP:-}" ]; then
  picture=$LOCI_DEMO_KEEP/map.png
fi
say "picture of the map: $picture"
if [ -t 0 ] && [ -t 1 ]; then
  say "viewer: http://$http/#$map   (Enter ends the demo and removes $work)"
  read -r _ || true
fi
echo "demo: OK: $summary"
