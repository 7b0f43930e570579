#!/usr/bin/env bash
# Makes freenect/bindings.rs again from the installed headers. Debian: apt-get install bindgen libclang-common-14-dev libfreenect-dev
set -euo pipefail
cd "$(dirname "$0")"
out=freenect/bindings.rs
header=$(dpkg-query -W -f='libfreenect-dev ${Version}' libfreenect-dev)
{
  echo "// Made by regen-freenect.sh with $(bindgen --version) from libfreenect.h and libfreenect_registration.h of $header."
  # Not every library has every function (Debian's replay library lacks 20): each is a Result of its own.
  # C may return what no enumeration lists: enumerations become numbers with names.
  printf '#include <libfreenect.h>\n#include <libfreenect_registration.h>\n' > freenect.h
  bindgen freenect.h --allowlist-function 'freenect_.*' --allowlist-var 'FREENECT_.*' --allowlist-type '_?freenect_.*' \
    --allowlist-type 'timeval|__time_t|__suseconds_t' --no-recursive-allowlist --dynamic-loading Freenect \
    --default-enum-style newtype --no-layout-tests --no-doc-comments
  rm freenect.h
} > "$out"
rustfmt --edition 2024 "$out"
