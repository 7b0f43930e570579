#!/bin/sh
# Makes the bindings again. Needs `cargo install bindgen-cli --version 0.73.2`, libclang and the headers:
#   apt-get install libclang-dev libopenni2-dev libfreenect-dev
# The head of each file (its comment and its `allow`s) is kept, everything after its first blank line is replaced.
set -eu
cd "$(dirname "$0")"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

replace() { # FILE GENERATED
  { sed '/^$/q' "$1"; sed 1,2d "$2"; } >"$work/new.rs"
  # The layout tests at the end are ours.
  sed -n '/^#\[cfg(test)\]$/,$p' "$1" >"$work/tests.rs"
  { cat "$work/new.rs"; [ ! -s "$work/tests.rs" ] || { echo; cat "$work/tests.rs"; }; } >"$1"
}

# OniCAPI.h is no valid C: it is read as C++.
echo '#include <OniCAPI.h>' >"$work/oni.hpp"
bindgen "$work/oni.hpp" --allowlist-function 'oni.*' --allowlist-type 'Oni.*' --allowlist-var 'ONI_.*' \
  --dynamic-loading OpenNi2 --dynamic-link-require-all --no-layout-tests -o "$work/openni2.rs" \
  -- -x c++ -I/usr/include/openni2
replace openni2.rs "$work/openni2.rs"
cargo fmt -p kinect
