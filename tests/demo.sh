#!/usr/bin/env bash
# The whole chain on one room: reconstruct, track, evaluate, report.   demo.sh PROJECT_DIR OUTPUT_DIR
set -euo pipefail
project=$1 out=$2
bin=${CARGO_TARGET_DIR:-target}/release
started=$SECONDS
rm -rf "$out" && mkdir -p "$out"

say() { printf '\n\033[1m%s\033[0m\n' "$*"; }

say "1/4  the room, from what its cameras filmed while they were put up"
"$bin/recon" build "$project/room.toml" --zones "$project/zones.toml" --out "$out/room"
"$bin/scenes" check "$out/room"

say "2/4  everyone in it"
"$bin/tracker" run "$out/room" --video cam0="$project/video/cam0.mp4" --video cam1="$project/video/cam1.mp4" --out "$out/tracks"

say "3/4  against the truth"
"$bin/tracker" eval --truth "$project/truth.txt" --tracks "$out/tracks/tracks.txt" \
    --truth-room "$project/room" --room "$out/room"

say "4/4  the report"
"$bin/tracker" report "$out/tracks" --room "$out/room" --truth "$project/truth.txt" --truth-room "$project/room" \
    --out "$out/report.html"

say "$((SECONDS - started)) s in all.  Open $(realpath "$out/report.html")"
