# Commands of the project. Each target installs what it needs.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
EXAMPLE := measurements/recipes/hematite_on_glass_140nm.toml

# Python then keeps the bytecode of what it imports: a process that fits starts in 1.8 s of processor time, not 4.2 s
unexport PYTHONDONTWRITEBYTECODE

# Tests spend most of their time in compilation. These flags halve the compilation time, at the cost of run time.
# Rounding may differ, so tests that count digits (EXACT) run without them.
# jaxlib 0.11 has one code generator, and ends the process for a flag that it does not know
OLDER_CODE = $(shell $(BIN)/python -c "import jaxlib; \
  print('--xla_cpu_use_fusion_emitters=false' * (jaxlib.version.__version_info__ < (0, 11)))")
QUICK_COMPILE = XLA_FLAGS="--xla_backend_optimization_level=0 --xla_llvm_disable_expensive_passes=true \
  --xla_cpu_parallel_codegen_split_count=1 $(OLDER_CODE)"
# both cores have tests, so a program is compiled by one thread; glibc keeps memory that a compilation returns
ONE_THREAD := XLA_FLAGS=--xla_cpu_parallel_codegen_split_count=1
KEEP_MEMORY := MALLOC_TRIM_THRESHOLD_=4000000000 MALLOC_MMAP_THRESHOLD_=4000000000 MALLOC_TOP_PAD_=67108864
EXACT := tests/hard tests/fitting/test_nist.py tests/optics/test_elementary.py
PYTEST := $(BIN)/python -m pytest -n 2 --dist loadfile -m "not slow"

BROWSER_TESTS := tests/reporting/test_page_in_browser.py $(addprefix tests/explorer/test_,in_browser.py \
  angles_in_browser.py surface_in_browser.py widget.py)

NOTEBOOKS := $(wildcard notebooks/*.ipynb)
EXECUTED := executed/done

.PHONY: schema fit fits notebooks test exact coverage docs dist dist-check lint browser-tests bench verdicts peers properties fuzz tolerance measurements slow clean figures

# on Debian, pip for virtual environments is a separate package; without it, the system's pip is used
$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "pellicle needs Python 3.11 or newer: run make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -m venv $(VENV) 2>/dev/null || \
	  { rm -rf $(VENV); $(PYTHON) -m venv --without-pip $(VENV) && \
	    $(PYTHON) -m pip --python $(VENV)/bin/python install --quiet pip; } || \
	  { rm -rf $(VENV); echo "no virtual environment could be created: install python3-venv"; exit 1; }

# --no-compile: Python compiles modules when they are first imported, a small part of those installed
$(VENV)/.fit: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --no-compile --editable .
	@touch $@

$(VENV)/.dev: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --no-compile --editable ".[dev]"
	@touch $@ $(VENV)/.fit

fit: $(VENV)/.fit
	$(BIN)/pellicle fit --recipe $(EXAMPLE) --out results/hematite_on_glass_140nm

# repeats the kept studies; fails if a result has changed
fits: $(VENV)/.fit
	$(BIN)/python scripts/rerun_fits.py

# pyright takes one core for a minute, and shares the two with the first tests
test: $(VENV)/.dev
	$(MAKE) --jobs 2 lint exact
	$(KEEP_MEMORY) $(QUICK_COMPILE) $(PYTEST) $(addprefix --ignore=,$(EXACT) $(BROWSER_TESTS))

exact: $(VENV)/.dev
	$(KEEP_MEMORY) $(ONE_THREAD) $(PYTEST) $(EXACT)

# of all tests, those of make slow too
coverage: $(VENV)/.dev
	$(BIN)/python -m pytest -n 2 --dist loadfile --cov --cov-report=term

# executed once, for the reader and for the documentation. PELLICLE_SHORT=1 is for tests: fewer points, quick compilation
notebooks: $(VENV)/.dev
	rm -rf executed && mkdir executed && cp notebooks/*.ipynb notebooks/matplotlibrc executed
	$(if $(PELLICLE_SHORT),$(KEEP_MEMORY) $(QUICK_COMPILE)) PYTHONWARNINGS="ignore:Error reading persistent compilation cache entry" \
	  JAX_COMPILATION_CACHE_DIR=$(CURDIR)/.pytest_cache/jax \
	  JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS=0 PELLICLE_CACHE=$(CURDIR)/executed/compiled \
	  $(BIN)/python -m pytest -n 2 --nbmake --nbmake-timeout 300 --overwrite --durations 8 executed
	@touch $(EXECUTED)

$(EXECUTED): $(NOTEBOOKS)
	$(MAKE) notebooks

# into site/, with the executed notebooks; broken links are errors
docs: $(VENV)/.dev $(EXECUTED)
	$(BIN)/python scripts/stage_docs.py
	$(BIN)/zensical build --clean --strict

# sdist and wheel into dist/, with their metadata and lists of files checked
dist: $(VENV)/.dev
	$(BIN)/python scripts/check_distribution.py

# and an installation of the wheel for each Python that is found: make dist-check PYTHONS="python3.11 /path/to/python3.13"
PYTHONS ?= python3.11 python3.12 python3.13
dist-check: $(VENV)/.dev
	$(BIN)/python scripts/check_distribution.py $(PYTHONS)

# pages of reports and the explorer in a headless Chromium; two minutes. Skipped, with a line, where there is none
browser-tests: $(VENV)/.dev
	$(BIN)/python -m pip install --quiet --no-compile --editable ".[browser,explore]"
	$(KEEP_MEMORY) $(QUICK_COMPILE) $(BIN)/python -m pytest -n 2 --dist loadfile -ra $(BROWSER_TESTS)

# long statistical tests, tests that a cheaper one covers or that compile for seconds
slow: $(VENV)/.dev
	$(KEEP_MEMORY) $(ONE_THREAD) $(BIN)/python -m pytest -n 2 --dist loadfile -m slow $(EXACT)
	$(KEEP_MEMORY) $(QUICK_COMPILE) $(BIN)/python -m pytest -n 2 --dist loadfile -m slow --durations 8 \
	  $(addprefix --ignore=,$(EXACT))

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/pyright --pythonpath $(BIN)/python

bench: $(VENV)/.dev
	$(BIN)/python benchmarks/film.py
	$(BIN)/python benchmarks/fit.py
	$(BIN)/python benchmarks/cold_start.py
	$(BIN)/python benchmarks/read.py
	$(BIN)/python benchmarks/watch.py

# verdicts on simulated measurements with the flaws of real ones; a list of those that should be others
verdicts: $(VENV)/.dev
	$(BIN)/python benchmarks/verdicts

# installs other packages (several GB) in a separate environment; writes the tables of docs/hard_cases.md
peers: $(VENV)/.dev
	$(BIN)/python benchmarks/peers --write

# a thousand random scenes: is the error of every plan within its stated bound?
tolerance: $(VENV)/.dev
	$(BIN)/python benchmarks/tolerance.py

# 10 000 damaged and random files for every reader
fuzz: $(VENV)/.dev
	$(BIN)/python benchmarks/fuzz_readers.py

properties: $(VENV)/.dev
	$(BIN)/python benchmarks/properties.py

figures: $(VENV)/.fit
	$(BIN)/python scripts/make_figures.py

schema: $(VENV)/.fit
	$(BIN)/python scripts/make_schema.py

measurements: $(VENV)/.fit
	$(BIN)/python scripts/make_measurements.py

clean:
	rm -rf $(VENV) .venv-peers results executed build site dist .cache .pytest_cache .ruff_cache .hypothesis .coverage
