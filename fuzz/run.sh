#!/bin/sh
# Builds all fuzz targets with the stable toolchain, makes their seeds, and runs each for some seconds.
# usage: fuzz/run.sh [SECONDS [TARGET...]]
set -eu
cd "$(dirname "$0")"
seconds=${1:-20}
[ $# -gt 0 ] && shift
triple=$(rustc -vV | sed -n 's/^host: //p')
# What `cargo fuzz` passes, spelt out: libFuzzer's edge counters and comparison hooks.
RUSTFLAGS="-Cpasses=sancov-module \
 -Cllvm-args=-sanitizer-coverage-level=4 \
 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
 -Cllvm-args=-sanitizer-coverage-pc-table \
 -Cllvm-args=-sanitizer-coverage-trace-compares"
export RUSTFLAGS
# A target triple keeps build scripts free of the instrumentation.
cargo build --release --target "$triple"
bin=target/$triple/release
failed=
for target in ${*:-$(sed -n 's/^path = "targets\/\(.*\)\.rs"/\1/p' Cargo.toml)}; do
  corpus=target/corpus/$target
  mkdir -p "$corpus" target/crashes
  FUZZ_SEEDS=$corpus "$bin/$target" >/dev/null 2>&1
  echo "== $target: $seconds s"
  if ! "$bin/$target" -max_total_time="$seconds" -rss_limit_mb=2048 -timeout=10 -seed=1 -max_len=8192 \
      -artifact_prefix="target/crashes/$target-" "$corpus" 2>"target/$target.log"; then
    failed="$failed $target"
    tail -n 30 "target/$target.log"
  fi
  grep -E 'stat::|Done ' "target/$target.log" | tail -n 1
done
if [ -n "$failed" ]; then
  echo "found something:$failed (inputs in fuzz/target/crashes)" >&2
  exit 1
fi
