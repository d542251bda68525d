# Everything works from a fresh clone: the environment is made on first use.
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin
READY = $(VENV)/ready

.PHONY: reproduce test lint types calibrate benchmark clean

reproduce: $(READY)
	$(BIN)/python scripts/reproduce_paper.py --out figures

test: lint types
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest --numprocesses auto

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-cache --no-logo

types: $(READY)
	$(BIN)/mypy

calibrate: $(READY)
	$(BIN)/python scripts/calibrate.py
	$(BIN)/python scripts/calibrate_intervals.py
	$(BIN)/python scripts/study_angle_errors.py
	$(BIN)/python scripts/calibrate_closures.py

benchmark: $(READY)
	$(BIN)/python benchmarks/least_squares.py
	$(BIN)/python benchmarks/cli_start.py

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable ".[dev]"
	touch $(READY)

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis
