#!/usr/bin/env bash
# Installs what cargo cannot: OpenCV's and FFmpeg's libraries and headers, clang, which the bindings are generated with,
# and mosquitto for the tests of MQTT.   setup.sh
# Or the browser that pages are tested in.   setup.sh browser
# Or what a package, an image or the guide is made with; programs from crates.io go to target/tools.
#   setup.sh package | image | guide
# Or what checks the dependencies, or what looks for inputs that readers do not survive.   setup.sh deny | fuzz
set -euo pipefail

as_root=()
[ "$(id -u)" -eq 0 ] || as_root=(sudo)
# Installs packages; the whole of apt may take MINUTES.   install MINUTES PACKAGES
install() {
    local minutes=$1
    shift
    echo "installing $*"
    "${as_root[@]}" timeout "${minutes}m" apt-get update -qq &&
        DEBIAN_FRONTEND=noninteractive "${as_root[@]}" timeout "${minutes}m" \
            apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

if [ "${1:-}" = browser ]; then
    command -v chromium >/dev/null && exit 0
    # Without a browser its tests are skipped, and say so.
    if ! command -v apt-get >/dev/null || ! install 3 chromium; then
        echo "chromium cannot be installed here: tests of pages will be skipped" >&2
    fi
    exit 0
fi

# Builds a program from crates.io, unless it is there.   tool NAME VERSION
tool() {
    PATH="$PATH:$PWD/target/tools/bin" command -v "$1" >/dev/null ||
        CARGO_TARGET_DIR=target/tools/build cargo install --quiet --locked --root target/tools "$1" --version "$2"
}
# Installs Debian's packages of programs that are missing.   programs NAME=PACKAGE…
programs() {
    local missing=() each
    for each in "$@"; do
        command -v "${each%%=*}" >/dev/null || missing+=("${each#*=}")
    done
    [ ${#missing[@]} -eq 0 ] || install 20 "${missing[@]}"
}
case "${1:-}" in
package)
    programs dpkg-shlibdeps=dpkg-dev gzip=gzip
    tool cargo-deb 3.8.0
    exit 0
    ;;
image)
    command -v podman >/dev/null || command -v docker >/dev/null || programs podman=podman
    programs mmdebstrap=mmdebstrap
    exit 0
    ;;
deny)
    tool cargo-deny 0.20.2
    exit 0
    ;;
fuzz)
    tool cargo-fuzz 0.13.2
    exit 0
    ;;
guide)
    tool mdbook 0.5.4
    tool mdbook-mermaid 0.17.1
    exit 0
    ;;
esac

missing=()
pkg-config --exists opencv4 2>/dev/null || missing+=(libopencv-dev) # brings pkg-config along
for library in avcodec avformat swscale; do
    pkg-config --exists "lib$library" 2>/dev/null || missing+=("lib$library-dev")
done
command -v clang >/dev/null || missing+=(clang)
# The broker and the subscriber of the tests of MQTT. The broker's folder is not in everybody's PATH.
PATH="$PATH:/usr/sbin" command -v mosquitto >/dev/null || missing+=(mosquitto)
command -v mosquitto_sub >/dev/null || missing+=(mosquitto-clients)
[ ${#missing[@]} -eq 0 ] && exit 0

if ! command -v apt-get >/dev/null; then
    cat >&2 <<EOF
roomtrack needs OpenCV 4 and FFmpeg 5 or later with their headers, clang with libclang, pkg-config, and mosquitto for its tests. Install them with your system's tools:
  Fedora   sudo dnf install opencv-devel ffmpeg-free-devel clang-devel pkgconf mosquitto
  Arch     sudo pacman -S opencv ffmpeg clang pkgconf mosquitto
  macOS    brew install opencv ffmpeg llvm pkg-config mosquitto
EOF
    exit 1
fi

install 20 "${missing[@]}"
# Debian starts a broker for the whole machine, which the tests have no use for.
if [[ " ${missing[*]} " == *" mosquitto "* && -d /run/systemd/system ]]; then
    "${as_root[@]}" systemctl disable --now mosquitto
fi
