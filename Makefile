# make demo | test | lint | bench — each works as the first command on a fresh machine; `setup` runs before all.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup demo test lint bench

OFFICE := tests/office
DEMO   := target/demo
CARGO_TEST := $(shell cargo nextest --version >/dev/null 2>&1 && echo "cargo nextest run" || echo "cargo test")

help:
	@echo "make demo   reconstruct the office, follow everyone in it, evaluate, write a report (about 5 minutes)"
	@echo "make test   all tests"
	@echo "make lint   formatting, clippy, documentation"
	@echo "make bench  accuracy and speed on the data with ground truth"
	@echo "make setup  install what is missing (OpenCV, FFmpeg, clang; every other target does this first)"

setup:
	@./tests/setup.sh

demo: setup
	cargo build --release --locked -p recon -p tracker -p scenes
	@./tests/demo.sh $(OFFICE) $(DEMO)

test: setup
	cargo build --locked --workspace --bins --features tracker/zenoh
	$(CARGO_TEST) --locked --workspace --features tracker/zenoh

lint: setup
	cargo fmt --all --check
	cargo clippy --locked --workspace --all-targets --features tracker/zenoh -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --locked --workspace --features tracker/zenoh --no-deps --document-private-items

bench: setup
	cargo build --release --locked --workspace --bins --features tracker/zenoh
	cargo bench --locked --workspace --features tracker/zenoh
