# Every target makes its own environment: a fresh machine needs python3 (>= 3.11) and gcc only.
PYTHON ?= python3
VENV := .venv
PY := $(VENV)/bin/python
# Bytecode is kept, whatever the shell says: else every process of the tests compiles all modules anew.
export PYTHONDONTWRITEBYTECODE :=

# LOCKED=1 installs the files that the lock lists by hash, as continuous integration does.
LOCKED :=
# Quick tests of every package, for versions of dependencies beside those of the lock.
SMOKE := tests/test_imports.py tests/codegen tests/models/test_vehicle.py \
	tests/identifier/test_laws.py tests/identifier/export/test_compiled.py \
	tests/mpc/path/test_waypoints.py tests/mpc/path/test_gates.py tests/tireid/test_cli.py
SMOKE_ONNX := tests/identifier/export/test_onnx.py \
	"tests/test_examples.py::test_example_runs_and_stays_short[own_network]"

.PHONY: demo test bare heavy lint format types tests docs bench mutants fuzz fuzz-c numbers reference newest lowest lock \
	wheel clean

demo: $(VENV)/.demo
	$(VENV)/bin/tireid demo --out out/demo --force

# Types are checked beside the first tests: one process at a time would leave a core idle.
test: $(VENV)/.test format
	$(MAKE) --no-print-directory --jobs=2 types tests

tests: $(VENV)/.test
	$(PY) -m pytest -n auto --dist worksteal -m "not heavy"

# Each core has a process of its own: a second thread of each for algebra would only wait.
tests bare heavy bench: export OPENBLAS_NUM_THREADS := 1
# The same bits, and the compiler is done sooner with what is long; sweeps run what users run.
tests bare: export TIREID_OPTIMIZE := 1,0

# As on a fresh machine, which has Python and gcc: tests that ask for other tools (cmake, clang, compilers for Arm
# and Windows, QEMU, Chromium, ...), with these hidden. Each passes, or is skipped and says what it needs.
bare: $(VENV)/.test
	$(PY) -m tests.optional_tools $(PY) -m pytest -n auto --dist worksteal -m "not heavy" \
		$$(cat tests/optional_tools.txt)

# What is marked as heavy, and the other cases of sweeps.
heavy: $(VENV)/.test
	$(PY) -m pytest -n auto --dist worksteal -m heavy

lint: format types

format: $(VENV)/.test
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .

types: $(VENV)/.test
	$(VENV)/bin/mypy

# The documents as a site, out/docs/index.html; a warning is an error, and so is a snippet that does not run.
docs: $(VENV)/.docs
	$(PY) docs/snippets.py
	$(PY) -m sphinx --builder html --fail-on-warning --keep-going --nitpicky --quiet docs out/docs

# At most an hour on two idle cores; `python -m benchmarks.run_all --record` keeps what it measures.
bench: $(VENV)/.bench
	$(PY) -m benchmarks.run_all --out out/bench

# The tables of README.md and docs, from the records in benchmarks/results.
numbers: $(VENV)/.bench
	$(PY) -m benchmarks.documents

# The generated headers that the C of the repository is compiled, linted and read with.
reference: $(VENV)/.test
	$(PY) -m tests.c_reference.write

# Faults that a program draws: how many do the tests catch?
mutants: $(VENV)/.mutants
	$(PY) -m benchmarks.mutants --out out/mutants

# libFuzzer on the exported C, FUZZ_STEPS of each package: needs clang with libFuzzer.
FUZZ_STEPS := 10000000
fuzz-c: $(VENV)/.demo
	$(PY) -m benchmarks.fuzz_c --steps $(FUZZ_STEPS)

# Hostile files and words at every door: CASES=20000 takes about an hour of two cores.
CASES := 20000
MINUTES :=
fuzz: $(VENV)/.test
	$(PY) -m benchmarks.fuzz --cases $(CASES) $(if $(MINUTES),--minutes $(MINUTES)) --out out/fuzz

$(PY):
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "tireid needs Python 3.11 or newer: make PYTHON=/path/to/python3.11"; exit 2; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.demo: pyproject.toml | $(PY)
	$(PY) -m pip install --quiet --editable .
	touch $@

# Methods that tireid is compared with: tests and benchmarks ask for them, users need not have them.
RIVALS := benchmarks/rivals

$(VENV)/.test: pyproject.toml $(RIVALS)/pyproject.toml requirements-test.lock | $(PY)
ifeq ($(LOCKED),)
	$(PY) -m pip install --quiet --editable ".[test]" --editable $(RIVALS)
else
	$(PY) -m pip install --quiet --require-hashes --requirement requirements-test.lock
	$(PY) -m pip install --quiet --no-deps --no-build-isolation --editable . --editable $(RIVALS)
endif
	touch $@

$(VENV)/.bench: pyproject.toml $(RIVALS)/pyproject.toml | $(PY)
	$(PY) -m pip install --quiet --editable . --editable $(RIVALS)
	touch $@

$(VENV)/.docs: pyproject.toml $(RIVALS)/pyproject.toml | $(PY)
	$(PY) -m pip install --quiet --editable ".[docs]" --editable $(RIVALS)
	touch $@

$(VENV)/.mutants: pyproject.toml $(RIVALS)/pyproject.toml | $(PY)
	$(PY) -m pip install --quiet --editable ".[mutants]" --editable $(RIVALS)
	touch $@

# The newest versions that there are, the lowest that pyproject.toml allows: in environments of their
# own, made anew each time.
newest:
	rm -rf $(VENV)-newest && $(PYTHON) -m venv $(VENV)-newest
	$(VENV)-newest/bin/python -m pip install --quiet --upgrade --editable ".[onnx]" pytest hypothesis
	$(VENV)-newest/bin/python -m pytest -q -W default -p no:cacheprovider $(SMOKE) $(SMOKE_ONNX)

lowest:
	rm -rf $(VENV)-lowest && $(PYTHON) -m venv $(VENV)-lowest
	$(PYTHON) .ci/lowest.py > $(VENV)-lowest/all.txt
	$(PYTHON) .ci/lowest.py onnx > $(VENV)-lowest/onnx.txt
	$(VENV)-lowest/bin/python -m pip install --quiet --constraint $(VENV)-lowest/all.txt --editable . \
		pytest hypothesis
	$(VENV)-lowest/bin/python -m pytest -q -W default -p no:cacheprovider $(SMOKE)
	$(VENV)-lowest/bin/python -m pip install --quiet --constraint $(VENV)-lowest/onnx.txt \
		--editable ".[onnx]"
	$(VENV)-lowest/bin/python -m pytest -q -W default -p no:cacheprovider $(SMOKE_ONNX)

# Resolve anew for every Python and system that is supported.
lock:
	rm -rf $(VENV)-lock && $(PYTHON) -m venv $(VENV)-lock
	$(VENV)-lock/bin/python -m pip install --quiet uv
	printf 'hatchling\neditables\n' > $(VENV)-lock/build.in
	set -e; for lock in "requirements.lock" "requirements-test.lock --extra test $(VENV)-lock/build.in"; do \
		$(VENV)-lock/bin/uv pip compile pyproject.toml --quiet --universal --python-version 3.11 \
		--generate-hashes --no-header --no-emit-index-url --no-emit-find-links --upgrade \
		--output-file $$lock; \
	done
	sed -i.bak 's| -r $(VENV)-lock/build.in| the build|' requirements-test.lock
	rm requirements-test.lock.bak

wheel:
	rm -rf $(VENV)-wheel && $(PYTHON) -m venv $(VENV)-wheel
	$(VENV)-wheel/bin/python -m pip wheel --quiet --no-deps --wheel-dir dist .

clean:
	rm -rf $(VENV) $(VENV)-* out build dist docs/generated
