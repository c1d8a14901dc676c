# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# A server with a folder of its own, for benchmarks that go over the wire. To be sourced in the source
# folder under `set -euo pipefail`; gives $bin, $work, fail, start_server and stop_server.

name=$(basename "$0")
bin=$PWD/build/release/bin
for program in locid loci; do
  [ -x "$bin/$program" ] || { echo "$name: build the release preset first: $bin/$program is missing" >&2; exit 1; }
done
command -v jq > /dev/null || { echo "$name: jq is missing: ./deploy/setup.sh" >&2; exit 1; }

work=$(mktemp -d "${TMPDIR:-/tmp}/loci-bench.XXXXXX")
server_pid=
clean_up() {
  [ -z "$server_pid" ] || kill "$server_pid" 2> /dev/null || true
  wait 2> /dev/null || true
  rm -rf "$work"
}
trap clean_up EXIT
trap 'exit 130' INT TERM

fail() {
  echo "$name: $*" >&2
  cat "$work/locid.log" >&2
  exit 1
}

# Starts it with the maps in $work/data, on free ports.
start_server() {
  : > "$work/locid.out"
  "$bin/locid" --data "$work/data" --listen tcp://127.0.0.1:0 --http off \
    > "$work/locid.out" 2> "$work/locid.log" &
  server_pid=$!
  until grep -q '^listening ' "$work/locid.out"; do
    kill -0 "$server_pid" 2> /dev/null || fail "the server did not start"
    sleep 0.05
  done
  LOCI_SERVER=$(sed -n 's/^listening rpc=\([^ ]*\).*/\1/p' "$work/locid.out")
  export LOCI_SERVER
}

stop_server() {
  kill -TERM "$server_pid"
  wait "$server_pid" || fail "the server did not stop cleanly"
  server_pid=
}
