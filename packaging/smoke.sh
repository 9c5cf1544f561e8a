#!/usr/bin/env bash
# The package and the image in a fresh Debian without Rust: the office end to end, stations over Zenoh included. As root.
# With podman or docker, or ENGINE, as image.sh.   smoke.sh
set -euo pipefail
cd "$(dirname "$0")/.."
./tests/setup.sh image
read -ra engine <<<"${ENGINE:-$(command -v podman || command -v docker)}"
package=$(realpath target/debian/roomtrack_*.deb)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
say() { printf '\n\033[1m%s\033[0m\n' "$*"; }

# The office in the current folder, by the program of the current machine.
cat >"$scratch/office.sh" <<'OFFICE'
set -eux
films="--video cam0=video/cam0.mp4 --video cam1=video/cam1.mp4"
roomtrack --version
if ldd "$(command -v roomtrack)" | grep -E "opencv|libav"; then
    echo "roomtrack itself must load neither OpenCV nor FFmpeg" >&2
    exit 1
fi
roomtrack recon build room.toml --zones zones.toml --out myroom --quality draft
roomtrack scenes check myroom
roomtrack tracker run myroom $films --out out
roomtrack tracker eval --truth truth.txt --tracks out/tracks.txt --truth-room room --room myroom
roomtrack tracker report out --room myroom --out report.html
roomtrack tracker station myroom --camera cam0 --video video/cam0.mp4 --listen 127.0.0.1:7447 &
roomtrack tracker station myroom --camera cam1 --video video/cam1.mp4 --listen 127.0.0.1:7448 &
roomtrack tracker run myroom --stations 127.0.0.1:7447,127.0.0.1:7448 --out gathered --no-film
wait
roomtrack tracker eval --truth truth.txt --tracks gathered/tracks.txt --truth-room room --room myroom
OFFICE

say "the package in a fresh Debian"
fresh=$scratch/fresh
mmdebstrap --quiet --variant=minbase bookworm "$fresh"
cp "$package" "$fresh/tmp/roomtrack.deb"
cp -r tests/office "$fresh/office"
cp "$scratch/office.sh" "$fresh/office/"
cp /etc/resolv.conf "$fresh/etc/resolv.conf"
chroot "$fresh" sh -c "apt-get update -qq && apt-get install -y -qq --no-install-recommends /tmp/roomtrack.deb >/dev/null"
mount --bind /proc "$fresh/proc"
mount --bind /dev "$fresh/dev"
trap 'umount "$fresh/proc" "$fresh/dev" && rm -rf --one-file-system "$scratch"' EXIT
chroot "$fresh" sh -c "cd /office && bash office.sh"
du -k --apparent-size "$package" | awk '{ print "package: " $1 " KiB" }'
chroot "$fresh" dpkg-query --show --showformat '${Installed-Size} KiB installed\n' roomtrack

say "the image, as a user without rights, on a read-only root"
mkdir "$scratch/office"
cp -r tests/office/. "$scratch/office.sh" "$scratch/office/"
# Not all of the scratch folder: this machine's /dev and /proc are mounted in the fresh Debian below it.
chmod a+rx "$scratch"
chmod -R a+rwX "$scratch/office"
"${engine[@]}" run --rm --ulimit nofile=1024:1024 --ulimit nproc=4096:4096 --read-only --cap-drop=all --security-opt=no-new-privileges \
    --volume "$scratch/office:/office" --workdir /office --entrypoint bash roomtrack office.sh
say "both work"
