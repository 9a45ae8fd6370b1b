# Everything from a fresh clone: `make demo`, `make test`. PYTHON chooses the interpreter, VENV the environment.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet
SCENE ?= slider-crank
UNTIL ?= 5
PYTEST := $(BIN)/python -m pytest
CORES ?= 2
COUNT ?= 100000
SEED ?= 0
OF ?=

# Threads of a linear-algebra library change the order of sums, and fight with the test workers.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

.DELETE_ON_ERROR:
.PHONY: help demo test laws real peers learning lint types docs bench tables fuzz fuzz-inputs mutate mutants repeat dist matrix smoke clean

help:
	@echo 'make demo   simulate scenes/$(SCENE).toml and write out/$(SCENE)/report.html'
	@echo 'make test   run the short tests; make laws: the long ones; make lint, make types: style and types; make fuzz: the laws, for long; make fuzz-inputs COUNT=N: so many broken files; make mutate: which breaks of the code no test sees (docs/mutation.md); make mutants: the same for the operad, by mutmut'
	@echo 'make real   fetch real robots (131 MB) and hold their import against Pinocchio; make peers OF="FOLDER ...": the same for all models of installed packages or of folders; make learning: derivatives of runs in PyTorch and JAX, which it installs'
	@echo 'make dist   wheel and sdist, tested as installed; make matrix: the tests under other Pythons and dependencies; make smoke: the wheel under other Pythons, where there are any; make repeat: the same digits with nothing compiled yet'
	@echo 'make docs   build docs/_build/html; make bench: what got slower than benchmarks/baseline.json; make tables: all benchmarks; make clean: remove what was built'

# One stamp an extra: installing again is needed only when pyproject.toml has changed.
$(BIN)/python:
	@echo 'Making the environment $(VENV): some seconds'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed-%: pyproject.toml | $(BIN)/python
	@echo 'Installing ephs with [$*] and what they need into $(VENV): about a minute, by the network'
	$(PIP) --editable '.[$*]'
	@touch $@

demo: $(VENV)/.installed-viz
	@echo 'Simulating scenes/$(SCENE).toml for $(UNTIL) s: some 10 s the first time, which compiles, and 2 s afterwards'
	$(BIN)/ephs run scenes/$(SCENE).toml --until $(UNTIL) --out out/$(SCENE) --replace
	@echo 'The report: out/$(SCENE)/report.html (open it in a browser; it needs no network)'

# Tests are run by programs that are compiled in a tenth of the time and run slower. Those marked optimised run programs
# as users have them, and hold their bits against the float run, so that all other laws hold for these, too.
test: $(VENV)/.installed-dev
	EPHS_LLVM_LEVEL=0 $(PYTEST) -n $(CORES) -m 'not long and not optimised'

laws: $(VENV)/.installed-dev
	$(PYTEST) -n $(CORES) -m optimised $$(grep -rl --include='test_*.py' 'mark\.optimised' tests)
	EPHS_LLVM_LEVEL=0 $(PYTEST) -n $(CORES) -m 'long and not optimised' --durations=30

real: $(VENV)/.installed-real
	$(PYTEST) -n $(CORES) tests_real

peers: $(VENV)/.installed-real
	$(BIN)/python -m tests_real.peers $(OF)

learning: $(VENV)/.installed-dev $(VENV)/.installed-learning
	$(PYTEST) -n 0 tests_learning

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.installed-dev
	$(BIN)/basedpyright --threads $(CORES)

fuzz: $(VENV)/.installed-dev
	$(PYTEST) -n $(CORES) --hypothesis-profile=fuzz

fuzz-inputs: $(VENV)/.installed-dev
	$(BIN)/python -m tests.fuzz $(COUNT) --seed $(SEED)

mutate: $(VENV)/.installed-dev
	$(BIN)/python -m tests.mutate $(OF)

mutants: $(VENV)/.installed-mutants
	$(BIN)/mutmut run --max-children $(CORES)

repeat: $(VENV)/.installed-dev
	$(BIN)/python -m tests.repeat --cold

# TESTS chooses what the jobs below run: make matrix TESTS=tests/operad ONLY="3.13-newest"
TESTS ?= tests
dist: $(VENV)/.installed-release
	rm -rf dist ephs/objects
	$(BIN)/python -m tests.release objects
	$(BIN)/python -m build --outdir dist
	$(BIN)/python -m twine check --strict dist/*
	$(BIN)/python -m tests.release wheel $(TESTS) -n$(CORES)

matrix: $(VENV)/.installed-release
	$(BIN)/python -m tests.release matrix $(TESTS) -n$(CORES) $(if $(ONLY),--only $(ONLY))

smoke: $(VENV)/.installed-dev
	@$(PIP) build uv || echo 'smoke: build and uv could not be installed'
	$(BIN)/python -m tests.release smoke

bench: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.quick

tables: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks

# MathJax is fetched once and copied into the pages, which then need no network.
MATHJAX := .build/static/mathjax/tex-svg-full.js

$(MATHJAX):
	@command -v npm >/dev/null || { echo 'make docs: npm was not found; it fetches MathJax 3, which sets the formulas. Install npm, then run make docs again.' >&2; exit 1; }
	@mkdir -p $(@D) .build/npm
	cd .build/npm && npm pack --silent mathjax@3 && tar -xzf mathjax-3*.tgz package/es5/tex-svg-full.js
	mv .build/npm/package/es5/tex-svg-full.js $@

docs: $(VENV)/.installed-docs $(MATHJAX)
	$(BIN)/python -m sphinx -W --keep-going -b html docs docs/_build/html
	@echo 'The pages: docs/_build/html/index.html'

clean:
	rm -rf out mutants ephs/objects docs/_build .build .pytest_cache .hypothesis .ruff_cache .coverage dist
	find ephs tests -name __pycache__ -type d -prune -exec rm -rf {} +
