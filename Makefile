# Set-up is a stamp: it runs again when pyproject.toml changes. torch comes first and pinned: a build that installs fast.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed

export OMP_NUM_THREADS ?= 2

OLD := import sys; sys.exit("shipid needs Python 3.11 or newer: make study PYTHON=python3.12" if sys.version_info < (3, 11) else 0)

.PHONY: study test slow check docs format faults bench clean

study: $(STAMP)          ## the main job: the embedded default study, and the path of its report
	$(BIN)/shipid study run quick

# Tests run in processes of one thread each; `make test WORKERS=4` takes more of them. Compiled files are kept:
# else every process compiles the package and the tests anew.
WORKERS ?= 2
PYTEST  := OMP_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(BIN)/pytest -n $(WORKERS) --dist worksteal

test: $(STAMP)           ## all tests but the slow ones
	$(PYTEST) -m "not slow"

slow: $(STAMP)           ## the slow tests
	$(PYTEST) -m slow

check: $(STAMP)          ## format, lint, types, layers, names
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m tests.names

# The site: warnings are errors, links are checked, nothing is fetched. What builds it is a stamp beside that of the rest.
DOCS := $(VENV)/.installed-docs

docs: $(DOCS)            ## the documentation as a site, in docs/_build/html
	OMP_NUM_THREADS=1 $(BIN)/sphinx-build -q -W --keep-going -b html docs docs/_build/html
	@echo "site: docs/_build/html/index.html"

format: $(STAMP)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# A campaign of faults, drawn by seed: SCALE=1 is a fifth of it, SCALE=5 all.
SCALE ?= 1
SEED  ?= 0
faults: $(STAMP)         ## kills at every write, mutated documents, full disks, damaged folders: a table of outcomes
	OMP_NUM_THREADS=1 $(BIN)/python -m tests.faults --scale $(SCALE) --seed $(SEED)

bench: $(STAMP)          ## timings: never in tests
	$(BIN)/python -m tests.benchmarks

clean:
	rm -rf $(VENV) results docs/_build docs/generated .mypy_cache .ruff_cache .pytest_cache .hypothesis

$(STAMP): pyproject.toml
	@test -x $(BIN)/python || $(PYTHON) -c '$(OLD)'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check torch==2.13.0
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

$(DOCS): $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	touch $@
