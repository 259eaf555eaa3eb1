# Everything from a bare checkout; each target sets up what it needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test test-data fuzz faults lint types imports docs wheel bench bench-quick core current sanitize clean

# The README prints these lines for those without make. Only errors of pip are shown.
$(VENV)/.package: pyproject.toml
	@echo "Setting up $(VENV): installing pgm_places and the libraries it needs (once) ..."
	@$(PYTHON) tools/core.py --announce
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --quiet --upgrade "pip>=25.1"
	@$(BIN)/python -m pip install --quiet --quiet --editable .
	@touch $@

$(VENV)/.installed: $(VENV)/.package
	@echo "Setting up $(VENV): installing the tools for tests, checks and documentation (once) ..."
	@$(BIN)/python -m pip install --quiet --quiet --group dev
	@touch $@

# The kernels in C++ compiled in place, for the Python of $(VENV) or PYTHON=...; 'current' does so
# only where a source is newer.
CORE_PYTHON := $(if $(filter file,$(origin PYTHON)),$(or $(wildcard $(BIN)/python),$(PYTHON)),$(PYTHON))
core:
	@$(CORE_PYTHON) tools/core.py

current: $(VENV)/.package
	@$(BIN)/python tools/core.py --if-changed

# Kernels that check every access to memory and all arithmetic, compiled once more for it.
sanitize: $(VENV)/.installed
	$(BIN)/python -m tests.sanitized

demo: current
	$(BIN)/pgm-places demo --out demo-report

# A process for each core. A file stays in one of them, for what its tests share; tests/conftest.py
# puts the longest first. Commands that tests start in processes of their own would compile our
# sources anew each time if none could be kept.
PYTEST := env -u PYTHONDONTWRITEBYTECODE $(BIN)/python -m pytest --numprocesses logical \
	--dist loadfile --no-loadscope-reorder
test: $(VENV)/.installed current
	$(PYTEST)

# Only the tests on real maps and logs, which are skipped where these are absent.
test-data: $(VENV)/.installed
	$(PYTEST) -m real_data tests

# Spoiled files for every reader, N of them each; what finds something is kept in fuzz-findings/.
N ?= 10000
fuzz: $(VENV)/.installed
	$(BIN)/python -m tests.fuzz --count $(N)

# Kills of every command, KILLS of them each, at steps that SEED draws.
KILLS ?= 25
SEED ?= 0
faults: $(VENV)/.installed
	PGM_PLACES_KILLS=$(KILLS) PGM_PLACES_SEED=$(SEED) $(BIN)/python -m pytest -s tests/faults

lint: $(VENV)/.installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.installed
	$(BIN)/mypy

imports: $(VENV)/.installed
	$(BIN)/lint-imports

docs: $(VENV)/.installed
	$(BIN)/sphinx-build -W --keep-going --quiet -b html docs docs/_build/html

wheel: $(VENV)/.installed
	rm -rf dist build
	$(BIN)/python -m build --outdir dist
	$(BIN)/python tests/check_wheel.py dist/*.whl

bench: $(VENV)/.installed
	$(BIN)/python -m benchmarks

# Small sizes of the benchmarks that take seconds, to see that they run; nothing is written.
QUICK := features boosting labelling relaxation inference forward amn_learning tagging tracking
bench-quick: $(VENV)/.installed current
	$(BIN)/python -m benchmarks --quick $(QUICK)

clean:
	rm -rf $(VENV) build dist docs/_build pgm_places/_core* .pytest_cache .mypy_cache .ruff_cache *.egg-info
