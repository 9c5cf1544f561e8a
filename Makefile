# make demo | test | lint | bench — each works as the first command on a fresh machine; `setup` runs before all.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup demo test lint bench

OFFICE := tests/office
DEMO   := target/demo
# Stations in processes of their own: in tests, lint and packages, not in the demo, whose build they would make longer.
FEATURES := --features tracker/zenoh
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
	cargo build --locked --workspace --bins $(FEATURES)
	$(CARGO_TEST) --locked --workspace $(FEATURES)

lint: setup
	cargo fmt --all --check
	cargo clippy --locked --workspace --all-targets $(FEATURES) -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --locked --workspace $(FEATURES) --no-deps --document-private-items

bench: setup
	cargo build --release --locked --workspace --bins $(FEATURES)
	cargo bench --locked --workspace $(FEATURES)
