#!/usr/bin/env bash
# Builds target/debian/roomtrack_VERSION_ARCH.deb: the program, manual pages, completions, the service.   deb.sh
# Libraries that the package depends on are found by dpkg-shlibdeps, so it fits the Debian that it is built on.
set -euo pipefail
cd "$(dirname "$0")/.."

./tests/setup.sh package
# One after the other: together they would share features, and the first would be linked with OpenCV.
cargo build --profile dist --locked -p roomtrack
cargo build --profile dist --locked -p roomtrack-vision
./packaging/documents.sh
PATH="$PATH:$PWD/target/tools/bin" cargo deb -p roomtrack --quiet --no-build --profile dist --locked \
    --output target/debian/
ls -l target/debian/*.deb
