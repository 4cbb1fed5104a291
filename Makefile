# turnbuckle: everything runs from one environment in .venv, made by the first target that needs it.
#   make demo       a curtain of 790 soft cubes, simulated and drawn, with the certificate of its steps
#   make test       lint and the quick tests; `make test-all` adds the slow ones
#   make bench      our speed on this machine, beside the paper and (where installed) other libraries
#   make docs lint clean

.DEFAULT_GOAL := help
SHELL := /bin/bash

# The first interpreter that is Python 3.11 or newer and can make environments. `make PYTHON=... demo` overrules.
CANDIDATES := python3 python3.13 python3.12 python3.11 python3.14 python
USABLE := import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))
PYTHON ?= $(shell for p in $(CANDIDATES); do "$$p" -c '$(USABLE)' >/dev/null 2>&1 && { echo "$$p"; break; }; done)

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: help demo test test-all bench docs lint clean

help:
	@sed -n 's/^# \{0,1\}//p;/^$$/q' Makefile

$(VENV)/.stamp: pyproject.toml
	@test -n "$(PYTHON)" || { echo "turnbuckle needs Python 3.11 or newer with its venv module; install one (Debian: apt install python3 python3-venv) or name it: make PYTHON=/path/to/python3.11 demo"; exit 1; }
	@echo "Making the environment in $(VENV) with $$($(PYTHON) --version) (once; up to two minutes, most of it the download of Warp) ..."
	@$(PYTHON) -m venv $(VENV)
	@$(PIP) install --upgrade "pip>=25.1"
	@$(PIP) install --editable ".[tet,usd,text]" --group test
	@touch $@
	@echo "The environment is ready."

# One stamp for each heavier environment, on top of the first.
$(VENV)/.stamp-%: $(VENV)/.stamp
	@echo "Adding what '$*' needs to $(VENV) ..."
	@case $* in dev) $(PIP) install --group dev ;; *) $(PIP) install --editable ".[$*]" ;; esac
	@touch $@

demo: $(VENV)/.stamp
	@mkdir -p out
	@echo "Simulating the curtain (the first run compiles its kernels for this machine, about half a minute) ..."
	@$(BIN)/turnbuckle run curtain --out out/curtain.png --out out/curtain.usdc --report out/curtain.json
	@echo "Picture:   $(CURDIR)/out/curtain.png"
	@echo "Animation: $(CURDIR)/out/curtain.usdc (Blender, Houdini, usdview)"
	@echo "Report:    $(CURDIR)/out/curtain.json"

test: $(VENV)/.stamp
	@$(BIN)/ruff check .
	@$(BIN)/python -m pytest -n 2

test-all: $(VENV)/.stamp
	@$(BIN)/ruff check .
	@$(BIN)/python -m pytest -n 2 -m "slow or not slow"

bench: $(VENV)/.stamp-bench
	@$(BIN)/turnbuckle bench

docs: $(VENV)/.stamp-docs
	@$(BIN)/python -m sphinx -W --keep-going docs docs/_build/html
	@echo "Pages: $(CURDIR)/docs/_build/html/index.html"

lint: $(VENV)/.stamp-dev
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy

clean:
	@rm -rf $(VENV) out docs/_build docs/figures .pytest_cache .ruff_cache .mypy_cache
