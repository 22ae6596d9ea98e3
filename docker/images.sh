#!/bin/sh
# Builds every image and tries it out: `make images`. With docker or podman where one runs; otherwise, as root on a
# Debian, with buildah on a base made by debootstrap: apt-get install buildah debootstrap.
# images.sh build | images.sh try: one of the two only.
# PYTHON: an interpreter with swiftnav[sitl], for the vehicle that the companion's image flies.
# ARCH=arm64: the companion's image for a Raspberry Pi and no other, without the flight; by emulation, which must have
# been set up (qemu-user-static, registered with binfmt_misc), and takes a quarter of an hour.
set -eu
cd "$(dirname "$0")/.."
PYTHON=${PYTHON:-.venv/bin/python}
ARCH=${ARCH:-}
WORK=$PWD/build/images
BASE=debian:bookworm-slim
COMPANION=companion${ARCH:+-$ARCH}
COMPANION_MAX_MB=400
mkdir -p "$WORK"

say() { printf '\n== %s\n' "$*"; }

choose_engine() {
    for engine in docker podman; do
        if $engine info >/dev/null 2>&1; then
            ENGINE=$engine
            return
        fi
    done
    if [ "$(id -u)" = 0 ] && command -v buildah >/dev/null && command -v debootstrap >/dev/null; then
        ENGINE=buildah
        export BUILDAH_ISOLATION=chroot
        make_base
        return
    fi
    echo "make images: no docker or podman runs here; as root, 'apt-get install buildah debootstrap' will do" >&2
    exit 1
}

b() { buildah --root "$WORK/store" --runroot "$WORK/run" "$@"; }

# A Debian as small as the slim image, that trusts whom this machine trusts (a mirror's certificate, say).
make_base() {
    BASE=localhost/debian:bookworm${ARCH:+-$ARCH}
    if b images -q "$BASE" >/dev/null 2>&1; then return; fi
    say "base: Debian 12 by debootstrap"
    rm -rf "$WORK/base"
    # DEBIAN_MIRROR: where packages come from, if not where debootstrap looks by itself.
    debootstrap ${ARCH:+"--arch=$ARCH"} --variant=minbase --include=ca-certificates bookworm "$WORK/base" \
        ${DEBIAN_MIRROR:+"$DEBIAN_MIRROR"} >"$WORK/debootstrap.log"
    cp /etc/ssl/certs/ca-certificates.crt "$WORK/base/etc/ssl/certs/"
    chroot "$WORK/base" apt-get clean
    for left_over in var/lib/apt/lists usr/share/doc usr/share/man usr/share/locale usr/share/info; do
        find "$WORK/base/$left_over" -mindepth 1 -delete
    done
    container=$(b from ${ARCH:+--arch "$ARCH"} scratch)
    b add -q "$container" "$WORK/base" / >/dev/null
    b commit -q "$container" "$BASE" >/dev/null
    b rm "$container" >/dev/null
    rm -rf "$WORK/base"
}

# build IMAGE [DOCKERFILE [ARGUMENT]]
build() {
    say "build swiftnav-$1"
    if [ "$ENGINE" = buildah ]; then
        b bud -q --format docker ${ARCH:+--arch "$ARCH"} --build-arg BASE="$BASE" ${3:+--build-arg "$3"} \
            -f "docker/${2:-$1}.Dockerfile" -t "swiftnav-$1" .
    else
        "$ENGINE" build -q ${ARCH:+--platform "linux/$ARCH"} ${3:+--build-arg "$3"} -f "docker/${2:-$1}.Dockerfile" -t "swiftnav-$1" .
    fi
}

# run IMAGE FOLDER ENTRYPOINT ARGUMENTS...: what the image starts, with FOLDER of this machine under the same name.
run() {
    image=$1 folder=$2
    shift 2
    if [ "$ENGINE" = buildah ]; then
        b run -v "$folder:$folder" "$(container_of "$image")" -- "$@"
    else
        shift # the entry point is the image's own
        "$ENGINE" run --rm --network host -v "$folder:$folder" "swiftnav-$image" "$@"
    fi
}

container_of() {
    b from --name "try-$1" --pull-never ${ARCH:+--arch "$ARCH"} "localhost/swiftnav-$1:latest" 2>/dev/null || echo "try-$1"
}

size_mb() {
    if [ "$ENGINE" = buildah ]; then
        du -sm "$(b mount "$(container_of "$1")")" | cut -f1
    else
        echo $(($("$ENGINE" image inspect --format '{{.Size}}' "swiftnav-$1") / 1000000))
    fi
}

try_companion() {
    say "companion: nothing of the simulator, unprivileged, under $COMPANION_MAX_MB MB"
    size=$(size_mb "$COMPANION")
    echo "$size MB"
    [ "$size" -lt "$COMPANION_MAX_MB" ]
    say "companion: --check without a vehicle must say so, with exit code 6"
    code=0
    run "$COMPANION" "$WORK" python -m companion --check --check-time 1 --vehicle udpin://127.0.0.1:14599 || code=$?
    [ "$code" = 6 ]
    if [ -n "$ARCH" ]; then return; fi # an emulated companion is too slow for the operator's patience
    say "companion: flies trajectory1 against a vehicle outside it"
    rm -rf "$WORK/flight"
    if [ "$ENGINE" = buildah ]; then
        "$PYTHON" docker/fly_with.py "$WORK/flight" buildah --root "$WORK/store" --runroot "$WORK/run" \
            run -v "$WORK:$WORK" "$(container_of "$COMPANION")" -- python -m companion
    else
        "$PYTHON" docker/fly_with.py "$WORK/flight" \
            "$ENGINE" run --rm --network host -v "$WORK:$WORK" "swiftnav-$COMPANION"
    fi
}

try_others() {
    for image in sitl train relay; do echo "$image: $(size_mb "$image") MB"; done
    say "sitl: flies trajectory1 by itself"
    if [ "$ENGINE" = buildah ]; then # in a network of its own, as the other engines have it
        unshare --net sh -c 'ip link set lo up && exec "$@"' sh \
            buildah --root "$WORK/store" --runroot "$WORK/run" run "$(container_of sitl)" -- swiftnav fly trajectory1
    else
        "$ENGINE" run --rm swiftnav-sitl fly trajectory1
    fi
    say "train: one episode"
    episode="train --world trajectory1 --seeds 1 --max-episodes 1 --set training.evaluate_every=0"
    # shellcheck disable=SC2086 # words
    if [ "$ENGINE" = buildah ]; then
        b run "$(container_of train)" -- swiftnav $episode
    else
        "$ENGINE" run --rm swiftnav-train $episode
    fi
    say "relay: has what it starts"
    if [ "$ENGINE" = buildah ]; then
        run relay "$WORK" socat -V | head -2
    else
        "$ENGINE" run --rm --entrypoint socat swiftnav-relay -V | head -2
    fi
}

choose_engine
say "with $ENGINE"
if [ "${1:-build}" = build ]; then
    build "$COMPANION" companion
    if [ -z "$ARCH" ]; then
        for image in sitl relay; do build "$image"; done
        build train sitl EXTRA=train
    fi
fi
if [ "${1:-try}" = try ]; then
    try_companion
    if [ -z "$ARCH" ]; then try_others; fi
fi
say "done"
