# Everything runs in .venv, which is built once from requirements.lock and rebuilt when that file changes. The compiled
# kernels are rebuilt when one of their C files changes; where there is no C compiler, PyPI's is fetched.
PYTHON  ?= python3
ROBOT   ?= er50
BIN     := .venv/bin
PIP     := $(BIN)/python -m pip install --quiet --disable-pip-version-check
CORE    := identification/armload_core
KERNELS := $(CORE)/kernels.abi3.so
DIST    := dist
SMALL   := controller/commission.lock

# $(call installed,LOCK) installs what a lock file lists, and shows which of how many it is at.
installed = total=$$(grep -c == $(1)); $(BIN)/python -m pip install --disable-pip-version-check --progress-bar off \
  --require-hashes --no-deps -r $(1) | awk -v total=$$total '\
    /^(Collecting|Requirement already)/ { printf "\r   %d of %d  %-40.40s", ++n, total, $$1 == "Collecting" ? $$2 : $$4; fflush() } \
    /^Installing/ { printf "\r   %d of %d  installing                              ", n, total; fflush() } END { print "" }'

# $(call timed,WHAT,COMMANDS) says what is being done, and how long it took.
timed = @echo "== $(1)"; start=$$(date +%s); { $(2); } && echo "== done in $$(( $$(date +%s) - start )) s"

SHELL := /bin/bash
.SHELLFLAGS := -o pipefail -c

.PHONY: docs commission test env lint bench paper accuracy pictures peers wheels lock

commission: $(KERNELS)
	$(call timed,commissioning the simulated arm $(ROBOT) over CANopen: four runs and an identification in two minutes,$(BIN)/armload commission $(ROBOT))

# The rewritten assertions are written beside the tests, even where PYTHONDONTWRITEBYTECODE is set: a second run, and the
# fifty programs that tests start, load byte code.
# Work is stolen from the end of another worker's share, so that few fixtures of a module are made by both.
test: env
	@echo "== testing: about three minutes in one process, half of that with WORKERS=2"
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest $(if $(WORKERS),-n $(WORKERS) --dist worksteal)

env: $(KERNELS) .venv/.requirements

$(KERNELS): .venv/.commission pyproject.toml $(wildcard $(CORE)/source/*.[ch] $(CORE)/source/*/*.[ch]) $(CORE)/source/compilation/build_extension.py
	$(call timed,building: the kernels are compiled and armload is installed into .venv: some seconds,$(PIP) --no-deps --no-build-isolation --editable .)
	@touch $@

.venv/.requirements: requirements.lock .venv/.commission
	$(call timed,downloading what tests and extras require into .venv (1.2 GB): a minute or two the first time,$(call installed,requirements.lock))
	@touch $@

# What a commissioning runs, and nothing else.
.venv/.commission: $(SMALL)
	$(call timed,downloading what a commissioning requires into .venv (0.5 GB): half a minute the first time,$(PYTHON) -m venv .venv && $(call installed,$(SMALL)))
	@PYTHONPATH=identification $(BIN)/python -c "from armload_core.c_compiler import c_compiler as cc; exit(cc() is None)" || { \
	  echo "== no C compiler was found: downloading one, ziglang"; $(PIP) --require-hashes --no-deps -r $(CORE)/source/compilation/compiler.lock; }
	@touch $@

lint: env
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/mypy --strict tests/typing
	$(BIN)/mypy --strict tests/example_plugin
	$(BIN)/lint-imports

bench: env
	$(BIN)/python -m benchmarks.timing

# Exit status 1 where a criterion is not met. The periods from MuJoCo are cached under ~/.cache/armload.
paper: env
	$(BIN)/python -m benchmarks.paper

accuracy: env
	$(BIN)/python -m benchmarks.accuracy

# The site, from the Markdown in the folders; no warning is allowed, and every link within it is checked.
docs: env
	$(call timed,building the documentation: a minute,$(BIN)/python -m sphinx --fail-on-warning --keep-going -q -c docs . docs/site)
	@echo "== open docs/site/index.html"

# The README's picture, from a commissioning.
pictures: env
	$(BIN)/python -m benchmarks.canopen_runs.pictures

# Beside other programs, which have an environment of their own: FIGAROH, casadi, Pinocchio.
peers: env benchmarks/peers/.venv/.requirements
	$(BIN)/python -m benchmarks.peers

benchmarks/peers/.venv/.requirements: benchmarks/peers/requirements.lock
	$(call timed,downloading the peers into benchmarks/peers/.venv (1.3 GB),$(PYTHON) -m venv $(@D) && $(@D)/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes --no-deps -r $<)
	@touch $@

# What is published, into dist: the sources, and a wheel each for x86-64 and aarch64. Has an environment of its own.
wheels: .venv-wheels/.requirements
	$(call timed,building the source distribution and the wheels into $(DIST): half a minute,.venv-wheels/bin/python $(CORE)/source/compilation/build_wheels.py $(DIST))

.venv-wheels/.requirements: $(CORE)/source/compilation/wheels.lock
	$(call timed,downloading what builds wheels into .venv-wheels (0.4 GB),$(PYTHON) -m venv .venv-wheels && .venv-wheels/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes --no-deps -r $<)
	@touch $@

# Resolves the pinned versions anew; needs pip-tools in the environment that runs it. Lines of options, in which the
# addresses of this machine's configuration would stand, are taken out.
COMPILE := -m piptools compile --quiet --strip-extras --allow-unsafe --generate-hashes --no-header
lock:
	$(PYTHON) $(COMPILE) \
	  --extra docs --extra identify --extra report --extra sim --extra urdf --extra ros --extra parquet --extra live --extra ros2 --extra fleet --extra dev --output-file requirements.lock pyproject.toml
	$(PYTHON) $(COMPILE) --constraint requirements.lock --build-deps-for editable \
	  --extra identify --extra report --extra sim --output-file $(SMALL) pyproject.toml
	sed -i '/^--/d; /^$$/d' requirements.lock $(SMALL)

