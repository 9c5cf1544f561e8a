#!/usr/bin/env bash
# Looks for inputs that a reader does not survive, guided by coverage: a panic, an error of several lines, more than 10 s, more than
# 1 GiB resident or 16 GiB in all. Failing inputs are kept in target/fuzz/artifacts, and tried first the next time; the script then
# exits with 1.   run.sh [SECONDS-A-READER [READER …]]
set -euo pipefail
cd "$(dirname "$0")/../.."
PATH="$PATH:$PWD/target/tools/bin"
seconds=${1:-20}
shift || true
target=${FUZZ_TARGET:-$PWD/target/fuzz/build}
host=$(rustc -vV | sed -n 's/^host: //p')
cargo metadata --locked --format-version 1 --manifest-path tests/fuzz/Cargo.toml >/dev/null
# The stable compiler has no address sanitizer; safe code needs none.
cargo fuzz build --fuzz-dir tests/fuzz --target "$host" --target-dir "$target" --sanitizer none readers
program=$target/$host/release/readers
if [ $# -gt 0 ]; then
    names=("$@")
else
    list=$("$program" 2>/dev/null)
    mapfile -t names <<<"$list"
fi

# Each input is written to a file: in memory, where there is such a place.
memory=/dev/shm
[ -d $memory ] && [ -w $memory ] || memory=${TMPDIR:-/tmp}
TMPDIR=$(mktemp -d "$memory/fuzz.XXXXXX")
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT
ulimit -v $((16 << 20))
# The inputs that covered most in the last long run (merged by -set_cover_merge=1); `make test` reads them, too.
[ -d target/fuzz/corpus ] || { mkdir -p target/fuzz/corpus && tar -xzf tests/fuzz/corpus.tar.gz -C target/fuzz/corpus; }
found=0 total=0
for name in "${names[@]}"; do
    folder=${name//\//-}
    corpus=target/fuzz/corpus/$folder
    log=target/fuzz/$folder.log
    mkdir -p "$corpus" target/fuzz/artifacts
    export FUZZ_READER=$name FUZZ_SEEDS=$corpus
    word=ok
    for old in target/fuzz/artifacts/"$folder"-*; do
        [ -e "$old" ] || continue
        if "$program" "$old" -timeout=10 -rss_limit_mb=1024 >"$log" 2>&1; then rm "$old"; else word="FAILED on $old"; fi
    done
    "$program" "$corpus" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=1024 -max_len=8192 -dict=tests/fuzz/hostile.dict \
        -print_final_stats=1 -artifact_prefix="target/fuzz/artifacts/$folder-" >"$log" 2>&1 || word="FAILED, see $log"
    [ "$word" = ok ] || found=1
    runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log" | tail -n 1)
    total=$((total + ${runs:-0}))
    printf '%-24s %10s inputs   %s\n' "$name" "${runs:-0}" "$word"
done
printf '%-24s %10s inputs\n' "in all" "$total"
exit $found
