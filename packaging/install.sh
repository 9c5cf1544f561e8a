#!/usr/bin/env bash
# Installs what `cargo build --profile dist -p roomtrack` and documents.sh have made.   install.sh PREFIX
set -euo pipefail
cd "$(dirname "$0")/.."
prefix=$1

built=${CARGO_TARGET_DIR:-target}/dist
install -D -m 755 "$built/roomtrack" "$prefix/bin/roomtrack"
install -D -m 755 "$built/roomtrack-vision" "$prefix/lib/roomtrack/roomtrack-vision"
install -D -m 644 -t "$prefix/share/man/man1" target/package/man/*.1.gz
install -D -m 644 target/package/completions/bash "$prefix/share/bash-completion/completions/roomtrack"
install -D -m 644 target/package/completions/zsh "$prefix/share/zsh/site-functions/_roomtrack"
install -D -m 644 target/package/completions/fish "$prefix/share/fish/vendor_completions.d/roomtrack.fish"
install -D -m 644 -t "$prefix/share/doc/roomtrack" README.md SECURITY.md THIRD-PARTY.md LICENSE-MIT LICENSE-APACHE \
    packaging/roomtrack.service target/package/site.toml
echo "installed $prefix/bin/roomtrack"
