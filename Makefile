# Everything runs in .venv, which is built once from requirements.lock and rebuilt when that file changes. The compiled
# kernels are rebuilt when one of their C files changes; where there is no C compiler, PyPI's is fetched.
PYTHON  ?= python3
ROBOT   ?= er50
BIN     := .venv/bin
PIP     := $(BIN)/python -m pip install --quiet --disable-pip-version-check
CORE    := identification/armload_core
KERNELS := $(CORE)/kernels.abi3.so

.PHONY: commission test env lint bench paper accuracy lock

commission: env
	$(BIN)/armload commission $(ROBOT)

test: env
	$(BIN)/python -m pytest $(if $(WORKERS),-n $(WORKERS))

env: $(KERNELS)

$(KERNELS): .venv/.requirements pyproject.toml $(wildcard $(CORE)/source/*.[ch]) $(CORE)/source/build_extension.py
	$(PIP) --no-deps --no-build-isolation --editable .
	touch $@

.venv/.requirements: requirements.lock
	$(PYTHON) -m venv .venv
	$(PIP) --require-hashes --no-deps -r requirements.lock
	for cc in $$CC cc gcc clang; do command -v $$cc >/dev/null && exit; done; \
	  $(PIP) --require-hashes --no-deps -r $(CORE)/source/compiler.lock
	touch $@

lint: env
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/mypy --strict tests/typing
	$(BIN)/lint-imports

bench: env
	$(BIN)/python -m benchmarks

# Exit status 1 where a criterion is not met. The periods from MuJoCo are cached under ~/.cache/armload.
paper: env
	$(BIN)/python -m benchmarks.paper

accuracy: env
	$(BIN)/python -m benchmarks.accuracy

# Resolves the pinned versions anew; needs pip-tools in the environment that runs it. Lines of options, in which the
# addresses of this machine's configuration would stand, are taken out.
lock:
	$(PYTHON) -m piptools compile --quiet --strip-extras --allow-unsafe --generate-hashes --no-header \
	  --extra sim --extra urdf --extra dev --output-file requirements.lock pyproject.toml
	sed -i '/^--/d; /^$$/d' requirements.lock
