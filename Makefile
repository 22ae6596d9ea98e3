# SWIFT-Nav: `make fly` and `make test` do all their own set-up.
VENV := .venv
BIN := $(VENV)/bin
VENV3 := .venv-mavsdk3
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

# The first of these that is Python 3.11 or 3.12 and can make a virtual environment; PYTHON=... comes before them.
PYTHON ?=
FIND_PYTHON = python=; for p in $(PYTHON) python3.11 python3.12 python3; do \
	$$p -c 'import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 12))' 2>/dev/null \
	&& python=$$p && break; done
DEBIAN_PACKAGES := python3 python3-venv

.PHONY: help setup fly test slow tables check format docs bench images clean
help:
	@echo "make fly     set up and fly trajectory 2; ARGS='trajectory1 --seed 3 --speed 1' for another flight"
	@echo "make test    set up, check and test: everything CI runs"
	@echo "make setup   create .venv and .venv-mavsdk3, install everything for development"
	@echo "make check   format, lint, types, floors"
	@echo "make format  put files into the house format"
	@echo "make docs    write docs/parameters.md from the code"
	@echo "make slow    the long flight tests"
	@echo "make tables  flights over many seeds, judged: the results in README.md"
	@echo "make bench   speed as ratios to bare JSBSim"
	@echo "make images  build the container images and try them out (docker or podman; as root buildah)"
	@echo "make clean   remove both environments and caches"

$(BIN)/python:
	@$(FIND_PYTHON); \
	if [ -z "$$python" ] && [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		apt-get update -q && apt-get install -qy --no-install-recommends $(DEBIAN_PACKAGES); $(FIND_PYTHON); \
	fi; \
	if [ -z "$$python" ]; then \
		echo "SWIFT-Nav needs Python 3.11 or 3.12 with venv: 'apt-get install $(DEBIAN_PACKAGES)' on Debian 12" >&2; \
		echo "or Ubuntu 24.04, 'brew install python@3.12' on macOS, or name one: make PYTHON=/path/to/python3.12" >&2; \
		exit 1; \
	fi; \
	"$$python" -m venv $(VENV)

# `fly` needs the companion and the vehicle, no torch; `dev` adds what trains and the test tools; `scale` adds Ray.
$(VENV)/.sitl: $(BIN)/python pyproject.toml constraints.txt
	$(BIN)/pip install -q -c constraints.txt -e '.[sitl]'
	@touch $@
$(VENV)/.dev: $(BIN)/python pyproject.toml constraints.txt
	$(BIN)/pip install -q -c constraints.txt -e '.[dev]'
	@touch $@ $(VENV)/.sitl
$(VENV)/.scale: $(VENV)/.dev
	$(BIN)/pip install -q -c constraints.txt -e '.[compare,dev,scale]'
	@touch $@

# The second client that the vehicle is tested with: MAVSDK 3.17.4 and 4.1 do not go into one environment.
$(VENV3)/.ready: constraints-mavsdk3.txt | $(BIN)/python
	$(BIN)/python -m venv $(VENV3)
	$(VENV3)/bin/pip install -q -c constraints-mavsdk3.txt mavsdk
	@touch $@

setup: $(VENV)/.dev $(VENV3)/.ready

fly: $(VENV)/.sitl
	$(BIN)/swiftnav fly $(ARGS)

check: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(VENV)/.dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

test: export CI := 1  # the same random examples every time
test: check $(VENV3)/.ready
	$(BIN)/pytest -n 2 -m "not slow and not live"
	SWIFTNAV_MAVSDK3=$(VENV3)/bin/python $(BIN)/pytest -m "live and not slow" --reruns 3 --reruns-delay 1

slow: $(VENV)/.scale
	$(BIN)/pytest -m slow --timeout 3600

tables: $(VENV)/.sitl
	@missed=0; for table in trajectory1 trajectory2 trajectory1_movers forest100; do \
		$(BIN)/python -m mission.tables $$table --jobs 2 || missed=1; done; exit $$missed

docs: $(VENV)/.sitl
	$(BIN)/swiftnav params docs > docs/parameters.md
	$(BIN)/python -m sitl.contract > docs/mavlink.md

bench: $(VENV)/.sitl
	$(BIN)/swiftnav bench speed

images: $(VENV)/.sitl
	PYTHON=$(BIN)/python sh docker/images.sh

clean:
	rm -rf $(VENV) $(VENV3) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
