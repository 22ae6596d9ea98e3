# SWIFT-Nav: `make fly` and `make test` do all their own set-up.
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

.PHONY: help setup fly test slow check format bench clean
help:
	@echo "make fly     set up and fly trajectory 2"
	@echo "make test    set up, check and test: everything CI runs"
	@echo "make setup   create .venv and install everything for development"
	@echo "make check   format, lint, types, floors"
	@echo "make slow    the long flight tables (50 seeds a world)"
	@echo "make bench   speed as ratios to bare JSBSim"

$(BIN)/python:
	@command -v $(PYTHON) >/dev/null || { echo "need $(PYTHON): on Debian 'apt-get install python3.11 python3.11-venv'"; exit 1; }
	$(PYTHON) -m venv $(VENV)

# `fly` needs the companion and the vehicle; `dev` adds the test tools. Neither needs torch.
$(VENV)/.sitl: $(BIN)/python pyproject.toml constraints.txt
	$(BIN)/pip install -q -c constraints.txt -e '.[sitl]'
	@touch $@
$(VENV)/.dev: $(BIN)/python pyproject.toml constraints.txt
	$(BIN)/pip install -q -c constraints.txt -e '.[dev]'
	@touch $@ $(VENV)/.sitl

setup: $(VENV)/.dev

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

test: check
	$(BIN)/pytest -n 2

slow: $(VENV)/.dev
	$(BIN)/pytest -n 2 -m slow --timeout 3600

bench: $(VENV)/.sitl
	$(BIN)/swiftnav bench speed

clean:
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
