# Every target makes its own .venv; nothing is needed beside Python >= 3.11 with pip.
#   make check   lint, types, import rules and the fast tests: the inner loop
#   make test    the same with all tests but the longest
#   make long    the longest tests, each several seconds of a processor
#   make soak    damaged files, kills and full disks in large numbers: hours
#   make lowest  the fast tests with the lowest versions that pyproject.toml admits
# Another interpreter: make PYTHON=python3.12 test

PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check
# a test process for each processor, each with one thread for linear algebra; a file's tests run in one process,
# which makes its fixtures once
export OPENBLAS_NUM_THREADS := 1
# compiled modules are kept whatever the caller's Python says: each test process would compile all of them anew
export PYTHONDONTWRITEBYTECODE :=
PYTEST := $(BIN)/pytest --numprocesses logical --dist loadfile

.PHONY: demo check test long soak compiled lowest lint docs bench clean

demo: $(READY)
	$(BIN)/sounder demo --out demo-output

check: lint
	$(PYTEST) -m "not slow and not long"

test: lint compiled
	$(PYTEST) -m "not long"

long: $(READY)
	$(PYTEST) -m long

soak: $(READY)
	$(BIN)/python -m tests.soak

# compile the kernels once, so that the processes of the tests find them
compiled: $(READY)
	@$(BIN)/sounder process calibration/recording-132ghz.h5 --calibration calibration/back-to-back-132ghz.h5 \
		--out .venv/compiled >/dev/null

# the fast tests with the lowest versions that pyproject.toml admits; old versions may warn of newer ones
lowest: .venv-lowest/.ready
	.venv-lowest/$(PYTEST:.venv/%=%) -m "not slow and not long" -W default::DeprecationWarning -W default::FutureWarning

.venv-lowest/.ready: $(READY)
	@$(BIN)/python -m venv --clear --without-pip .venv-lowest
	@$(BIN)/python .ci/lowest.py >.venv-lowest/constraints.txt
	@$(BIN)/python -m pip --python .venv-lowest install --quiet --disable-pip-version-check \
		--constraint .venv-lowest/constraints.txt --editable '.[cluster,gis,cad]' --group test
	@touch $@

lint: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/codespell
	$(BIN)/lint-imports --no-logo

docs: $(READY)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

bench: $(READY)
	$(INSTALL) --editable '.[cluster]' --group bench
	$(BIN)/python benchmarks/run.py

clean:
	rm -rf .venv .venv-lowest .grimp_cache .import_linter_cache .mypy_cache .pytest_cache .ruff_cache .hypothesis build dist site demo-output

# The second way of making .venv is for systems whose Python comes without ensurepip.
$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo \
		"$(PYTHON) is not Python 3.11 or newer; name one that is: make PYTHON=python3.12 $(MAKECMDGOALS)" >&2; exit 1; }
	@echo "Installing into .venv; this takes a minute or two."
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv --clear .venv >/dev/null 2>&1 || \
		{ $(PYTHON) -m venv --clear --without-pip .venv && $(PYTHON) -m pip --python .venv install --quiet pip; }
	@$(INSTALL) "pip>=25.1"
	@$(INSTALL) --editable . --group lint --group test --group docs
	@touch $@
