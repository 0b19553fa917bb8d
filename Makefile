# Every target makes its own .venv; nothing is needed beside Python >= 3.11 with pip.
#   make check   lint, types, import rules and the fast tests: the inner loop
#   make test    the same with all tests
# Another interpreter: make PYTHON=python3.12 test

PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check
# a test process for each processor; each takes the next test when it is idle
PYTEST := $(BIN)/pytest --numprocesses logical --dist worksteal

.PHONY: demo check test lint docs bench clean

demo: $(READY)
	$(BIN)/sounder demo --out demo-output

check: lint
	$(PYTEST) -m "not slow"

test: lint
	$(PYTEST)

lint: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/codespell
	$(BIN)/lint-imports --no-logo

docs: $(READY)
	$(BIN)/mkdocs build --strict

bench: $(READY)
	$(INSTALL) --editable '.[cluster]' --group bench
	$(BIN)/python benchmarks/run.py

clean:
	rm -rf .venv .grimp_cache .import_linter_cache .mypy_cache .pytest_cache .ruff_cache .hypothesis build dist site demo-output

# The second way of making .venv is for systems whose Python comes without ensurepip.
$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo \
		"$(PYTHON) is not Python 3.11 or newer; name one that is: make PYTHON=python3.12 $(MAKECMDGOALS)" >&2; exit 1; }
	@echo "Installing into .venv; this takes a minute or two."
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv --clear .venv >/dev/null 2>&1 || \
		{ $(PYTHON) -m venv --clear --without-pip .venv && $(PYTHON) -m pip --python .venv install --quiet pip; }
	@$(INSTALL) "pip>=25.1"
	@$(INSTALL) --editable . --group test --group docs
	@touch $@
