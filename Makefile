# `make` sets everything up; every other target does so first. PYTHON=... names another interpreter.

BIN := .venv/bin
STAMP := .venv/.installed
TESTS ?=

.DEFAULT_GOAL := setup
.PHONY: setup llvm chromium lock lint format types pytest test docs slow gpu demo bench clean

setup: $(STAMP) llvm

$(STAMP): pyproject.toml tools/setup.sh tools/lock.txt
	@sh tools/setup.sh venv
	@touch $@

llvm: $(STAMP)
	@sh tools/setup.sh llvm

# The browser that tests drive; a machine without is told so.
chromium: $(STAMP)
	@sh tools/setup.sh chromium

# The newest versions that pyproject.toml allows, with their hashes, into tools/lock.txt.
lock: $(STAMP)
	@sh tools/setup.sh lock

lint: $(STAMP)
	$(BIN)/python -m ruff check .
	$(BIN)/python -m ruff format --check .
	$(BIN)/lint-imports --no-cache --no-logo

# On all cores.
types: $(STAMP)
	$(BIN)/python -m mypy --num-workers auto

format: $(STAMP)
	$(BIN)/python -m ruff check --fix .
	$(BIN)/python -m ruff format .

# As many at once as there are cores, up to four: each holds about a gigabyte. One file's tests share a process, and
# files go in the order of their names: the quick ones of `unit` come last, so that all processes end together.
pytest: setup chromium
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder $(TESTS)

# One after the other, the fastest first, also under `make -j`.
test: setup
	$(MAKE) --no-print-directory lint
	$(MAKE) --no-print-directory types
	$(MAKE) --no-print-directory pytest

# The site, in build/site: warnings are errors, the notebooks in it are executed, its figures are made.
docs: setup
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs build/site
	@echo "build/site/index.html"

# What takes minutes: fuzzing, kills at random moments, statistics over many seeds.
slow: setup
	$(BIN)/python -m pytest -m slow --timeout 3600 $(TESTS)

# The physics on an NVIDIA card: each process takes some of its memory.
gpu: setup
	LIGHTFIELD_BACKEND=cuda $(BIN)/python -m pytest -n auto --maxprocesses 8 tests/physics $(TESTS)

demo: setup
	@$(BIN)/python -m lightfield.cli demo

bench: setup
	$(BIN)/python -m pip install --quiet -e ".[dev,bench]"
	@for folder in benchmarks/*/; do \
	    name=$$(basename "$$folder"); echo "== $$name"; \
	    if test -e "$$folder/__main__.py"; then $(BIN)/python -m "benchmarks.$$name" || exit 1; \
	    elif test -e "$$folder/run.py"; then $(BIN)/python "benchmarks/$$name/run.py" || exit 1; fi; \
	done

clean:
	rm -rf .venv demo-report build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
