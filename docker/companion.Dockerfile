# The companion as it runs on the drone: its own dependencies and the serial LiDARs', no simulator, no compiler.
# linux/amd64 and linux/arm64 (Raspberry Pi 4 and 5). BASE: any Debian 12; its Python is 3.11. See docker/README.md.
ARG BASE=debian:bookworm-slim

FROM ${BASE} AS build
# Versions are Debian stable's, which only changes for security.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends ca-certificates python3 python3-venv \
    && apt-get clean && rm -rf /var/lib/apt/lists/*
WORKDIR /src
RUN python3 -m venv /venv
COPY pyproject.toml constraints.txt docker/requirements.py ./
RUN python3 requirements.py pyproject.toml hw > requirements.txt \
    && /venv/bin/pip install --no-cache-dir --only-binary :all: -c constraints.txt -r requirements.txt
# What nobody imports: tests of the libraries, MAVLink dialects other than common, pip itself.
RUN find /venv -type d -name tests -prune -exec rm -rf {} + \
    && find /venv -path '*/pymavlink/dialects/*' -type f ! -name __init__.py ! -path '*/v20/common.py' -delete \
    && rm -rf /venv/lib/python3.11/site-packages/pip /venv/lib/python3.11/site-packages/setuptools /venv/bin/pip* \
    && python3 -m compileall -q /venv/lib/python3.11/site-packages/pymavlink/dialects
COPY companion /opt/swiftnav/companion
COPY models/policies /opt/swiftnav/models/policies
RUN /venv/bin/python -m compileall -q /opt/swiftnav

FROM ${BASE}
# Device nodes of serial ports belong to the group dialout on Debian and Raspberry Pi OS.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends python3 \
    && apt-get clean && rm -rf /var/lib/apt/lists/* \
    && useradd --uid 10001 --groups dialout --create-home --home-dir /data companion \
    && install -d -o companion /data/flights
COPY --from=build /venv /venv
COPY --from=build /opt/swiftnav /opt/swiftnav
ENV PATH=/venv/bin:$PATH \
    PYTHONPATH=/opt/swiftnav \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1 \
    OMP_NUM_THREADS=1 \
    OPENBLAS_NUM_THREADS=1
USER 10001
WORKDIR /data
VOLUME /data/flights
# Healthy: scans are being answered. The log of a tick is at most 0.2 s late.
HEALTHCHECK --interval=10s --timeout=5s --start-period=60s --retries=3 \
    CMD ["sh", "-c", "test -n \"$(find flights -name navigator.jsonl -newermt '-10 seconds')\""]
STOPSIGNAL SIGINT
ENTRYPOINT ["python", "-m", "companion"]
CMD ["--help"]
