# Every target makes its own environment: a fresh machine needs python3 (>= 3.11) and gcc only.
PYTHON ?= python3
VENV := .venv
PY := $(VENV)/bin/python

.PHONY: demo test lint bench numbers clean

demo: $(VENV)/.demo
	$(VENV)/bin/tireid demo --out out/demo --force

test: $(VENV)/.test lint
	$(PY) -m pytest

lint: $(VENV)/.test
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy

bench: $(VENV)/.bench
	$(PY) -m benchmarks.run_all --out out/bench

# What `python -m benchmarks.run_all --record` measured, written into README.md and docs.
numbers: $(VENV)/.bench
	$(PY) -m benchmarks.documents

$(PY):
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "tireid needs Python 3.11 or newer: make PYTHON=/path/to/python3.11"; exit 2; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.demo: pyproject.toml | $(PY)
	$(PY) -m pip install --quiet --editable .
	touch $@

$(VENV)/.test: pyproject.toml | $(PY)
	$(PY) -m pip install --quiet --editable ".[test]"
	touch $@

$(VENV)/.bench: pyproject.toml | $(PY)
	$(PY) -m pip install --quiet --editable ".[bench]"
	touch $@

clean:
	rm -rf $(VENV) out
