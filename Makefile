# Everything here works on a fresh clone: the first target that needs it creates .venv and installs into it.
#
#   make test                     the tests of the library, of the analysis and of the project (make test-slow: the long ones)
#   make test-training            the tests of training, sweeps, the benchmark and the examples
#   make test-docs                the programs and the pages of the documentation
#   make check-results            what docs/results says is what its tables, networks and rows give
#   make test-oldest              the core with the oldest versions that pyproject.toml allows; make test-newest: the newest
#   make test-processors          the tests that may differ between processors, as on three kinds of them
#   make test-browser             the tests of pages in Chromium and Firefox; a browser that is missing is an error
#   make test-aarch64             six worlds on an emulated 64-bit ARM processor, to the bit
#   make mutants                  how many of 150 small changes of the sources the tests notice, in build/mutants.csv; hours
#   make reproduce-paper          the paper's experiments: runs, tables, report; SCALE=smoke|quick|standard|paper,
#                                 ARGS="experiments=[figure_4a] dry_run=true seed=1 ..."
#   make report                   claims, figures and statistics from tables; by default those of the largest scale in
#                                 docs/results; ARGS="results=FOLDER only=[figure_3a]"
#   make sweep                    a small sweep, side by side, and its table; SWEEP=demo, or one of your own in conf/sweep/
#   make dashboard                MLflow's pages over the results, on 127.0.0.1
#   make renderings               the paper's pictures of tasks and visual features; ARGS="--output DIR"
#   make bench                    speed of the engine on this machine
#   make site                     the documentation as a website, in build/site
#   make serve-site               opens it for a browser on 127.0.0.1; PORT=8000
#   make lint                     ruff, pyright, oxlint
#   make dist                     sdist and wheel in dist/, checked; TAG=v0.3.0 says which version it must be
#   make verify-rows              rows of the leaderboard that differ from BASE=origin/main are played again to the bit, and on
#                                 levels that follow from SALT=words, which their author could not know
#   make clean                    caches and build products; keeps .venv and all results

PYTHON ?= python3
SCALE ?= quick
SWEEP ?= demo
ARGS ?=
PORT ?= 8000
BASE ?= origin/main

VENV ?= .venv
PY := $(VENV)/bin/python
# Written last, so that it exists only after an installation that went through. The newest pip takes half the time of the one
# that comes with Python 3.11.
STAMP := $(VENV)/.installed
# With the extra that only `make test-slow` needs: Ray and PostgreSQL, 400 MB.
SLOW_STAMP := $(VENV)/.installed-slow
# With the extra that only `make site` needs: Sphinx, 40 MB.
SITE_STAMP := $(VENV)/.installed-site
# Imported once after installing, by two processes: that shows that they load, and compiles what they use. Letting pip compile
# all 16,000 modules of the dependencies takes longer than the rest of the installation.
LOADED := "import torch, torchrl, torchrl.objectives, tensordict, hydra, hydra_plugins.hydra_joblib_launcher.joblib_launcher" \
	"import numba, scipy.stats, pandas, mlflow, alembic.command, sqlalchemy.orm, gymnasium.vector, ot, pyarrow.parquet, \
	matplotlib.pyplot, rich.progress, pygame, imageio.v2, imageio_ffmpeg, moviepy, minari, h5py, pytest, xdist, hypothesis"

.DEFAULT_GOAL := help
.PHONY: help setup test test-training test-docs check-results test-processors test-oldest test-newest test-slow test-browser test-aarch64 mutants lint bench reproduce-paper report sweep renderings dashboard site site-playgrounds site-sources serve-site dist verify-rows clean

help:
	@sed -n 's/^#   //p' Makefile

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	@rm -f $@
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "SEGAR needs Python 3.11 or newer; '$(PYTHON)' is: $$($(PYTHON) --version 2>&1 || true)."; \
		echo "Name another one, for example: make $(or $(MAKECMDGOALS),setup) PYTHON=python3.11"; exit 1; } >&2
	@$(PY) -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv --clear --upgrade-deps $(VENV)
	@echo "Installing SEGAR into $(VENV); the first time takes a few minutes."
	@$(PY) -m pip install --quiet --disable-pip-version-check --no-compile \
		--constraint constraints.txt --editable ".[train,analysis,ui,dev]"
	@printf '%s\0' $(LOADED) | env -u PYTHONDONTWRITEBYTECODE MLFLOW_DISABLE_TELEMETRY=true xargs -0 -n 1 -P 2 $(PY) -c
	@touch $@

$(SLOW_STAMP): $(STAMP)
	@$(PY) -m pip install --quiet --disable-pip-version-check --no-compile \
		--constraint constraints.txt --editable ".[train,analysis,ui,dev,slow]"
	@touch $@

$(SITE_STAMP): $(STAMP)
	@$(PY) -m pip install --quiet --disable-pip-version-check --no-compile \
		--constraint constraints.txt --editable ".[site]"
	@touch $@

# Python keeps what it compiled, whatever the caller prefers: the tests start hundreds of imports.
test test-training test-docs check-results: export PYTHONDONTWRITEBYTECODE :=
# Three workers on two cores: each holds fewer kernels and libraries, at most 2 GB, and the time is the same.
test-training: TRAINING := tests/experiments tests/examples
test test-training: $(STAMP)
	$(PY) -m pytest -q -n 3 --dist loadfile --no-loadscope-reorder $(TRAINING) $(ARGS)

# Pages take seconds to a minute each, so a process gets the next one when it is done.
test-docs: $(STAMP)
	$(PY) -m pytest -q -n 2 --dist load --maxschedchunk 1 -m "docs and not slow" tests $(ARGS)

check-results: $(STAMP)
	$(PY) -m pytest -q -n 2 --dist loadscope -m "results and not slow" tests $(ARGS)

test-slow: $(SLOW_STAMP)
	$(PY) -m pytest -q -n 2 -m slow tests $(ARGS)

test-processors: $(STAMP)
	.ci/processors $(PY) $(ARGS)

test-browser: export SEGAR_BROWSERS ?= required
test-browser: $(STAMP)
	$(PY) -m pytest -q -n 2 --dist loadfile -m browser tests/segar/playground $(ARGS)

# In virtual environments of their own.
test-oldest test-newest:
	.ci/packages $(@:test-%=%) $(PYTHON) $(ARGS)

# Needs Debian's qemu-user-static, gcc-aarch64-linux-gnu and libc6-dev-arm64-cross.
test-aarch64: $(STAMP)
	SEGAR_AARCH64=required $(PY) -m pytest -q -m slow tests/segar/engine/targets/test_targets.py -k aarch64 $(ARGS)

mutants: $(STAMP)
	$(PY) -m tests.mutants run $(ARGS)

lint: $(STAMP)
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/oxlint --deny-warnings segar/playground/static
	$(VENV)/bin/pyright

bench: $(STAMP)
	$(PY) -m benchmarks $(ARGS)

reproduce-paper: $(STAMP)
	$(PY) -m segar reproduce scale=$(SCALE) $(ARGS)

report: $(STAMP)
	$(PY) -m segar report $(ARGS)

sweep: $(STAMP)
	$(PY) -m segar sweep $(SWEEP) $(ARGS)

renderings: $(STAMP)
	$(PY) -m segar.analysis.renderings $(ARGS)

dashboard: $(STAMP)
	$(PY) -m segar dashboard $(ARGS)

# The pages of environments are drawn from the library; what docs/site/measure.py found stands on them.
ENVIRONMENT_PAGES := build/site-source/environments/index.md
$(ENVIRONMENT_PAGES): $(SITE_STAMP) docs/site/environments.py docs/site/playgrounds.py docs/site/measure.py docs/results/hardness.csv \
		$(filter-out segar/experiments/% segar/analysis/%,$(wildcard segar/*.py segar/*/*.py segar/*/*/*.py segar/*/*/*/*.py))
	SEGAR_PATIENCE=1000 $(PY) docs/site/environments.py

# So are the cards of suites.
SUITE_PAGES := build/site-source/suites/index.md
$(SUITE_PAGES): $(ENVIRONMENT_PAGES) docs/site/suites.py $(wildcard segar/suites/data/*.toml docs/results/cards.json docs/results/benchmark/scores.csv)
	$(PY) docs/site/suites.py

# The playgrounds in the tutorial are made by its own commands, again only if these or the sources changed.
site-playgrounds: $(SITE_STAMP)
	$(PY) docs/site/playgrounds.py

site-sources: $(SUITE_PAGES) site-playgrounds

site: $(SITE_STAMP)
	$(MAKE) --no-print-directory --jobs 2 site-sources
	$(PY) docs/site/pages.py
	rm -rf build/site
	$(PY) -m sphinx --quiet --fail-on-warning --keep-going --jobs auto --write-all --doctree-dir build/site-doctrees \
		--conf-dir docs/site build/site-source build/site
	$(PY) -m pytest -q -m site tests/project/test_site.py
	@echo "The site is build/site/index.html."

serve-site: site
	$(PY) -m http.server --bind 127.0.0.1 --directory build/site $(PORT)

dist: $(STAMP)
	@$(PY) -m pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt --editable ".[release]"
	rm -rf dist
	$(PY) -m hatchling build --directory dist
	$(PY) -m twine check --strict dist/*
	@[ -z "$(TAG)" ] || [ -e "dist/segar-$(TAG:v%=%).tar.gz" ] || { \
		echo "The tag $(TAG) is not the version in segar/support/version.py: $$(ls dist)" >&2; exit 1; }

verify-rows: $(STAMP)
	@rows=$$(git diff --name-only $(BASE)... -- docs/results/benchmark | sed -n 's|docs/results/benchmark/\([^/]*\)/.*|\1|p' | sort -u \
		| paste -sd, -); \
	if [ -z "$$rows" ]; then echo "No row of docs/results/benchmark differs from $(BASE)."; \
	else $(PY) -m segar benchmark "verify=[$$rows]" rows=docs/results/benchmark salt='$(SALT)'; fi

clean:
	rm -rf build dist .pytest_cache .ruff_cache .hypothesis *.egg-info
	find . -path ./$(VENV) -prune -o -type d -name __pycache__ -print0 | xargs -0 rm -rf
