#!/usr/bin/env bash
# Looks for inputs that a reader does not survive, guided by coverage: a panic, an error of several lines, more than 10 s, more than
# 1 GiB. What it finds is in target/fuzz/artifacts, and ends it with status 1.   run.sh [SECONDS-A-READER [READER …]]
set -euo pipefail
cd "$(dirname "$0")/../.."
PATH="$PATH:$PWD/target/tools/bin"
seconds=${1:-20}
shift || true
target=${FUZZ_TARGET:-$PWD/target/fuzz/build}
# The stable compiler has no address sanitizer; safe code needs none.
cargo fuzz build --fuzz-dir tests/fuzz --target-dir "$target" --sanitizer none readers
program=$(find "$target" -path '*/release/readers' -type f | head -n 1)
if [ $# -gt 0 ]; then names=("$@"); else mapfile -t names < <("$program" 2>/dev/null); fi

shm=/dev/shm
[ -d $shm ] && [ -w $shm ] && export TMPDIR=$shm
found=0 total=0
for name in "${names[@]}"; do
    folder=${name//\//-}
    corpus=target/fuzz/corpus/$folder
    mkdir -p "$corpus" target/fuzz/artifacts
    known=()
    [ -d "tests/fuzz/corpus/$folder" ] && known=("tests/fuzz/corpus/$folder")
    log=target/fuzz/$folder.log
    if FUZZ_READER=$name FUZZ_SEEDS=$corpus "$program" "$corpus" "${known[@]}" -max_total_time="$seconds" -timeout=10 \
        -rss_limit_mb=1024 -max_len=4096 -dict=tests/fuzz/hostile.dict -print_final_stats=1 \
        -artifact_prefix="target/fuzz/artifacts/$folder-" >"$log" 2>&1; then
        word=ok
    else
        word="FAILED, see $log"
        found=1
    fi
    runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log" | tail -n 1)
    total=$((total + ${runs:-0}))
    printf '%-24s %10s inputs   %s\n' "$name" "${runs:-0}" "$word"
done
printf '%-24s %10s inputs\n' "in all" "$total"
exit $found
