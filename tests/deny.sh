#!/usr/bin/env bash
# Checks the dependencies' licences, versions and sources against deny.toml, without the network.   deny.sh
# And their advisories, whose data base is fetched.   deny.sh advisories
set -euo pipefail
cd "$(dirname "$0")/.."
PATH="$PATH:$PWD/target/tools/bin"
if ! command -v cargo-deny >/dev/null; then
    echo "skipped: cargo-deny is not installed (make deny installs it)"
    exit 0
fi
cargo deny --locked --offline check licenses bans sources
[ "${1:-}" != advisories ] || cargo deny --locked check advisories
