#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The table "From any start" of docs/benchmarks.md: `loci graph optimize` on every public graph.
#
#   bench/graph_optima.sh [DATASETS]    default: LOCI_DATASETS, or ../shared/datasets
#
# Needs the preset release. chi2 is that of the data sets' judge (eval/chi2.py beside them).
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.."
datasets=${1:-${LOCI_DATASETS:-../shared/datasets}}
[ -x build/release/bin/loci ] || { echo "graph_optima.sh: build the release preset first" >&2; exit 1; }
[ -d "$datasets/graphs" ] || { echo "graph_optima.sh: $datasets/graphs is missing; skipped"; exit 0; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

row() {
  local name=$1 best=$2 file=$3 user
  TIMEFORMAT=%U
  user=$( { time build/release/bin/loci graph optimize "$datasets/$file" --out "$folder/out.g2o" \
    --json > "$folder/report.json"; } 2>&1)
  python3 "$datasets/../eval/chi2.py" "$folder/out.g2o" --json > "$folder/judged.json"
  python3 - "$name" "$best" "$user" "$folder/report.json" "$folder/judged.json" << 'PYTHON'
import json, sys
name, best, user, report, judged = sys.argv[1:]
report, chi2 = json.load(open(report)), json.load(open(judged))["chi2"]
attempts = ", ".join(f"{a['start']} {a['chi2_after']:.6g}" for a in report["attempts"])
print(f"| {name} | {report['poses']} / {report['constraints']} | {best} | {chi2:#.6g} | {attempts} | {user} |")
PYTHON
}

echo "| graph | poses / constraints | best known | Loci | the starts, and where they led | seconds |"
echo "|---|---|---|---|---|---|"
row intel_g2o 546.461 graphs/intel_g2o.g2o.gz
row intel 45.0047 graphs/intel.g2o.gz
row INTEL_carlone 215.837 graphs/INTEL_carlone.g2o.gz
row MIT 41.1633 graphs/MIT.g2o.gz
row CSAIL 40.5551 graphs/CSAIL.g2o.gz
row M3500 137.913 graphs/M3500.g2o.gz
row M3500a 912.115 graphs/M3500a.g2o.gz
row manhattanOlson3500 146.077 graphs/manhattanOlson3500.g2o.gz
row city10000 511.985 graphs/city10000.g2o.gz
row sphere2500 727.150 graphs/sphere2500.g2o.gz
row parking-garage 1.23869 graphs/parking-garage.g2o.gz
row smallGrid3D 458.154 graphs/smallGrid3D.g2o.gz
row cityTrees10000 8668.93 graphs/cityTrees10000.txt.gz
row victoriaPark 6184.12 graphs/victoriaPark.txt.gz
row victoriaPark-full 389.787 victoria_park/victoriaPark-full.g2o.gz
