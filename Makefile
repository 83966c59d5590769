# make run    solve the reference case      make test   lint, types, tests
# make bench  compare with other engines    make docs   build the documentation
# make format  set the code                 make fuzz   the long run of the fuzzers
# make lint    ruff and mypy alone          make house  which room imports which
# make coverage  what the tests of four rooms leave out; make test COVER=1 holds it
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet

.PHONY: run test lint house format fuzz coverage narrow install bench docs clean

run: $(VENV)/run.stamp
	$(BIN)/condyle run --out results --figures

# Rooms that people's words and files come through. Measuring all takes half as long again.
ROOMS := cli markers mechanism motion
COVERED := $(ROOMS:%=tests/%)

test: lint house
ifdef COVER
	$(BIN)/pytest --numprocesses 2 $(PYTEST) $(COVERED:%=--ignore=%)
	$(MAKE) coverage
else
	$(BIN)/pytest --numprocesses 2 $(PYTEST)
endif

lint: $(VENV)/test.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check --quiet .
	$(BIN)/mypy

house: $(VENV)/test.stamp
	$(BIN)/lint-imports --no-logo

format: $(VENV)/test.stamp
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

fuzz: $(VENV)/test.stamp
	$(BIN)/pytest --numprocesses 2 tests/fuzz --fuzz-runs 100000

coverage: $(VENV)/test.stamp
	$(BIN)/pytest --numprocesses 2 $(ROOMS:%=--cov=condyle.%) --cov-report= $(COVERED)
	@echo "Least covered:"
	@$(BIN)/coverage report --fail-under=95

narrow: $(VENV)/test.stamp
	.ci/narrow x86-64-v3
	.ci/narrow x86-64

install: $(VENV)/test.stamp
	CONDYLE_INSTALL=required $(BIN)/pytest tests/install

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
