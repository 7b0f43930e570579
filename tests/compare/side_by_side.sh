#!/usr/bin/env bash
# Measures the peers and our stages in one run on the same inputs, one thread each, and writes docs/benchmarks.md.
# Usage: side_by_side.sh [quick|all]   (the peers' stages; needs the shared folder's compare/run.sh, and the network once)
set -euo pipefail
cd "$(dirname "$0")/../.."
peers=${SCAN_SHARED_DIR:-../shared}/compare
work=$PWD/target/compare
export COMPARE_DATA=$work/data OMP_NUM_THREADS=1
[ -x "$peers/run.sh" ] || { echo "$peers/run.sh is absent: set SCAN_SHARED_DIR to the shared folder" >&2; exit 1; }
[ -x "$work/cpp/knn" ] && [ -d "$COMPARE_DATA/pairs" ] || "$peers/run.sh" prepare
python=$work/venv/bin/python
"$python" -c 'import kiss_matcher' 2>/dev/null || "$work/venv/bin/pip" install -q kiss-matcher
[ -d "$COMPARE_DATA/tags" ] || "$python" tests/compare/tags.py "$work/py/aruco.py" "$COMPARE_DATA/tags"
[ -f "$COMPARE_DATA/syn/bunny/poisson_in.ply" ] || (cd "$work" && "$python" py/poisson.py none prep)
cargo build --release --locked -p tests --bin bench
cargo build --release --locked -p scanner --bin scan-product
bench=target/release/bench
taskset -c 0 $bench | tee "$work/ours.csv"
$bench --threads 2 | tee "$work/ours-2.csv"
program=$PWD/target/release/scan-product
views=$PWD/tests/compare/views.py
(cd "$work" && taskset -c 0 "$python" "$views" "$program" 1) | tee -a "$work/ours.csv"
(cd "$work" && "$python" "$views" "$program" 2) | tee -a "$work/ours-2.csv"
# Without -e: a peer that crashes when it ends (one does now and then) must not keep those after it from running.
sed 's/^set -eu$/set -u/' "$peers/run.sh" | COMPARE_WORK=$work bash -s -- "${1:-quick}" | tee "$work/peers.csv"
(cd "$work" && taskset -c 0 ./cpp/knn 1) | tee -a "$work/peers.csv"
taskset -c 0 "$python" tests/compare/features.py | tee -a "$work/peers.csv"
[ "${1:-quick}" = all ] || (cd "$work" && taskset -c 0 "$python" py/poisson.py o3d) | tee -a "$work/peers.csv"
for object in bunny rabbit ape horse; do
  [ "${1:-quick}" = all ] || (cd "$work" && taskset -c 0 "$python" py/o3d_recon.py "$object" adjacent)
done | tee -a "$work/peers.csv"
$bench report "$work/ours.csv" "$work/ours-2.csv" "$work/peers.csv" --out docs --date "$(date +%F)"
