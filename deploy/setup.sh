#!/usr/bin/env bash
# Installs what the project needs and says so. Usage: deploy/setup.sh build|test
#   build: a C compiler for SQLite and TLS        test: also Chromium, its fonts, poppler, a C++ compiler for the fuzzers,
#                                                     and the libraries of the depth cameras
# Can be run again. Installs with apt, through sudo where it is not run as root.
set -euo pipefail
what=${1:-build}

fail() { printf '\n%s\n' "$*" >&2; exit 1; }

# at_least VERSION WANTED: whether the first is not older
at_least() { [ "$(printf '%s\n%s\n' "$2" "$1" | sort -V | head -n 1)" = "$2" ]; }

rust_wanted=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
node_wanted=$(sed -n 's/.*"node": ">=\([0-9.]*\)".*/\1/p' web/package.json)

command -v cargo >/dev/null || fail "Rust is missing. Get it from https://rustup.rs (version $rust_wanted or newer), open a new shell, and run make again."
rust_found=$(rustc --version | cut -d' ' -f2)
at_least "$rust_found" "$rust_wanted" || fail "Rust $rust_found is too old, $rust_wanted is needed. Run: rustup update stable"
command -v node >/dev/null || fail "Node is missing. Get version $node_wanted or newer from https://nodejs.org, and run make again."
node_found=$(node --version | tr -d v)
at_least "$node_found" "$node_wanted" || fail "Node $node_found is too old, $node_wanted is needed. Get it from https://nodejs.org"
command -v npm >/dev/null || fail "npm is missing; it comes with Node from https://nodejs.org"

missing=()
need() { dpkg-query -W -f='${Status}' "$1" 2>/dev/null | grep -q 'install ok installed' || missing+=("$1"); }
command -v dpkg-query >/dev/null || { echo "This is not Debian: install a C compiler yourself, and for the tests chromium, poppler-utils, g++, libfreenect and OpenNI2."; exit 0; }
command -v cc >/dev/null || need gcc
need libc6-dev
if [ "$what" = test ]; then
  [ -x /usr/bin/chromium ] || need chromium
  command -v pdftoppm >/dev/null || need poppler-utils
  command -v c++ >/dev/null || need g++
  need libfreenect0.5
  need libopenni2-0
  fc-list 2>/dev/null | grep -q . || need fonts-dejavu-core
fi
if [ ${#missing[@]} -gt 0 ]; then
  echo "Installing with apt: ${missing[*]}"
  as_root=()
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || fail "Run this as root, or install sudo: apt-get install ${missing[*]}"
    as_root=(sudo)
  fi
  "${as_root[@]}" apt-get -o DPkg::Lock::Timeout=400 update -qq
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=400 install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
fi
echo "Tools: Rust $rust_found, Node $node_found; nothing else is missing."
