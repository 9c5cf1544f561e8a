#!/usr/bin/env bash
# Installs what cargo cannot: OpenCV's libraries and headers, and clang, which the bindings are generated with.
set -euo pipefail

missing=()
pkg-config --exists opencv4 2>/dev/null || missing+=(libopencv-dev) # brings pkg-config along
command -v clang >/dev/null || missing+=(clang)
[ ${#missing[@]} -eq 0 ] && exit 0

if ! command -v apt-get >/dev/null; then
    cat >&2 <<EOF
roomtrack needs OpenCV 4 with its headers, clang with libclang, and pkg-config. Install them with your system's tools:
  Fedora   sudo dnf install opencv-devel clang-devel pkgconf
  Arch     sudo pacman -S opencv clang pkgconf
  macOS    brew install opencv llvm pkg-config
EOF
    exit 1
fi

as_root=()
[ "$(id -u)" -eq 0 ] || as_root=(sudo)
echo "installing ${missing[*]}"
"${as_root[@]}" apt-get update -qq
DEBIAN_FRONTEND=noninteractive "${as_root[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
