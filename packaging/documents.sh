#!/usr/bin/env bash
# Writes what is installed beside the program into target/package: manual pages, completions, an example of a site.
#   documents.sh
set -euo pipefail
cd "$(dirname "$0")/.."
program=${CARGO_TARGET_DIR:-target}/dist/roomtrack
out=target/package

rm -rf "$out" && mkdir -p "$out/completions"
"$program" man --out "$out/man"
gzip -9n "$out"/man/*.1
for shell in bash zsh fish; do
    "$program" completions "$shell" >"$out/completions/$shell"
done
"$program" tracker serve --example >"$out/site.toml"
gzip -9nc CHANGELOG.md >"$out/changelog.gz"
