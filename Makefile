# make demo | test | lint | bench | fuzz | docs | deb | image | install — each works as the first command on a fresh machine: `libraries` runs before
# all, `setup` before the tests.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup libraries demo test lint deny bench fuzz papers docs deb image smoke install

OFFICE := tests/office
DEMO   := target/demo
PREFIX := /usr/local
# Stations in processes of their own: in tests, lint and packages, not in the demo, whose build they would make longer.
FEATURES := --features tracker/zenoh

help:
	@echo "make demo   reconstruct the office, follow everyone in it, evaluate, write a report (one minute, after about nine of compiling)"
	@echo "make test   all tests, and how many of them were skipped"
	@echo "make lint   formatting, clippy, documentation, dependencies where cargo-deny is installed"
	@echo "make deny   licences, sources and advisories of the dependencies (installs cargo-deny; advisories need the network)"
	@echo "make bench  accuracy and speed on the data with ground truth"
	@echo "make fuzz   looks for files and packets that a reader does not survive (10 minutes after the first build, which takes longer)"
	@echo "make papers the experiments of the four papers beside their own numbers: target/papers/index.html (20 minutes, after ten of compiling)"
	@echo "make docs   the guide, as pages: target/docs/index.html"
	@echo "make deb    a Debian package: target/debian/"
	@echo "make image  an image of that package, for podman or docker"
	@echo "make smoke  both in a fresh Debian: the office end to end (about 10 minutes)"
	@echo "make install PREFIX=/usr/local   program, manual pages, completions"
	@echo "make setup  install what is missing (OpenCV, FFmpeg, clang; for the tests of pages, Chromium)"

setup: libraries
	@./tests/setup.sh browser

libraries:
	@./tests/setup.sh

demo: libraries
	cargo build --release --locked -p recon -p tracker -p scenes
	@./tests/demo.sh $(OFFICE) $(DEMO)

test: setup
	cargo build --locked --workspace --bins --tests $(FEATURES)
	@./tests/run.sh --locked --workspace --lib --bins --tests $(FEATURES)

# tests/fuzz is a workspace of its own; its lock file must follow the readers' dependencies.
lint: libraries
	cargo fmt --all --check
	cargo fmt --manifest-path tests/fuzz/Cargo.toml --check
	cargo metadata --locked --format-version 1 --manifest-path tests/fuzz/Cargo.toml >/dev/null
	cargo clippy --locked --workspace --all-targets $(FEATURES) -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --locked --workspace $(FEATURES) --no-deps --document-private-items
	@./tests/deny.sh

deny:
	@./tests/setup.sh deny
	@./tests/deny.sh advisories

bench: libraries
	cargo build --release --locked --workspace --bins $(FEATURES)
	cargo bench --locked --workspace $(FEATURES)

fuzz: libraries
	@./tests/setup.sh fuzz
	@./tests/fuzz/run.sh

papers: libraries
	cargo build --release --locked --workspace --bins --examples --benches $(FEATURES)
	target/release/examples/papers target/papers

docs:
	@./tests/setup.sh guide
	@./packaging/docs.sh

deb: libraries
	@./packaging/deb.sh

image: deb
	@./packaging/image.sh

smoke: image
	@./packaging/smoke.sh

install: libraries
	cargo build --profile dist --locked -p roomtrack
	cargo build --profile dist --locked -p roomtrack-vision
	@./packaging/documents.sh
	@./packaging/install.sh "$(DESTDIR)$(PREFIX)"
