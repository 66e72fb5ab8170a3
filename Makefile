.DEFAULT_GOAL := help
.PHONY: help setup run test test-long test-versions test-processors mutants lint docs release-check coverage bench bench-gap lock figures clean

PYTHON ?= $(shell for python in python3 python3.13 python3.12 python3.11; do \
	"$$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo "$$python" && break; done)
BIN := .venv/bin
LOCKED := .venv/locked
READY := .venv/ready
BENCH := .venv-bench/bin
PEERS := .venv-bench/ready

help:  ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "make %-15s%s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))

setup: $(READY)  ## makes .venv with the locked packages and this project

$(LOCKED): requirements.lock
	@test -n "$(PYTHON)" || { echo "No Python 3.11 or newer found: install one, or name it: make PYTHON=/path/to/python3" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip' || { echo "$(PYTHON) cannot make environments: install its venv module (Debian: apt-get install python3-venv)" >&2; exit 1; }
	$(PYTHON) -m venv --clear .venv
	$(BIN)/pip install --quiet --require-hashes --requirement requirements.lock
	@touch $@

$(READY): $(LOCKED) pyproject.toml
	$(BIN)/pip install --quiet --no-deps --no-build-isolation --editable .
	@$(BIN)/python -m compileall -q algorithms models problems tolevo  # where Python may not write bytecode, a third of a start
	@touch $@

run: $(READY)  ## the main job: cost against backlash of the RV-40E-121
	$(BIN)/tolevo run configs/rv40e_backlash.toml --out runs/rv40e_backlash --overwrite

# One thread of linear algebra per process: those of several processes would wait for each other.
test: $(READY)  ## the tests, on all cores
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest --numprocesses logical --dist worksteal -m "not slow"

test-long: $(READY)  ## all tests, slow ones as well, and 20,000 damaged inputs
	TOLEVO_EXAMPLES=$${TOLEVO_EXAMPLES:-20000} $(BIN)/python -m pytest --numprocesses logical --dist worksteal

test-versions: $(READY)  ## the tests with the lowest and newest versions of all packages, per Python (needs the network)
	@$(BIN)/pip install --quiet uv
	$(BIN)/python tools/versions.py

test-processors: $(READY)  ## the numerical tests and the exact results as on every processor that runs here, with 1 and 2 threads (hours)
	$(BIN)/python -m tools.processors

mutants: $(READY)  ## mutants of the code that makes numbers, and whether tests notice (hours; goes on where it was stopped)
	$(BIN)/python -m tools.mutants

lint: $(READY)  ## style, licences, types and the arrows between the rooms
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python tools/licences.py --check
	$(BIN)/python tools/link_packages.py
	@$(MAKE) --no-print-directory --jobs=2 --output-sync=target lint-mypy lint-imports

.PHONY: lint-mypy lint-imports
lint-mypy:
	$(BIN)/mypy

lint-imports:
	cd .links && PYTHONPATH=. ../$(BIN)/lint-imports --no-cache

docs: $(READY)  ## the documentation site, in site/; a warning is an error
	$(BIN)/python tools/link_packages.py
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet --strict

release-check: $(READY)  ## builds sdist and wheel, and tries each in an empty environment
	$(BIN)/python tools/release_check.py

coverage: $(READY)  ## the tests, with the lines and branches they miss
	$(BIN)/python -m pytest --cov --cov-report=term --cov-report=html

.venv-bench/locked: benchmarks/requirements.lock
	$(PYTHON) -m venv --clear .venv-bench
	$(BENCH)/pip install --quiet --require-hashes --requirement benchmarks/requirements.lock
	@touch $@

$(PEERS): .venv-bench/locked pyproject.toml
	$(BENCH)/pip install --quiet --no-deps --no-build-isolation --editable .
	@touch $@

bench: $(PEERS) $(READY)  ## optimisers side by side and the speeds that are promised; QUICK=1 for a look
	$(BENCH)/python -m benchmarks.compare $(if $(QUICK),--quick)
	$(BENCH)/python benchmarks/propagation.py
	$(BENCH)/python benchmarks/reducer.py
	$(BENCH)/python benchmarks/engine.py
	$(BENCH)/python benchmarks/manipulator.py
	$(BENCH)/python benchmarks/dynamics.py
	$(BENCH)/python benchmarks/contact.py
	$(BENCH)/python benchmarks/population.py
	$(BENCH)/python benchmarks/tables.py
	$(BIN)/python -m benchmarks.study
	$(BIN)/python -m benchmarks.tasks.rivals runs/tasks
	$(BIN)/python -m benchmarks.scaling $(if $(QUICK),--quick,--write docs)
	$(BIN)/python -m benchmarks.wide $(if $(QUICK),--designs 2000)

bench-gap: $(PEERS) $(READY)  ## the benchmark of naming, about 35 minutes on two cores; goes on where it was stopped
	$(BIN)/python -m benchmarks.gap --write docs/gap_benchmark.md
	$(BENCH)/python -m benchmarks.gap.elsewhere --write docs/gap_benchmark.md

lock: $(READY)  ## renews requirements.lock and benchmarks/requirements.lock
	$(BIN)/pip install --quiet uv
	$(BIN)/uv pip compile --quiet --no-strip-extras --universal --python-version 3.11 --fork-strategy fewest --upgrade \
		--generate-hashes --no-annotate --custom-compile-command "make lock" \
		--extra dev --extra docs --extra gap --extra mcp --extra study --output-file requirements.lock pyproject.toml
	$(BIN)/uv pip compile --quiet --no-strip-extras --universal --python-version 3.11 --fork-strategy fewest --upgrade \
		--generate-hashes --no-annotate --custom-compile-command "make lock" \
		--constraint requirements.lock --group peers --output-file benchmarks/requirements.lock pyproject.toml

figures: $(READY)  ## draws the figures of the README anew
	$(BIN)/python tools/readme_figures.py

clean:  ## removes what make made, environments included, but no results
	rm -rf .venv .venv-bench .venv-versions .links build dist htmlcov site *.egg-info .coverage .coverage.* .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
