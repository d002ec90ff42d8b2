# New users begin with `make demo` and `make test`, which write into .venv/, target/ and out/.

SHELL := /bin/bash
.SHELLFLAGS := -o pipefail -c

PYTHON ?= python3
INPUT  ?=
ARGS   ?=
FUZZ_SECONDS ?= 600
# Numbers of rigs that `make monte-carlo` simulates: without a fault, for each fault and size, and for each effect of real rigs.
RIGS ?= 300
FAULTY ?= 50
REAL ?= 8
FIGURE ?= docs/detection.svg

VENV := .venv
DIST_VENV := .venv-dist
WITH_WASM2C := WASM2C='$(CURDIR)/$(VENV)/bin/wasm2c'
PY   := $(VENV)/bin/python
# Python compiles modules at the first import; compiling all takes longer than the installation.
PIP_INSTALL := $(PY) -m pip install --progress-bar off --no-compile
# Exact versions and hashes of all Python packages; pyproject.toml lists those of each environment.
LOCK := dev/requirements.txt
# Installs into the environment that contains the stamp. uv takes a tenth of the time of pip.
UV_INSTALL = $(@D)/bin/uv pip install --quiet --python $(@D)/bin/python
# Fails if the lock does not contain a package or the hash of its file.
INSTALL_LOCKED = $(UV_INSTALL) --require-hashes --constraints $(LOCK) --excludes dev/own-packages.txt
# Builds a package of this repository with maturin and setuptools from the lock, which the group `build` installs. Without these
# options, pip would download others and compare no hashes. maturin is found in PATH.
PIP_BUILD = PATH='$(CURDIR)/$(@D)/bin':"$$PATH" $(PIP_INSTALL) --quiet --no-deps --no-build-isolation
# One process for each core; `.venv/bin/python -m pytest -x FILE` runs a part.
PYTEST := $(PY) -m pytest -q -p no:cacheprovider -n auto --dist worksteal
FMU  := target/fmu/prw_testbed.fmu
SOURCE_FMU := target/fmu/source/prw_testbed.fmu

# The default directory of rustup precedes a cargo of the system, which may be too old.
export PATH := $(HOME)/.cargo/bin:$(PATH)
export PIP_DISABLE_PIP_VERSION_CHECK := 1

CARGO ?= cargo
# CI and users build the versions in Cargo.lock.
LOCKED ?= --locked

# Rust target of the page in the FMU and of the C sources.
WEBASSEMBLY := wasm32-unknown-unknown
# Rust target for which `make check-windows` compiles without linking, because some modules are for one system only.
WINDOWS := x86_64-pc-windows-gnu
# make does not pass its job server on to these programs, so rustc would warn that it cannot connect to it.
NO_JOBS := env -u MAKEFLAGS -u MFLAGS
add_target = ls "$$($(NO_JOBS) rustc --print target-libdir --target $(1))" 2>/dev/null | grep -q libstd || rustup target add $(1)
ADD_WEBASSEMBLY = $(call add_target,$(WEBASSEMBLY))

# Directory of the compiled programs that build FMUs. If empty, cargo compiles them.
PROGRAMS ?=
BUILD_FMU = $(NO_JOBS) $(if $(PROGRAMS),$(PROGRAMS)/build_fmu,$(CARGO) run $(LOCKED) --bin build_fmu --)
BUILD_CONTROLLER = $(NO_JOBS) $(if $(PROGRAMS),$(PROGRAMS)/build_fmu_controller,$(CARGO) run $(LOCKED) -p prw_controller --bin build_fmu_controller --)
BUILD_CLOSED_LOOP = $(NO_JOBS) $(if $(PROGRAMS),$(PROGRAMS)/build_closed_loop,$(CARGO) run $(LOCKED) -p prw_controller --bin build_closed_loop --)
# Succeeds if the existing FMU contains the page that runs it.
HAS_PAGE = $(PYTHON) dev/tools/has_page.py $(FMU)

jobs = $(if $(findstring jobserver,$(MAKEFLAGS)),,-j$(1))

stop = { echo '$(1)' >&2; exit 1; }

.DEFAULT_GOAL := help
.PHONY: help demo demo-fmu check check-release test test-long compile-tests test-rust test-crates test-docs check-windows test-python test-fmu test-newest-fmpy test-page fmu bench instructions figures docs reference experiments validation closed-loop closed-loop-fmus test-closed-loop importer-fmus test-importers examples test-examples test-faults release source-fmu test-source-fmu test-bare-metal test-platforms test-reproducible study monte-carlo headers fuzz sanitize clean need-rust need-python need-nightly

help:
	@echo 'To use the FMU:'
	@echo 'make demo                    simulate the experiment of Fig. 4      -> out/fig4.csv, out/fig4.png'
	@echo 'make demo INPUT=motors.csv   simulate your recorded motor angles    -> out/motors.csv, out/motors.png'
	@echo '                             (columns time, theta1, theta2 and, if known, omega1, omega2; radians,'
	@echo '                             or add ARGS=--degrees)'
	@echo 'make fmu                     build the FMU for FMI 2.0              -> $(FMU)'
	@echo '                             and for FMI 3.0                        -> target/fmu/fmi3/prw_testbed.fmu'
	@echo 'make demo-fmu                build both faster: without the page that runs the FMU, unless the existing FMU has it'
	@echo 'make study                   install the packages for prw identify, excite, sweep and check (see python/prw/tutorial.md)'
	@echo 'make examples                install and build what the examples need (see docs/examples.md)'
	@echo 'make closed-loop             run the FMU with a controller FMU in several masters -> out/closed_loop.png'
	@echo 'make source-fmu              build the FMU as C sources for real-time targets -> $(SOURCE_FMU)'
	@echo 'make reference               write the reference of the Python packages -> target/reference/index.html'
	@echo 'make release                 build the files of a release -> dist/: FMUs and Python wheels for Linux and macOS (Intel and'
	@echo '                             ARM) and for Windows (Intel), reference experiments, checksums, release notes'
	@echo 'make clean                   remove .venv, .venv-dist, target, out and dist'
	@echo 'To change the project (CONTRIBUTING.md):'
	@echo 'make check                   check the changes since the last commit and what depends on them'
	@echo 'make test                    run all checks and tests that need no browser and no other platform'
	@echo 'make docs                    update the model descriptions, docs/performance.md and docs/examples.md'
	@echo 'For the changes that the table in CONTRIBUTING.md names, for parts of make test, and for releases:'
	@echo 'make test-rust               check the Rust code: format, lints, tests, documentation'
	@echo 'make test-python             check the Python code with ruff and mypy'
	@echo 'make test-fmu                run the Python tests; make test runs these and the next three'
	@echo 'make test-closed-loop        test the testbed with its controller, in several masters'
	@echo 'make test-importers          test other importers'
	@echo 'make test-examples           test the examples'
	@echo 'make test-long               run the tests that take too long for make test: templates, maintenance tools'
	@echo 'make test-page               test the page in the FMU in Chromium, Firefox and WebKit, which it installs'
	@echo 'make test-faults             put faults into the sources and count those that the tests find'
	@echo 'make test-newest-fmpy        run the tests with FMPy again, with the newest FMPy'
	@echo 'make test-source-fmu         compile the C sources with every installed compiler and compare with the library'
	@echo 'make test-bare-metal         run the C sources on a Cortex-M7 without an operating system, which QEMU emulates'
	@echo 'make test-platforms          build the release, run it on Linux, Windows (Wine) and ARM (QEMU), check the rest'
	@echo 'make test-reproducible       build the release twice and compare every byte'
	@echo 'make check-windows           check the Rust code for Windows with clippy'
	@echo 'make check-release           run every check and write a table        -> out/release-check.md'
	@echo 'make experiments             update the reference experiments in the FMU'
	@echo 'make validation              compare the FMUs with these in every installed importer -> out/validation.html, .json'
	@echo 'make bench                   compare the speed of the FMU with C    -> dev/benches/ratios.json'
	@echo 'make instructions            count the instructions of about 25 uses, with callgrind, into the table that make test compares'
	@echo 'make figures                 draw the figures of the paper          -> out/*.svg, out/*.png'
	@echo 'make monte-carlo             identify 300 simulated rigs and 1724 with faults or effects of real rigs -> out/'
	@echo 'make fuzz                    search for calls that break the FMU, and for files that break the readers, 10 minutes each'
	@echo '                             (FUZZ_SECONDS=600)'
	@echo 'make sanitize                run the tests under address, leak, thread and real-time sanitizers and valgrind'

# Downloads and the compiler run in parallel. If one fails, both run again in sequence, so the error message comes last.
# fmu-run takes longest, so it comes first (nice). The page that runs the FMU takes as long; if the existing FMU contains the page,
# the new one does too.
demo: need-rust need-python
	@$(MAKE) --no-print-directory $(call jobs,3) $(VENV)/demo.stamp demo-fmu || \
	  $(MAKE) --no-print-directory $(VENV)/demo.stamp demo-fmu
	@$(VENV)/bin/prw simulate --fmu $(FMU) $(if $(INPUT),--input "$(INPUT)") $(ARGS)

demo-fmu: need-rust
	@nice $(BUILD_FMU) $$($(HAS_PAGE) || echo --no-page)

fmu: need-rust $(if $(PROGRAMS),compile-tests)
	@$(ADD_WEBASSEMBLY) || true
	@$(BUILD_FMU)

check: $(VENV)/tests.stamp need-rust
	@$(PY) dev/tools/changed.py

# Takes hours.
check-release: $(VENV)/importers.stamp need-rust
	@$(PY) dev/tools/release_check.py $(ARGS)

# Two targets run at a time, so that no processor waits during an installation. The FMUs are built by the programs that
# the Rust tests compiled. make test-long runs the tests that are left out here.
test: need-rust need-python
	@$(MAKE) --no-print-directory $(call jobs,2) PROGRAMS=target/debug test-crates test-python $(VENV)/importers.stamp \
	  $(VENV)/examples.stamp test-docs importer-fmus source-fmu
	PROGRAMS=target/debug $(PYTEST) -m 'not long' $(FMU_TESTS) tests/closed_loop tests/importers tests/examples
	$(PYTEST) -m small tests/source_fmu

# What takes too long for make test, which has a quick test of each kind: links in the documentation of the crates; each template of
# cargo fmu to its checked FMU, the guide for authors, further mistakes in models; each planted fault alone; campaigns of simulated rigs,
# learning, and the tools that maintain this repository.
test-long: need-rust headers importer-fmus source-fmu $(VENV)/examples.stamp
	RUSTDOCFLAGS='-D warnings' $(CARGO) doc $(LOCKED) --workspace --no-deps --quiet
	$(NO_JOBS) $(CARGO) test $(LOCKED) -p fmu-package --test cargo_fmu --test mistakes -- --ignored
	$(NO_JOBS) $(CARGO) test $(LOCKED) -p fmu-check --test mutants -- --ignored
	$(NO_JOBS) $(CARGO) test $(LOCKED) -p fmu-export --test rejected_by_the_compiler -- --ignored
	$(NO_JOBS) $(CARGO) test $(LOCKED) -p fmu-run --test readers -- --ignored --exact malformed_files_are_errors_whatever_memory_there_is
	$(PYTEST) -m long $(FMU_TESTS) tests/closed_loop tests/examples

# C programs are compiled with the headers of the standard, which FMPy contains.
headers: $(VENV)/tests.stamp

test-rust: test-crates test-docs

# clippy compiles the tests, so the lints need no compilation of their own. Programs that tests start do not inherit this option, so
# models are compiled by rustc. Clippy takes its arguments from this variable, each followed by a mark.
LINTED := --config 'build.rustc-workspace-wrapper="clippy-driver"'
compile-tests test-crates test-docs: export CLIPPY_ARGS := -D__CLIPPY_HACKERY__warnings__CLIPPY_HACKERY__

compile-tests: need-rust
	$(CARGO) fmt --all --check
	$(CARGO) test $(LOCKED) $(LINTED) --workspace --all-targets --no-run --quiet

# Many tests wait for a time limit, so two run at a time on each processor.
test-crates: compile-tests headers
	@if $(CARGO) nextest --version >/dev/null 2>&1; then \
	  set -x; $(NO_JOBS) $(CARGO) nextest run $(LOCKED) $(LINTED) --workspace --test-threads $$((2 * $$(getconf _NPROCESSORS_ONLN))); \
	else \
	  set -x; $(NO_JOBS) $(CARGO) test $(LOCKED) $(LINTED) --workspace --lib --bins --tests; \
	fi

# rustdoc needs every dependency compiled once more, so make test-long looks for links that lead nowhere.
test-docs: compile-tests
	$(NO_JOBS) $(CARGO) test $(LOCKED) $(LINTED) --workspace --doc --quiet

check-windows: compile-tests
	@if $(call add_target,$(WINDOWS)); then \
	  set -x; $(CARGO) clippy $(LOCKED) --workspace --target $(WINDOWS) --quiet -- -D warnings; \
	else \
	  echo 'not checked for Windows, because rustup cannot install its standard library'; \
	fi

# ruff and mypy; pyproject.toml lists the files.
test-python: $(VENV)/tests.stamp
	$(PY) -m ruff check
	$(PY) -m ruff format --check
	$(PY) -m mypy

# Users get the newest FMPy; the test environments have the oldest supported version.
test-newest-fmpy: $(VENV)/tests.stamp closed-loop-fmus
	@$(PIP_INSTALL) --quiet --upgrade --no-deps --target target/newest-fmpy fmpy
	PYTHONPATH=target/newest-fmpy $(PYTEST) tests/fmpy tests/fmu_run

FMU_TESTS := $(addprefix tests/,check oracle fmu_run fmpy prw analysis publication scripts)

test-fmu: $(VENV)/tests.stamp closed-loop-fmus
	$(PYTEST) $(FMU_TESTS)

# Browsers with new profiles open the page from a file. tests/fmpy/test_page.py needs no browser.
test-page: $(VENV)/tests.stamp closed-loop-fmus
	$(PY) -m pytest -q -s -p no:cacheprovider tests/page

# The ratios come from one run, so the machine should be idle.
bench: $(VENV)/tests.stamp closed-loop-fmus source-fmu
	@$(PY) dev/benches/bench.py $(FMU) --sources $(SOURCE_FMU)

# The commit that changes the table gives the reason for each change of more than 2 %.
instructions: $(VENV)/tests.stamp fmu
	@command -v valgrind >/dev/null || $(call stop,valgrind is missing; on Debian: apt install valgrind)
	@$(PY) dev/benches/instructions.py $(FMU) --write

# The figures and their copies for documentation and README.
figures: need-rust $(VENV)/tests.stamp closed-loop-fmus
	@$(PY) dev/tools figures --fmu $(FMU) --commit

# The tables of the pages come from the model descriptions, so these are written first.
docs: need-rust $(VENV)/tests.stamp $(VENV)/examples.stamp closed-loop-fmus
	@$(BUILD_FMU) --describe
	@$(BUILD_CONTROLLER) --describe
	@$(PY) dev/tools docs
	@$(PY) dev/tools examples

# Sphinx reads the docstrings; an unresolved name or a missing section is an error.
reference: $(VENV)/tests.stamp
	@$(PY) -m sphinx --quiet --fail-on-warning --keep-going docs/reference target/reference

# The expected results come from the oracle of the tests, not from the FMU.
experiments: $(VENV)/tests.stamp
	@$(PY) tests/oracle/write_experiments.py

validation: need-rust $(VENV)/importers.stamp closed-loop-fmus
	@$(PY) dev/tools validation $(ARGS)

# Builds the controller FMU, the closed loop, the example FMU lag, and the FMU of the motors.
closed-loop-fmus: fmu
	@$(BUILD_CONTROLLER)
	@$(BUILD_CLOSED_LOOP)
	@$(if $(PROGRAMS),,$(CARGO) build $(LOCKED) --quiet -p fmu-package --bin cargo-fmu)
	@rm -rf target/lag && $(NO_JOBS) target/debug/cargo-fmu fmu new target/lag --name lag > /dev/null
	@cd target/lag && CARGO_TARGET_DIR=$(CURDIR)/target/models $(NO_JOBS) ../debug/cargo-fmu fmu build --out ../fmu
	@cd examples/motor && $(NO_JOBS) ../../target/debug/cargo-fmu fmu build --no-page --out ../../target/fmu

closed-loop: need-rust $(VENV)/importers.stamp closed-loop-fmus
	@$(PY) dev/tools closed-loop $(ARGS)

examples: need-rust $(VENV)/examples.stamp closed-loop-fmus
	@echo 'ready: $(PY) examples/lqr.py and the others; docs/examples.md shows them'

test-examples: need-rust $(VENV)/tests.stamp $(VENV)/examples.stamp closed-loop-fmus
	$(PYTEST) tests/examples

test-closed-loop: $(VENV)/importers.stamp closed-loop-fmus
	$(PYTEST) tests/closed_loop

# Some importers treat tunable parameters differently, so this builds the FMU with them, too.
importer-fmus: closed-loop-fmus
	@$(BUILD_FMU) --tunable --out target/fmu/tunable

test-importers: $(VENV)/importers.stamp importer-fmus
	$(PYTEST) tests/importers

# Takes about a minute for every three faults.
test-faults: need-rust headers
	@$(PY) dev/tools/seeded_faults.py $(ARGS)

# The tools for other platforms have a separate environment. dev/platforms/rust-toolchain.toml names the compiler.
release: need-rust $(DIST_VENV)/release.stamp
	@$(DIST_VENV)/bin/python dev/platforms/release.py

# The library is compiled to WebAssembly and translated to C, for targets with a C compiler but without Rust.
source-fmu: need-rust $(VENV)/wasm2c.stamp $(if $(PROGRAMS),compile-tests)
	@$(ADD_WEBASSEMBLY)
	@$(WITH_WASM2C) $(BUILD_FMU) --c-sources

test-source-fmu: source-fmu fmu $(VENV)/tests.stamp
	@$(WITH_WASM2C) $(BUILD_CONTROLLER) --c-sources
	$(PYTEST) tests/source_fmu

test-bare-metal: source-fmu fmu $(VENV)/tests.stamp
	$(PYTEST) -n 0 -s tests/source_fmu/test_bare_metal.py

test-platforms: release source-fmu $(DIST_VENV)/test-platforms.stamp
	$(DIST_VENV)/bin/python -m pytest -q -p no:cacheprovider tests/platforms

test-reproducible: release
	@$(DIST_VENV)/bin/python dev/platforms/rebuild.py

study: $(VENV)/study.stamp fmu
	@echo 'ready: $(VENV)/bin/prw identify, excite, sweep and check (with --help); python/prw/tutorial.md shows how'

# Takes minutes; `make test` runs a short version.
monte-carlo: $(VENV)/study.stamp fmu
	$(PY) tests/analysis/monte_carlo.py $(FMU) --repetitions $(RIGS) --out out/monte_carlo.json $(ARGS)
	$(PY) tests/analysis/monte_carlo.py $(FMU) --faulty $(FAULTY) --figure $(FIGURE) --out out/detection.json $(ARGS)
	$(PY) tests/analysis/monte_carlo.py $(FMU) --real $(REAL) --out out/real.json $(ARGS)

# libFuzzer starts from the inputs in corpus.zip and from the malformed files of fmu-run's tests, and adds new ones to target/fuzz.
fuzz: need-rust need-nightly
	@$(CARGO) fuzz --version >/dev/null 2>&1 || \
	  $(call stop,cargo-fuzz is missing; install it with: cargo install --locked cargo-fuzz)
	@$(PYTHON) -m zipfile -e crates/fmu-export/fuzz/corpus.zip target/fuzz/corpus
	READERS_DIRECTORY='$(CURDIR)/target/fuzz' $(CARGO) test -q $(LOCKED) -p fmu-run --test readers -- --ignored --exact write_corpus
	$(CARGO) +nightly fuzz run --fuzz-dir crates/fmu-export/fuzz --target-dir target/fuzz calls target/fuzz/corpus \
	  -- -max_len=4096 -max_total_time=$(FUZZ_SECONDS) -print_final_stats=1
	for target in description system archive; do \
	  $(CARGO) +nightly fuzz run --fuzz-dir crates/fmu-export/fuzz --target-dir target/fuzz $$target target/fuzz/$$target \
	    -- -max_len=20000 -timeout=10 -rss_limit_mb=1024 -max_total_time=$(FUZZ_SECONDS) -print_final_stats=1 || exit 1; \
	done

sanitize: need-rust need-nightly $(VENV)/tests.stamp source-fmu closed-loop-fmus
	@command -v valgrind >/dev/null || $(call stop,valgrind is missing; on Debian: apt install valgrind)
	@$(CARGO) +nightly miri --version >/dev/null 2>&1 || \
	  $(call stop,Miri is missing; install it with: rustup component add --toolchain nightly miri rust-src)
	@dev/sanitize

clean:
	rm -rf $(VENV) $(DIST_VENV) target out dist

# An environment is created once. Then NAME.stamp states that the packages of the group NAME in pyproject.toml are installed.
# They are installed again if that file or the lock changes. The lines without a recipe state which groups are installed before.

# pip installs uv with the hashes in the lock, and uv installs everything else.
$(VENV)/made.stamp $(DIST_VENV)/made.stamp: | need-python
	@echo 'creating $(@D) with $(PYTHON)'
	@$(PYTHON) -m venv --clear $(@D)
	@$(@D)/bin/pip install --quiet --progress-bar off --no-compile --require-hashes -r <(sed -n '/^uv==/,/[^\\]$$/p' $(LOCK))
	@touch $@

FMU_RUN := Cargo.lock $(wildcard crates/fmu-run/*.toml crates/fmu-run/python/*.toml $(addprefix crates/fmu-run/,\
  src/*.rs src/*/*.rs src/*/*/*.rs python/src/*.rs python/fmu_run/*)\
  $(addprefix crates/fmi-abi/,*.toml src/*.rs src/*/*.rs))

# In a separate target directory, so that it need not wait until cargo has compiled the FMU.
$(VENV)/fmu_run.stamp: $(VENV)/made.stamp $(FMU_RUN) | $(VENV)/build.stamp need-rust
	@echo 'compiling fmu-run, which runs FMUs for Python (once)'
	@CARGO_TARGET_DIR='$(CURDIR)/target/python' $(PIP_BUILD) ./crates/fmu-run
	@touch $@

# prw has its own list of packages.
PACKAGES_demo := -r python/prw/pyproject.toml --extra plot
PACKAGES_study := -r python/prw/pyproject.toml --extra study

# fmu-run needs none of these packages to compile, so they are installed at the same time.
$(VENV)/packages.stamp: $(LOCK) pyproject.toml python/prw/pyproject.toml | $(VENV)/build.stamp
	@echo 'installing the Python packages of the demo (once)'
	@$(INSTALL_LOCKED) $(PACKAGES_demo)
	@$(UV_INSTALL) --no-deps --no-build-isolation --editable python/prw
	@touch $@

$(VENV)/demo.stamp: $(VENV)/packages.stamp $(VENV)/fmu_run.stamp
	@touch $@

$(VENV)/build.stamp: $(VENV)/made.stamp
$(VENV)/wasm2c.stamp: $(VENV)/build.stamp
$(VENV)/study.stamp: $(VENV)/demo.stamp
$(VENV)/tests.stamp $(VENV)/examples.stamp: $(VENV)/study.stamp
$(VENV)/importers.stamp: $(VENV)/tests.stamp
$(DIST_VENV)/build.stamp: $(DIST_VENV)/made.stamp
$(DIST_VENV)/release.stamp: $(DIST_VENV)/build.stamp
$(DIST_VENV)/test-platforms.stamp: $(DIST_VENV)/release.stamp

define install
	@echo 'installing the Python packages of the group $* (once)'
	@$(INSTALL_LOCKED) $(or $(PACKAGES_$*),--group $*)
	@touch $@
endef
$(VENV)/%.stamp: $(LOCK) pyproject.toml ; $(install)
$(DIST_VENV)/%.stamp: $(LOCK) pyproject.toml ; $(install)

need-rust:
	@command -v $(CARGO) >/dev/null || \
	  $(call stop,Rust is missing; install it with rustup (https://rustup.rs))
	@command -v cc >/dev/null || \
	  $(call stop,the C compiler that Rust links with is missing; on Debian: apt install gcc libc6-dev)

need-python:
	@command -v $(PYTHON) >/dev/null || \
	  $(call stop,Python 3.11 or later is missing; on Debian: apt install python3 python3-venv)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  $(call stop,$(PYTHON) is too old: Python 3.11 or later is needed (make PYTHON=...))
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || \
	  $(call stop,$(PYTHON) cannot make virtual environments; on Debian: apt install python3-venv)

need-nightly:
	@$(CARGO) +nightly --version >/dev/null 2>&1 || \
	  $(call stop,a nightly toolchain is missing; install it with: rustup toolchain install nightly)
