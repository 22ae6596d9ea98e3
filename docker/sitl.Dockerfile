# The vehicle and whatever flies it on a desk: JSBSim, LiDAR, flight stack, operator, companion, missions.
# linux/amd64 only: JSBSim has no other Linux wheel. BASE: any Debian 12. EXTRA=train: what training needs besides.
# See docker/README.md.
ARG BASE=debian:bookworm-slim
ARG EXTRA=sitl

FROM ${BASE} AS build
ARG EXTRA
# Versions are Debian stable's, which only changes for security.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends ca-certificates python3 python3-venv \
    && apt-get clean && rm -rf /var/lib/apt/lists/*
WORKDIR /src
RUN python3 -m venv /venv
COPY pyproject.toml constraints.txt README.md LICENSE docker/requirements.py ./
# The libraries first: they change less often than our own code.
RUN python3 requirements.py pyproject.toml "${EXTRA}" > requirements.txt \
    && /venv/bin/pip install --no-cache-dir --only-binary :all: -c constraints.txt -r requirements.txt
COPY companion companion
COPY sitl sitl
COPY mission mission
COPY models models
RUN /venv/bin/pip install --no-cache-dir -c constraints.txt . \
    && find /venv -type d -name tests -prune -exec rm -rf {} + \
    && find /venv -path '*/pymavlink/dialects/*' -type f ! -name __init__.py ! -path '*/v20/common.py' -delete \
    && python3 -m compileall -q /venv/lib/python3.11/site-packages/pymavlink/dialects

FROM ${BASE}
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends python3 \
    && apt-get clean && rm -rf /var/lib/apt/lists/* \
    && useradd --uid 10001 --create-home --home-dir /data pilot \
    && install -d -o pilot /data/flights
COPY --from=build /venv /venv
ENV PATH=/venv/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1 \
    NUMBA_CACHE_DIR=/data/.numba \
    MPLCONFIGDIR=/data/.matplotlib \
    OMP_NUM_THREADS=1 \
    OPENBLAS_NUM_THREADS=1
USER 10001
WORKDIR /data
# The LiDAR's kernel, compiled: the first flight on a processor like this one need not wait for it.
RUN python -c "from mission.world_file import load_world; from sitl.simulation import SimConfig, Simulation; \
    Simulation(load_world('open'), SimConfig())"
VOLUME /data/flights
# Healthy: the vehicle's companion port (14580, 38F4 in hexadecimal) is open.
HEALTHCHECK --interval=10s --timeout=5s --start-period=60s --retries=3 \
    CMD ["grep", "-q", ":38F4 ", "/proc/net/udp"]
STOPSIGNAL SIGINT
ENTRYPOINT ["swiftnav"]
CMD ["sitl", "--world", "trajectory2"]
