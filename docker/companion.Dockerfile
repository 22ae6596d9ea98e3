# The companion as it runs on the drone: core dependencies only, no simulator, no compiler. See docker/README.md.
FROM python:3.11-slim AS build
WORKDIR /src
RUN python -m venv /venv
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY companion companion
COPY sitl sitl
COPY mission mission
COPY models models
RUN /venv/bin/pip install --no-cache-dir -c constraints.txt .

FROM python:3.11-slim
RUN useradd --uid 10001 --create-home --home-dir /data companion \
    && install -d -o companion /data/flights
COPY --from=build /venv /venv
ENV PATH=/venv/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    OMP_NUM_THREADS=1 \
    OPENBLAS_NUM_THREADS=1
USER 10001
WORKDIR /data
VOLUME /data/flights
# Healthy: scans are being answered. The log of a tick is at most 0.2 s late.
HEALTHCHECK --interval=10s --timeout=5s --start-period=40s --retries=3 \
    CMD ["sh", "-c", "test -n \"$(find flights -name navigator.jsonl -newermt '-10 seconds')\""]
ENTRYPOINT ["python", "-m", "companion"]
CMD ["--help"]
