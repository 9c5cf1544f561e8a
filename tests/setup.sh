#!/usr/bin/env bash
# Installs what cargo cannot: OpenCV's and FFmpeg's libraries and headers, and clang, which the bindings are generated
# with.
set -euo pipefail

missing=()
pkg-config --exists opencv4 2>/dev/null || missing+=(libopencv-dev) # brings pkg-config along
for library in avcodec avformat swscale; do
    pkg-config --exists "lib$library" 2>/dev/null || missing+=("lib$library-dev")
done
command -v clang >/dev/null || missing+=(clang)
[ ${#missing[@]} -eq 0 ] && exit 0

if ! command -v apt-get >/dev/null; then
    cat >&2 <<EOF
roomtrack needs OpenCV 4 and FFmpeg 5 or later with their headers, clang with libclang, and pkg-config. Install them with your system's tools:
  Fedora   sudo dnf install opencv-devel ffmpeg-free-devel clang-devel pkgconf
  Arch     sudo pacman -S opencv ffmpeg clang pkgconf
  macOS    brew install opencv ffmpeg llvm pkg-config
EOF
    exit 1
fi

as_root=()
[ "$(id -u)" -eq 0 ] || as_root=(sudo)
echo "installing ${missing[*]}"
"${as_root[@]}" apt-get update -qq
DEBIAN_FRONTEND=noninteractive "${as_root[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
