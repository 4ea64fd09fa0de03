# Kochab's commands. `make run` and `make test` need Python 3.11+ and make, nothing else.
#
#   make run      open the window           (make run ARGS="solve picture.jpg" for anything else)
#   make test     every check, then the tests
#   make test-windows   the tests under Wine, with a real Windows Python in a root that it makes (make test-windows TESTS=tests/cli)
#   make smoke    a minute that touches every room, for the loop while one works
#   make test-any-day   tests that know of time, on other days and in other places (needs faketime)
#   make house    what the house looks like: sizes of the rooms, circles of imports, the files of each walk
#   make resolve  which systems and Pythons have every dependency as a wheel: writes packaging/RESOLVED.md (needs the network)
#   make lint     the checks alone          make format   put the source in order
#   make coverage   every test, and the share of each room's lines that they execute
#   make mutants  deliberate bugs that the tests must catch         (make mutants MUTANTS="--minutes 5")
#   make fuzz     spoilt inputs of every kind against all that reads them    (make fuzz FUZZ="read --minutes 5")
#   make killed   everything that writes, killed at any moment, on a full disk, in a read-only folder
#   make evenings   random evenings with power cuts on mount boards of our own   (make evenings EVENINGS="48 --seed 7")
#   make nights   200 guide logs and 960 people at the bolts whose axis is known, and how the answers end   (make nights SEED=2)
#   make audit    bandit's remarks on the code, and known vulnerabilities of the packages (needs the network)
#   make catalogs   make the files of catalogs/ from registry packages   (make catalogs CATALOGS="--out DIR")
#   make bench    measure, beside other programs          (make bench BENCH="identify --quick")
#   make translations   the texts for translators, and what they have made of them      (make translations INTO=de)
#   make release   wheel built twice alike, changes, bill of materials, checksums   (make release RELEASE=--draft)
#   make clean    remove what was made

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
RUN_STAMP := $(VENV)/.run-installed
BENCH_STAMP := $(VENV)/.bench-installed
AUDIT_STAMP := $(VENV)/.audit-installed
ARGS ?=
TESTS ?= tests
ANY_DAY ?=
BENCH ?= identify --quick
MUTANTS ?=
CATALOGS ?=
INTO ?=
FUZZ ?=
EVENINGS ?= 24
SEED ?= 1
export COVERAGE_FILE := .pytest_cache/coverage
# Each process of the tests would compile them again: 11.5 s of processor before its first test instead of 4.6.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := run
.PHONY: catalogs test-windows house audit coverage evenings fuzz killed mutants nights resolve run smoke test test-any-day translations lint style types patterns format bench system clean release

run: SYSTEM = run
run: system $(RUN_STAMP)
	@$(BIN)/python -m app $(ARGS)

# Quick checks first, so that a slip is told within seconds; with -j the slow one goes on beside the
# making of patterns. Then eight processes more than there are cores: many tests wait for lines, screens
# and exposures. A process that is done takes over from the others.
test: SYSTEM = test
test: system style types $(if $(filter tests,$(TESTS)),patterns)
	@QT_QPA_PLATFORM=$${QT_QPA_PLATFORM:-offscreen} $(BIN)/python -m pytest \
	  -n auto --maxprocesses 10 --dist worksteal $(TESTS)

smoke: $(STAMP)
	@QT_QPA_PLATFORM=$${QT_QPA_PLATFORM:-offscreen} $(BIN)/python -m tests.smoke

# ANY_DAY=--quick for two of the days and the quickest tests.
test-any-day: SYSTEM = test
test-any-day: system $(STAMP)
	@$(BIN)/python -m tests.any_day $(ANY_DAY)

# The first time makes the root (8 minutes, 3 GB, needs root and debootstrap). The whole takes hours on two cores.
test-windows:
	@tests/windows/root.sh make
	@tests/windows/root.sh pytest -q -n 2 --dist worksteal $(TESTS)

lint: style types

style: $(STAMP)
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/lint-imports --no-logo

types: $(STAMP)
	@$(BIN)/mypy

resolve: $(STAMP)
	@$(BIN)/python packaging/resolve.py

# Counting lines makes the tests a third slower, so `make test` does without.
coverage: SYSTEM = test
coverage: system $(STAMP) patterns
	@QT_QPA_PLATFORM=$${QT_QPA_PLATFORM:-offscreen} $(BIN)/python -m pytest \
	  -n auto --maxprocesses 10 --dist worksteal --cov=kochab --cov-report= $(TESTS)
	@for room in app/kochab/[a-z]*/; do \
	  printf '%-16s%3s %%\n' $$(basename $$room) $$($(BIN)/coverage report --include="$$room*" --format=total); done
	@printf '%-16s%3s %%\n' everything $$($(BIN)/coverage report --format=total)

# Debian's packages are fetched with apt-get, the others with pip.
catalogs: $(STAMP)
	@$(BIN)/python -m app catalog build $(CATALOGS)

house: $(STAMP)
	@$(BIN)/python -m tests.house

mutants: $(STAMP) patterns
	@$(BIN)/python -m tests.mutants $(MUTANTS)

# 330,000 of them in about half an hour; what fails is kept in tests/fuzz/corpus and tried by every `make test`.
fuzz: $(STAMP) patterns
	@$(BIN)/python -m tests.fuzz $(FUZZ)

evenings: $(STAMP)
	@$(BIN)/python -m tests.boards.evenings $(EVENINGS)

nights: $(STAMP)
	@$(BIN)/python -m tests.nights.guide_logs --score 200 --seed $(SEED)
	@$(BIN)/python -m tests.nights.hands --count 80 --seed $(SEED)

killed: $(STAMP)
	@$(BIN)/python -m tests.fuzz.killed $(FUZZ)

audit: $(AUDIT_STAMP)
	@$(BIN)/python -m tests.audit

# INTO=de begins German; without it, every language that is there is brought up to date.
translations: $(STAMP)
	@$(BIN)/python -m tests.translations $(INTO)

patterns: $(STAMP)
	@$(BIN)/python -m tests.patterns

format: $(STAMP)
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

bench: $(BENCH_STAMP)
	@$(BIN)/python -m app bench $(BENCH)

# Installs what is absent where it may; else it says in one sentence what to type.
SYSTEM := run
system:
	@PYTHON="$(PYTHON)" .ci/system.sh $(SYSTEM)

release: $(STAMP)
	@$(BIN)/python packaging/release.py $(RELEASE)

clean:
	rm -rf $(VENV) build dist .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	find app catalogs resources tests -type d -name __pycache__ -prune -exec rm -rf {} +

$(BIN)/python: | system
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "Kochab needs Python 3.11 or newer; name one with: make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -m venv $(VENV)

# The window and the commands, without what the tests bring: a third of the time. An environment for tests has it all.
$(RUN_STAMP): pyproject.toml | $(BIN)/python
	@[ $(STAMP) -nt pyproject.toml ] || { echo "Installing Kochab into $(VENV) ..." && \
	  $(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[cameras,gamepad]"; }
	@touch $@

# Made again whenever the requirements change.
$(STAMP): pyproject.toml | $(BIN)/python
	@echo "Installing Kochab into $(VENV) ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[dev]"
	@touch $@

$(AUDIT_STAMP): $(STAMP)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[dev,audit]"
	@touch $@

$(BENCH_STAMP): $(STAMP)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable ".[dev,bench]"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps "cedar-solve>=0.5,<1"
	@touch $@
