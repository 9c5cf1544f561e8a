#!/usr/bin/env bash
# Builds the guide as pages: target/docs/index.html.   docs.sh
set -euo pipefail
cd "$(dirname "$0")/.."
export PATH="$PATH:$PWD/target/tools/bin"

# The drawings' script is put beside a copy of the sources.
sources=target/docs-sources
rm -rf "$sources" target/docs
cp -r docs "$sources"
mdbook-mermaid install "$sources"
mdbook build "$sources" --dest-dir "$PWD/target/docs"
echo "target/docs/index.html"
