# make run    solve the reference case      make test   lint, types, tests
# make bench  compare with other engines    make docs   build the documentation
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet

.PHONY: run test bench docs clean

run: $(VENV)/run.stamp
	$(BIN)/condyle run --out results --figures

test: $(VENV)/test.stamp
	$(BIN)/ruff check src tests benchmarks examples docs
	$(BIN)/mypy
	$(BIN)/pytest --numprocesses 2

bench: $(VENV)/bench.stamp
	$(BIN)/condyle bench --out results/bench.json

docs: $(VENV)/docs.stamp
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

clean:
	rm -rf $(VENV) results site build

$(VENV)/run.stamp: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "condyle needs Python 3.11 or newer; this is " + sys.version.split()[0] + ". Set PYTHON=...")'
	$(PYTHON) -m venv $(VENV)
	$(PIP) --editable '.[all]'
	@touch $@

$(VENV)/%.stamp: $(VENV)/run.stamp
	$(PIP) --editable '.[$*]'
	@touch $@
