# Two commands for a newcomer: `make demo` and `make test`. Everything they set up lives in .venv/ and target/.

SHELL := /bin/bash
.SHELLFLAGS := -o pipefail -c

PYTHON ?= python3
INPUT  ?=
ARGS   ?=

VENV := .venv
PY   := $(VENV)/bin/python
PIP_INSTALL := $(PY) -m pip install --progress-bar off
FMU  := target/fmu/prw_testbed.fmu

# rustup's default place, before a cargo of the system that may be too old
export PATH := $(HOME)/.cargo/bin:$(PATH)
export PIP_DISABLE_PIP_VERSION_CHECK := 1

CARGO ?= cargo
# CI and users build what Cargo.lock says
LOCKED ?= --locked

stop = { echo '$(1)' >&2; exit 1; }

.DEFAULT_GOAL := help
.PHONY: help demo test test-rust test-fmu fmu bench clean need-rust

help:
	@echo 'make demo                    simulate the experiment of Fig. 4      -> out/fig4.csv, out/fig4.png'
	@echo 'make demo INPUT=motors.csv   simulate your recorded motor angles    -> out/motors.csv, out/motors.png'
	@echo '                             (columns time, theta1, theta2 and, if known, omega1, omega2; radians,'
	@echo '                             or add ARGS=--degrees)'
	@echo 'make fmu                     build the FMU                          -> $(FMU)'
	@echo 'make test                    check and test everything'
	@echo 'make bench                   time the FMU against bare C             -> out/bench.md'
	@echo 'make clean                   remove .venv, target and out'

demo: need-rust $(VENV)/demo.stamp fmu
	@$(VENV)/bin/prw simulate --fmu $(FMU) $(if $(INPUT),--input "$(INPUT)") $(ARGS)

fmu: need-rust
	@$(CARGO) run $(LOCKED) --release --bin build_fmu

test: test-rust test-fmu

test-rust: need-rust
	$(CARGO) fmt --all --check
	$(CARGO) clippy $(LOCKED) --workspace --all-targets -- -D warnings
	RUSTDOCFLAGS='-D warnings' $(CARGO) doc $(LOCKED) --workspace --no-deps --quiet
	@if $(CARGO) nextest --version >/dev/null 2>&1; then \
	  set -ex; $(CARGO) nextest run $(LOCKED) --workspace; $(CARGO) test $(LOCKED) --workspace --doc; \
	else \
	  set -ex; $(CARGO) test $(LOCKED) --workspace; \
	fi

test-fmu: $(VENV)/test.stamp fmu
	$(PY) -m pytest -q -p no:cacheprovider tests/oracle tests/fmpy

# Ratios of one run; quiet the machine first.
bench: fmu
	@benches/run $(FMU)

clean:
	rm -rf $(VENV) target out

# The environment, made once; the stamps follow the requirement files.

$(VENV)/made.stamp:
	@command -v $(PYTHON) >/dev/null || \
	  $(call stop,Python 3.9 or later is missing; on Debian: apt install python3 python3-venv)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 9))' || \
	  $(call stop,$(PYTHON) is too old: Python 3.9 or later is needed (make PYTHON=...))
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || \
	  $(call stop,$(PYTHON) cannot make virtual environments; on Debian: apt install python3-venv)
	@echo 'creating $(VENV) with $(PYTHON)'
	@$(PYTHON) -m venv --clear $(VENV)
	@touch $@

$(VENV)/demo.stamp: $(VENV)/made.stamp analysis/requirements.txt analysis/pyproject.toml
	@echo 'installing the Python packages of the demo (once)'
	@$(PIP_INSTALL) -r analysis/requirements.txt | sed '/^Ignoring /d'
	@$(PIP_INSTALL) --quiet --no-deps --editable analysis
	@touch $@

$(VENV)/test.stamp: $(VENV)/demo.stamp tests/requirements.txt
	@echo 'installing the Python packages of the tests (once)'
	@$(PIP_INSTALL) -r tests/requirements.txt | sed '/^Ignoring /d; /^Requirement already/d'
	@touch $@

need-rust:
	@command -v $(CARGO) >/dev/null || \
	  $(call stop,Rust is missing; install it with rustup (https://rustup.rs))
	@command -v cc >/dev/null || \
	  $(call stop,the C compiler that Rust links with is missing; on Debian: apt install gcc libc6-dev)
