# Developers' verbs. `make run` and `make test` need nothing but Python 3.11+ with venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
QUIET := $(if $(shell test -t 2 && echo terminal),,--quiet)  # pip's progress bars on a terminal only
STAMP := $(VENV)/.installed

.PHONY: env run test test-all test-long mutate abuse test-tools bench validate lint types style format meshes docs docs-check generated lock clean

env: $(STAMP)

$(STAMP): .ci/lock.txt pyproject.toml
	@echo "env: creating $(VENV) and installing the locked packages in it, some 400 MB"
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install $(QUIET) --require-hashes -r .ci/lock.txt
	@$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	@echo "env: compiling the forces and the estimators, once, 40 to 90 s"
	@$(BIN)/twin doctor --compile
	@touch $@

run: env
	$(BIN)/twin demo

# Debian packages behind the tests that look at pictures or run the real firmware.
test-tools:
	@bash .ci/test-tools

test: env test-tools
	@PYTHON=$(BIN)/python bash .ci/tests

# Also the tests that take more than 1.5 s each, as .ci/run does.
test-all: env test-tools
	@PYTHON=$(BIN)/python bash .ci/tests "not slow and not bench"

# The long forms as well: whole minutes of simulated telemetry, hundreds of seeds.
test-long: env test-tools
	@PYTHON=$(BIN)/python bash .ci/tests "slow or not slow"

# Plants wrong lines and looks whether a test turns red: half an hour on two processors.
mutate: env test-tools
	$(BIN)/python -m tests.mutation

# Hostile files, frames, peers, faults, full disks and signals; SHORT=1 goes once around.
abuse: env
	$(BIN)/python -m tests.abuse $(if $(SHORT),--short)

# One table of speeds as ratios to limits and peers, and the same as runs/bench.json.
bench: env test-tools
	@bash .ci/test-tools rt-tests
	@mkdir -p runs
	$(BIN)/python -m tests.benchmarks --json runs/bench.json

# Measures the claims against independent truths and renews docs/validation.md.
validate: env
	$(BIN)/python -m tests.validation

# On two processes with `make --jobs=2 --output-sync lint`.
lint: types docs style

types: env
	$(BIN)/mypy

style: docs-check
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/python .ci/stub.py --check
	@bash .ci/test-tools cppcheck
	@bash .ci/cppcheck

format: env
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

meshes: env
	$(BIN)/python -m meshes.generate

docs-check: env
	$(BIN)/python .ci/states.py --check
	$(BIN)/python .ci/protocol.py --check
	$(BIN)/python .ci/docs_check.py

# The documentation as a site in build/docs; every warning is an error.
docs: env
	$(BIN)/python -m sphinx -qEW --keep-going -c docs . build/docs
	@echo "docs: build/docs/index.html"

# Writes what is generated: the typed signatures, the state tables, the tables of messages, the licences.
generated: env
	$(BIN)/python .ci/stub.py
	$(BIN)/python .ci/states.py
	$(BIN)/python .ci/protocol.py
	$(BIN)/python .ci/licences.py

# Renews the pinned lock; needs uv. The lock carries no registry address. KEEP=1 keeps the versions that it has.
LOCKED := dev docs report sysid mcap usd
lock:
	uv pip compile --quiet $(if $(KEEP),,--upgrade) --universal --python-version 3.11 --generate-hashes \
	  --no-header --no-annotate --no-emit-index-url $(LOCKED:%=--extra %) pyproject.toml -o .ci/lock.txt

clean:
	rm -rf $(VENV) build dist
	find analysis hardware twin -name '*.nb[ic]' -delete  # compiled functions
