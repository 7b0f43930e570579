# Everything a person types. `make help` lists it. Each target installs what it needs and can be run again.

CARGO_FLAGS := --release --locked
NPM_INSTALL := npm ci --no-audit --no-fund --loglevel=error
RECORDING ?=
SCANS ?= 300
FUZZ_SECONDS ?= 20
export CARGO_TERM_COLOR ?= auto

.PHONY: help demo test build web lint test-rust test-drivers test-web test-browser fuzz licences accuracy bench marker-corners capture-load clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/\1|\2/p' $(MAKEFILE_LIST) | awk -F'|' '{printf "  make %-16s %s\n", $$1, $$2}'

demo: build ## scan with the simulated Kinect (or RECORDING=path), build, serve, list; DEMO_EXIT=1 stops at the end
	target/release/scan-product demo $(if $(RECORDING),--recording "$(RECORDING)")

test: ## everything: lints, unit, property, cross-crate, browser and fuzz tests
	deploy/setup.sh test
	$(MAKE) lint test-web build licences test-rust test-browser fuzz
	DEMO_EXIT=1 $(MAKE) demo
	@echo "make test: all passed"

build: web ## build both programs, the web pages inside the server
	cargo build $(CARGO_FLAGS) --bins

web: ## build the web pages into web/dist and web/dist-capture
	deploy/setup.sh build
	cd web && $(NPM_INSTALL) && npm run build

lint: web ## format, clippy, rustdoc, TypeScript and web lints, all as errors
	cargo fmt --all -- --check
	cargo clippy $(CARGO_FLAGS) --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc $(CARGO_FLAGS) --no-deps --workspace
	cd web && npm run lint && npm run check
	cd tests/e2e && $(NPM_INSTALL) && npm run lint && npm run check

test-rust: build ## unit, property, snapshot and cross-crate tests, test-drivers among them
	deploy/setup.sh test
	cd tests/gltf && $(NPM_INSTALL)
	SCAN_REQUIRE_DRIVERS=1 cargo test $(CARGO_FLAGS) --workspace

test-drivers: ## the depth cameras' real C libraries alone, on simulated sensors, recordings and dumps
	deploy/setup.sh test
	SCAN_REQUIRE_DRIVERS=1 cargo test $(CARGO_FLAGS) -p kinect

test-web: web ## the web client's own tests
	cd web && npm test

test-browser: build ## headless Chromium against the real server
	cd tests/e2e && $(NPM_INSTALL) && npm test

fuzz: ## every parser of outside bytes, FUZZ_SECONDS each
	deploy/setup.sh test
	fuzz/run.sh $(FUZZ_SECONDS)

licences: build ## licences and duplicate versions of all dependencies
	target/release/licences

accuracy: ## SCANS simulated scans judged against their truth
	cargo run $(CARGO_FLAGS) -p tests --bin accuracy -- --scans $(SCANS)

bench: ## peers and our stages side by side on the same inputs: docs/benchmarks.md (20 minutes; the first time more)
	tests/compare/side_by_side.sh

marker-corners: ## corner error on RECORDING (with truth) against its poses
	cargo run $(CARGO_FLAGS) -p tests --bin marker-corners -- "$(RECORDING)"

capture-load: ## CPU of a live picture, and of recording 30 pictures a second for a minute
	cargo run $(CARGO_FLAGS) -p tests --bin capture-load

clean: ## remove what was built
	rm -rf target fuzz/target web/dist web/dist-capture web/node_modules tests/e2e/node_modules out
