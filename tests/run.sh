#!/usr/bin/env bash
# Runs tests and counts those that were skipped; with shared data and a browser at hand that is a failure.
#   run.sh CARGO_ARGUMENTS
# A test that lacks something passes and prints a line `skipped: …`.
set -euo pipefail
cd "$(dirname "$0")/.."

# Names of the skipped tests, once each, from the outputs of all tests.
if cargo nextest --version >/dev/null 2>&1; then
    # Report with the outputs of passed tests: .config/nextest.toml. nextest keeps it here wherever the build is.
    outputs=target/nextest/default/junit.xml
    rm -f "$outputs"
    cargo nextest run "$@"
    heading='<testcase name="([^"]*)"'
else
    outputs=$(mktemp)
    trap 'rm -f "$outputs"' EXIT
    cargo test "$@" -- --show-output | tee "$outputs"
    heading='^---- (.*) stdout ----$'
fi
skipped=$(sed -nE "s/.*$heading.*/\1/; t name; /(^|>)skipped: /{g; p}; b; :name; h" "$outputs" | sort -u)
count=$(grep -c . <<<"$skipped" || true)
echo "$count tests were skipped${skipped:+:}${skipped:+ ${skipped//$'\n'/, }}"
if [ "$count" -ne 0 ] && [ -d ../shared/data ] && command -v chromium >/dev/null; then
    echo "../shared/data and chromium are here: no test may be skipped" >&2
    exit 1
fi
