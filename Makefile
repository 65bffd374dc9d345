# make run, make test: each creates .venv, installs what it needs, and does its job.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
ARGS ?=

.PHONY: run test bench lint clean
.DEFAULT_GOAL := run

run: $(VENV)/.run
	@exec $(BIN)/paikka serve $(ARGS)

test: $(VENV)/.test
	@exec $(BIN)/python -m tests $(ARGS)

bench: $(VENV)/.test
	@exec $(BIN)/python -m tests.bench $(ARGS)

lint: $(VENV)/.test
	$(BIN)/ruff check .

clean:
	rm -rf $(VENV) build *.egg-info

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "Paikka needs Python 3.11 or newer; name one with: make $(MAKECMDGOALS) PYTHON=python3.12"; exit 2; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.run: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable .
	@touch $@

$(VENV)/.test: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable ".[test,export]"
	@# a peer for the benchmarks that runs on numpy 2 but does not say so
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps particles==0.4
	@touch $@ $(VENV)/.run
