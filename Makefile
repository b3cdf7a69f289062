# From nothing but python3 and make:  make demo   (or: make test)
PYTHON ?= python3
WORKERS ?= 2
BIN := .venv/bin
STAMP := .venv/.installed
DOCS_STAMP := .venv/.installed-docs
comma := ,

# Formulas are drawn in the reader's browser, by a file of the site itself.
MATHJAX := mathjax@3.2.2
# What tries the finished pages for readers who cannot see them; it stays out of the site.
AXE := axe-core@4.10.3

# uv when it can be had (seconds), pip when not (a minute or so).
define install
	@if [ -x $(BIN)/uv ] && UV_LINK_MODE=copy $(BIN)/uv pip install --quiet --python $(BIN)/python -e '.[$(1)]'; \
	then :; \
	else echo "uv could not install; using pip, which takes longer"; $(BIN)/python -m pip install --quiet -e '.[$(1)]'; \
	fi
endef

# Small matrices: threads of the linear algebra library only get in each other's way.
SINGLE := OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 MKL_NUM_THREADS=1
QUIET_PLOTS := MPLBACKEND=Agg

# Python is started hundreds of times: what it imports is compiled once for all, beside the environment, even where Python was told to
# keep nothing.
export PYTHONDONTWRITEBYTECODE :=
export PYTHONPYCACHEPREFIX := $(CURDIR)/.venv/pycache

.DEFAULT_GOAL := help
.PHONY: help setup demo page test test-slow attack coverage mutants lint style format architecture changelog docs release-check versions licences bench arena torch study results clean

help:
	@echo "make setup         .venv with everything in it"
	@echo "make demo          modes of a measured beam, next to the published ones"
	@echo "make page          the front end of modalscope app (needs Node 20 and npm)"
	@echo "make test          lint, the quick tests and every example in a docstring (5 minutes on two cores; TESTS=tests/io: a part)"
	@echo "make test-slow     the other tests (minutes)"
	@echo "make attack SEED=3 what SECURITY.md promises: damaged and contradictory files, wrong values, units, kills, full disks (half an hour)"
	@echo "make coverage      both, and which lines the quick ones run (95 % of them at least)"
	@echo "make versions      formats, data classes and methods with the earliest and the newest packages (minutes)"
	@echo "make release-check archive and wheel built, installed into empty environments, and tested there (minutes)"
	@echo "make licences      what modalscope needs, and under which licences (SBOM=bill.json: as CycloneDX)"
	@echo "make results       small jobs of every kind and all real tests, held against the results in tests/results, and our row of the arena (minutes)"
	@echo "make mutants       faults put in on purpose, each of which its tests must notice (minutes)"
	@echo "make lint          ruff, mypy, floors"
	@echo "make format        let ruff write what it can"
	@echo "make architecture  draw the floors of pyproject.toml into the documents"
	@echo "make changelog     join the fragments of changelog.d into CHANGELOG.md"
	@echo "make docs          the documentation site in build/docs, every example in it run"
	@echo "make bench         time and memory (minutes)"
	@echo "make arena         other programs and single methods on measured and simulated tests, into docs/arena (FIELD=ambient PROGRAM=koma SET=tower: a part; hours)"
	@echo "make torch         PyTorch, for large products on a graphics card"
	@echo "make study         statistics over many seeds, written into docs/validation (long; WORD=selection: one subject)"
	@echo "make clean         remove what make made"

setup: $(STAMP)

$(STAMP): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "modalscope needs Python 3.11 or later; say PYTHON=..."; exit 2; }
	@[ -x $(BIN)/python ] || $(PYTHON) -m venv .venv
	@[ -x $(BIN)/uv ] || $(BIN)/python -m pip install --quiet uv || true
	$(call install,dev)
	@touch $@

$(DOCS_STAMP): $(STAMP)
	$(call install,dev$(comma)docs)
	@touch $@

docs/_static/mathjax/tex-svg.js:
	@command -v npm >/dev/null || { echo "make docs needs npm once, for $(MATHJAX)"; exit 2; }
	@mkdir -p build/npm docs/_static/mathjax
	@npm install --silent --fetch-retries=5 --no-save --no-audit --no-fund --prefix build/npm $(MATHJAX) $(AXE)
	@cp build/npm/node_modules/mathjax/es5/tex-svg.js $@

# Warnings are errors; a link that leads nowhere is a warning.
docs: $(DOCS_STAMP) docs/_static/mathjax/tex-svg.js
	@mkdir -p build/conformance
	@$(SINGLE) $(QUIET_PLOTS) $(BIN)/modalscope reproduce --quiet --force -o build/conformance/conformance.html
	@$(SINGLE) $(QUIET_PLOTS) $(BIN)/python -m sphinx -q -W --keep-going -j $(WORKERS) docs build/docs
	@$(BIN)/python -m tools.site build/docs
	@echo "build/docs/index.html"

demo: setup
	@$(SINGLE) $(QUIET_PLOTS) $(BIN)/modalscope demo

page: setup
	@$(BIN)/python page/bundle.py

lint: style
	@$(BIN)/mypy
	@$(BIN)/python -m tools.house --budgets

style: setup
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/lint-imports --no-logo

format: setup
	@$(BIN)/ruff check --fix-only .
	@$(BIN)/ruff format .

architecture: setup
	@$(BIN)/python -m tools.floors

changelog: setup
	@$(BIN)/python -m tools.changelog

# What fails has one more try, and the summary names it: a browser or a process that a loaded machine kept waiting is no fault of
# the code; what fails twice is.
PYTEST = $(SINGLE) $(QUIET_PLOTS) $(BIN)/python -m pytest -q -rR --reruns 1 -n $(WORKERS) --dist worksteal

# TESTS="tests/io tests/data" runs a part. The types are checked beside the tests, which leave a core idle at their start and end; what is wrong with them is said last.
test: style
	@$(BIN)/mypy > .venv/types.txt 2>&1 & types=$$!; trap "kill $$types" INT TERM; \
	$(PYTEST) $(TESTS) $(if $(COVERAGE),--cov --cov-report=term:skip-covered); tests=$$?; \
	wait $$types; types=$$?; cat .venv/types.txt; exit $$((tests | types))

# PART=1/2 runs the first half of the files.
test-slow: setup
	@MODALSCOPE_PART=$(or $(PART),1/1) $(PYTEST) $(TESTS) -m 'slow and not study and not bench'

attack: setup
	@OPENBLAS_NUM_THREADS=1 MPLBACKEND=Agg $(BIN)/python -m tests.attack.harness $(or $(SEED),0)

coverage:
	@$(MAKE) --no-print-directory test COVERAGE=1
	@$(MAKE) --no-print-directory test-slow

licences: setup
	@$(BIN)/python -m tools.licences $(if $(SBOM),--sbom > $(SBOM))

# Each in an environment of its own. Earlier packages beside newer ones warn of each other: that is nobody's fault here.
VERSIONED := tests/io tests/data tests/identification/fast tests/identification/matrices tests/identification/realizations tests/interfaces/plot tests/methods/test_exact_identities.py

versions: setup
	@for which in min:lowest-direct new:highest; do \
		place=.venv-$${which%%:*}; echo "== $$place ($${which##*:})"; \
		[ -x $$place/bin/python ] || $(BIN)/uv venv --quiet --python $(BIN)/python $$place || exit 1; \
		UV_LINK_MODE=copy $(BIN)/uv pip install --quiet --upgrade --python $$place/bin/python \
			--resolution $${which##*:} -e '.[dev]' || exit 1; \
		$(SINGLE) $(QUIET_PLOTS) $$place/bin/python -m pytest -q -n $(WORKERS) -W default -p no:cacheprovider $(VERSIONED) || exit 1; \
	done

# TESTS="tests/data tests/io" tries a part.
release-check: setup
	@$(BIN)/mypy --python-version 3.13
	@$(SINGLE) $(QUIET_PLOTS) env -u PYTHONPYCACHEPREFIX $(BIN)/python -m tools.release --workers $(WORKERS) $(if $(TESTS),--tests $(TESTS))

# PART=2/3 tries every third of them, from the second on.
mutants: setup
	@$(SINGLE) $(QUIET_PLOTS) $(BIN)/python -m tests.mutants --processes $(WORKERS) $(if $(PART),--part $(PART))

# Without a word also our own row of the arena, which is to fall by no more than chance. WORD=analyze runs the jobs whose names hold it; WRITE=1 writes the reference instead: WORD=real: WRITE=1 stores the lists of all real tests.
results: setup
	@$(SINGLE) $(QUIET_PLOTS) $(BIN)/python -m tools.results --jobs $(WORKERS) $(if $(WRITE),--write) $(if $(WORD),"$(WORD)")
	@$(if $(WORD)$(WRITE),,$(SINGLE) $(QUIET_PLOTS) $(BIN)/python -m arena.judge)

# Large; no other target needs it.
torch: $(STAMP)
	$(call install,torch)

bench: setup
	@for script in benchmarks/[!_]*.py; do \
		name=$$(basename "$$script" .py); echo "== $$name"; \
		$(SINGLE) $(QUIET_PLOTS) $(BIN)/python -m benchmarks.$$name || exit 1; \
	done

# Other programs live in environments of their own under build/arena; a run that is there and has not changed is not done again. One test
# is a .tdms file, whose reader is under the LGPL and so no part of the others.
arena: setup
	$(call install,tdms)
	@$(BIN)/python -m arena.run $(if $(FIELD),--field "$(FIELD)") $(if $(PROGRAM),--program "$(PROGRAM)") $(if $(SET),--set "$(SET)")

# WORD="selection and not narrow" tries those with such a subject or name.
study: setup
	@$(SINGLE) $(QUIET_PLOTS) $(BIN)/python -m pytest -m study -s -v $(if $(WORD),-k "$(WORD)")

clean:
	rm -rf page/node_modules src/modalscope/interfaces/app/static .venv .venv-min .venv-new build dist docs/generated docs/_static/mathjax .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find src tests tools examples benchmarks arena -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true
