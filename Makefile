# make run    solve the reference case      make quick  laws, files, numpy, command line: 2 minutes
# make bench  compare with other engines    make test   all that a change can break: 13 minutes
# make docs   build the documentation       make ci     what is left: with make test, 40 minutes
# make format  set the code                 make fuzz   the long run of the fuzzers
# make lint    ruff and mypy alone          make house  which room imports which
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet

# A file's tests share what it has set up. Child processes would else compile the sources each time.
# Workers share the cores: a second thread of a BLAS would only wait for them.
PYTEST := PYTHONDONTWRITEBYTECODE= OPENBLAS_NUM_THREADS=1 $(BIN)/pytest --numprocesses auto --dist loadfile

.PHONY: run quick test ci lint house format exhaustive coverage fuzz narrow install oldest newest \
	bench docs clean

run: $(VENV)/run.stamp
	$(BIN)/condyle run --out results --figures

# Three speeds: tests without a mark, slow ones too, the rest (`markers` in pyproject.toml).
# ARGS are pytest's: make quick ARGS="tests/motion -x".
quick: $(VENV)/test.stamp
	$(PYTEST) -m "not slow and not ci" $(ARGS)

test: lint house
	$(PYTEST) -m "not ci" $(ARGS)

ci: exhaustive coverage fuzz narrow install oldest newest

# Rooms that people's words and files come through: their tests run once more, for the coverage.
ROOMS := cli markers mechanism motion

exhaustive: $(VENV)/test.stamp
	$(PYTEST) -m ci $(ROOMS:%=--ignore=tests/%) $(ARGS)

coverage: $(VENV)/test.stamp
	$(PYTEST) $(ROOMS:%=--cov=condyle.%) --cov-report= $(ROOMS:%=tests/%)
	@echo "Least covered:"
	@$(BIN)/coverage report --fail-under=95

lint: $(VENV)/test.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check --quiet .
	$(BIN)/mypy

house: $(VENV)/test.stamp
	$(BIN)/lint-imports --no-logo

format: $(VENV)/test.stamp
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

FUZZ_RUNS := 20000
ci: FUZZ_RUNS := 500
fuzz: $(VENV)/test.stamp
	$(PYTEST) tests/fuzz --fuzz-runs $(FUZZ_RUNS)

narrow: $(VENV)/test.stamp
	.ci/narrow x86-64-v3
	.ci/narrow x86-64

install: $(VENV)/test.stamp
	CONDYLE_INSTALL=required $(BIN)/pytest tests/install

oldest newest: $(VENV)/test.stamp
	.ci/versions $@

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
