# One MAVLink port of the vehicle, carried out of its network to a ground station elsewhere, both ways.
# Debian has no mavlink-router; one ground station needs no more than this.
ARG BASE=debian:bookworm-slim
FROM ${BASE}
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends socat \
    && apt-get clean && rm -rf /var/lib/apt/lists/*
ENV PORT=14550 \
    GROUND_STATION=host.docker.internal:14550
USER 10001
HEALTHCHECK --interval=10s --timeout=5s --retries=3 CMD ["sh", "-c", "grep -qi \":$(printf '%X' \"$PORT\") \" /proc/net/udp"]
ENTRYPOINT ["sh", "-c", "exec socat \"UDP4-LISTEN:$PORT,bind=127.0.0.1,reuseaddr\" \"UDP4:$GROUND_STATION\""]
