#!/usr/bin/env bash
# Builds the image `roomtrack` from the package in target/debian, with podman or docker, or ENGINE (`ENGINE="podman --runtime
# runc"` where crun does not know the machine's cgroups).   image.sh
# Where no registry of images is in reach, the base is made from Debian's packages, by mmdebstrap.
set -euo pipefail
cd "$(dirname "$0")/.."

./tests/setup.sh image
read -ra engine <<<"${ENGINE:-$(command -v podman || command -v docker)}"
base=docker.io/library/debian:bookworm-slim
if ! timeout 120 "${engine[@]}" pull --quiet "$base" >/dev/null 2>&1; then
    echo "$base is out of reach: making a base of Debian's packages"
    base=localhost/debian:bookworm-slim
    "${engine[@]}" image inspect "$base" >/dev/null 2>&1 ||
        mmdebstrap --quiet --variant=minbase --include=ca-certificates bookworm - | "${engine[@]}" import --quiet - "$base"
fi
# podman needs neither cgroups nor a running service to build in a chroot.
isolation=()
[[ ${engine[0]} != *podman ]] || isolation=(--isolation chroot)
"${engine[@]}" build "${isolation[@]}" --build-arg BASE="$base" -f packaging/Containerfile -t roomtrack .
