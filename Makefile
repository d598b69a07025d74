# The way in. `make` alone lists what there is; README.md says more.
#
# Every path here is relative, so that a checkout may lie in a folder with blanks in its name.

.DEFAULT_GOAL := help
.PHONY: help environment reports first-look tutorials test test-all style docs strip lab lock audit bench mutants doctor clean

# How many notebooks or test processes at once.
JOBS ?= 2
# Test processes: one more, since tests wait for commands and browsers that they start.
TEST_JOBS ?= $(shell expr $(JOBS) + 1)
# More arguments for the tool behind a target: make test ARGS="tests/geometry -k frames"
ARGS ?=

BIN := .venv/bin

# Set by other software (ROS does), these would slip foreign packages and kernels into the environment; where
# nothing compiled may be kept (as in containers), each process would compile every file again.
unexport PYTHONPATH PYTHONHOME JUPYTER_PATH PYTHONDONTWRITEBYTECODE
export PYTHONNOUSERSITE := 1
export JUPYTER_PREFER_ENV_PATH := 1
export PYTHON LOCK_UPGRADE

help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' Makefile

environment: ## create or update .venv from environment.lock (the targets below do so themselves)
	@sh tools/environment.sh

reports: environment ## run every study that needs no download, and the tutorials, and say where the pages are
	@$(BIN)/wildlab run --all --first-look --jobs $(JOBS) $(ARGS)
	@$(BIN)/wildlab run --all --jobs $(JOBS) $(ARGS)
	@$(BIN)/python -m wildlab.runner.tutorials --jobs $(JOBS)

first-look: environment ## the same from few flights each, which `reports` begins with
	@$(BIN)/wildlab run --all --first-look --jobs $(JOBS) $(ARGS)

tutorials: environment ## run the tutorials of notebooks/tutorials, and say where their pages are
	@$(BIN)/python -m wildlab.runner.tutorials --jobs $(JOBS) $(ARGS)

test: environment ## run the tests (where CI=true: the slow ones too)
	@$(BIN)/python -m pytest -n $(TEST_JOBS) $(ARGS)

test-all: environment ## run all tests, the slow ones too
	@CI=true $(BIN)/python -m pytest -n $(TEST_JOBS) $(ARGS)

style: environment ## ruff, mypy and the notebooks' state, as the tests check them
	@$(BIN)/ruff check .
	@$(BIN)/mypy
	@$(BIN)/python -m pytest -q tests/test_notebooks_stripped.py

docs: environment ## the reference of all functions, to be opened from disk
	@$(BIN)/python tools/reference.py

strip: environment ## take outputs and execution counts out of the notebooks
	@$(BIN)/nbstripout --keep-id notebooks/*.ipynb notebooks/tutorials/*.ipynb

lab: environment ## open JupyterLab on the notebooks; git then strips outputs on commit
	@! git rev-parse --git-dir >/dev/null 2>&1 || git config filter.nbstripout.clean '$(BIN)/nbstripout --keep-id'
	@$(BIN)/jupyter lab --notebook-dir=notebooks $(ARGS)

lock: ## rewrite environment.lock from pyproject.toml, keeping versions (LOCK_UPGRADE=1 takes newer ones)
	@sh tools/environment.sh lock

audit: environment ## known faults of the packages in environment.lock (asks the network)
	@$(BIN)/python tools/audit.py

bench: environment ## compare speed with other packages, as ratios
	@$(BIN)/python -m benchmarks $(ARGS)

mutants: environment ## break lines of the code one at a time, and see that a test notices each
	@$(BIN)/python tools/mutants.py $(ARGS)

doctor: environment ## what is wrong with this installation, and the fix
	@$(BIN)/wildlab doctor

clean: ## remove the environment and caches; reports stay
	@rm -rf .venv .pytest_cache .mypy_cache .ruff_cache .hypothesis build wildlab.egg-info
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +
