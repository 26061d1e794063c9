# Every target works alone in a fresh clone: it makes .venv, installs what it needs, and does its job.
#   make fly     one safe flight over real mountains, with its video and report
#   make test    the tests           make test ARGS="-k terrain"
#   make lint    style, types and layers of the sources
#   make check   lint, and the tests of what has changed since HEAD   make check SINCE=main
#   make docs    the documentation, docs/_build/html/index.html, every link of it followed; papers and exercises as PDF
#   make gallery the committed pictures made again (hours)   make gallery ARGS=safe_flight
#   make wheel   sdist and wheel, into dist/
#   make bench   one table: mathnavi compared with other solvers   make bench ARGS=--quick
#   make release VERSION=0.2.0   version, changelog and tag checked, sdist and wheel built and tried
#   make clean   remove caches and outputs
#   make lock    the tested versions chosen anew, .ci/requirements.txt
#   make versions  a table of what passes with every Python and MuJoCo here   make versions ARGS=--wheels
# PYTHON=python3.12 chooses the interpreter that .venv is made with; MUJOCO_GL=egl the rendering backend. What the
# sources are checked with (test, lint, docs, wheel) comes from the lock, hash by hash; LOCK= takes the newest versions
# that pyproject.toml allows instead, as fly, gallery and bench do, and as pip does for whoever installs mathnavi.

# Flights, videos and tests start many processes, which are to find each other's byte code whatever the environment says
# of it.
export PYTHONDONTWRITEBYTECODE =

FLY_OUT ?= renders/out/fly
FLY_WAY ?= --start 12000 14000 2924 --target 63000 62000 5258
FLY_RADAR ?= --radar 36000 39000 10000 10 --radar-time 40
FLY ?= safe-flight --seed 1 $(FLY_WAY) $(FLY_RADAR)
PYTHONS := $(or $(PYTHON),python3 python3.13 python3.12 python3.11 python3.14)
WORKERS ?= 3
ARGS ?=
SINCE ?= HEAD
LOCK ?= .ci/requirements.txt
, := ,

PACKAGES := interfaces models controllers estimators sim renders studies src
BENCHMARKS := $(wildcard benchmarks)
DOCS := docs/_build/html
INSTALL := .venv/bin/python .ci/install.py

.PHONY: fly test lint check bench gallery docs wheel release lock versions clean opengl .venv
.NOTPARALLEL:

fly: .venv/.installed opengl
	@echo "Flying the main mission, then drawing its video and writing its report (about a minute on two cores)"
	.venv/bin/mathnavi run $(FLY) --video --report --out $(FLY_OUT)
	@for file in video.mp4 report.html; do \
	    if [ -f "$(FLY_OUT)/$$file" ]; then echo "$(CURDIR)/$(FLY_OUT)/$$file"; fi; \
	done

test: .venv/.developed opengl
	.venv/bin/python -m pytest -n $(WORKERS) $(ARGS)

lint: .venv/.developed
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy --strict -p mathnavi $(BENCHMARKS:%=-p %)
	.venv/bin/mypy --strict .ci/open_reports.py
	.venv/bin/mypy --strict .ci/install.py
	.venv/bin/mypy --strict .ci/release.py
	.venv/bin/mypy --strict .ci/versions.py
	.venv/bin/mypy --strict .ci/pictures.py
	.venv/bin/lint-imports

check: lint opengl
	@tests="$$(.venv/bin/python .ci/changed.py $(SINCE))" || exit; \
	if [ -n "$$tests" ]; then .venv/bin/python -m pytest -q -n $(WORKERS) $(ARGS) $$tests; \
	else echo "No test belongs to what has changed since $(SINCE)"; fi

bench: .venv/.benchmarked
	.venv/bin/python -m benchmarks $(ARGS)

gallery: .venv/.installed opengl
	.venv/bin/python -m mathnavi.renders.gallery $(ARGS)

# Everything is built anew: pages of modules that are gone, or of a build that was cut short, would pass for whole ones.
docs: .venv/.developed
	rm -rf $(DOCS) docs/reference/api
	.venv/bin/sphinx-build --fresh-env --write-all --fail-on-warning --keep-going docs $(DOCS)
	.venv/bin/python docs/check_links.py $(DOCS)
	@echo "$(CURDIR)/$(DOCS)/index.html"

# A file that is no longer there must not be left in dist/ from a build before.
wheel: .venv/.developed
	rm -rf dist
	.venv/bin/hatchling build --directory "$(CURDIR)/dist"
	@ls -1 "$(CURDIR)"/dist/*

release: .venv/.developed
	@.venv/bin/python .ci/release.py $(VERSION)

lock: | .venv/bin/pip
	@bash .ci/lock

versions: .venv/.developed opengl
	@.venv/bin/python .ci/versions.py $(ARGS)

clean:
	rm -rf renders/out docs/_build docs/reference/api docs/examples dist .versions .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
	find $(PACKAGES) $(BENCHMARKS) $(wildcard tests) -name __pycache__ -type d -prune -exec rm -rf {} +

opengl: | .venv/bin/pip
	@bash .ci/opengl

.venv: .venv/.developed

# A change of pyproject.toml, a new entry point for one, installs again. The kernels of a flight are compiled and OpenGL
# is installed meanwhile.
.venv/.installed: pyproject.toml | .venv/bin/pip
	@echo "Installing mathnavi and what it needs into .venv: 1.3 GB on disk, half a minute to five minutes"
	@bash .ci/opengl & $(INSTALL); status=$$?; wait; exit $$status
	@touch $@

.venv/.developed: pyproject.toml $(LOCK) | .venv/bin/pip
	@echo "Installing mathnavi and its development tools into .venv (half a minute to five minutes the first time)"
	@bash .ci/opengl & $(INSTALL) $(if $(LOCK),--lock $(LOCK),--extras dev$(,)docs); status=$$?; wait; exit $$status
	@touch .venv/.installed $@

.venv/.benchmarked: pyproject.toml | .venv/bin/pip
	@echo "Installing mathnavi and the benchmarks' peers into .venv (a few minutes the first time)"
	$(INSTALL) --extras bench,dev
	.venv/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --upgrade \
	    --target .venv/acados 'comma-deps-acados>=0.2.2.post92,<0.3' \
	    || echo "acados is left out: no wheel for this machine"
	@touch .venv/.installed $@

# pip comes last into a new environment: where it is, the environment is whole.
.venv/bin/pip:
	@for python in $(PYTHONS); do \
	    if $$python -c 'import ensurepip, sys, venv; sys.exit(not (3, 11) <= sys.version_info < (3, 15))' 2>/dev/null; then \
	        if ! $$python -c 'import os; os.getcwdb().decode("utf-8")' 2>/dev/null; then \
	            echo "Python makes no environment in a folder whose path is not UTF-8: $(CURDIR); rename it" >&2; exit 1; \
	        fi; \
	        echo "Making .venv with $$python: $$($$python --version)"; \
	        exec $$python -m venv .venv; \
	    fi; \
	done; \
	echo "No Python 3.11 to 3.14 with its venv module among: $(PYTHONS)." \
	    "Install one (Debian, Ubuntu: apt-get install python3 python3-venv) or name it: make PYTHON=/path/to/python" >&2; \
	exit 1
