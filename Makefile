# Everything is set up in .venv from python3 and its venv module; nothing outside this folder is touched.
#
#   make run     serve a Bioloid in software on port 54000 (PLATFORM=nxt for another robot, ARGS="--port 54001",
#                PANEL=1 with the panel for browsers)
#   make test    lint, strict types and tests
#   make long    the tests that take longest, before a release
#   make bench   measure, beside plain Python and the other drivers
#   make small-board  measure on a quarter of a core, as a small board has it; nothing else must run
#   make fuzz    random programs (URBIHW_FUZZ_SECONDS=3600 for an hour, URBIHW_SEED=7 for another beginning)
#   make mutants sabotages of the sources that the tests must notice; ARGS=engine.py for some of them
#   make hostile all attacks of tests/hostile, beside a neighbour; ARGS="regexp TLS" for some of them
#   make witnesses  pypot and lerobot talk to the simulated servos; they are installed beside .venv's packages (2 GB)
#   make lerobot LEROBOT_PYTHON=python3.13  LeRobot itself records two simulated arms (6 GB, in .venv/lerobot)
#   make soak    half an hour of mixed work and faults; memory must stay as it is
#   make deb     the Debian package, in build/deb (on Debian 12 or later; `apt build-dep .` installs what that takes)
#   make clean   forget the environment and all caches
#
# PYTHON is the Python to build the environment from.  VENV_FLAGS=--system-site-packages lets it see Debian's own
# python3-greenlet, for 32 bit ARM without piwheels (docs/dependencies.md).

# With its compiled files kept a start takes half the time, so nobody's wish not to write them is passed on.
unexport PYTHONDONTWRITEBYTECODE

PYTHON ?= python3
LEROBOT_PYTHON ?= python3
VENV_FLAGS ?=
ARGS ?=
PLATFORM ?= bioloid
BIN = .venv/bin
# What is never imported need not be compiled: that is half of the work.
PIP = $(BIN)/python -m pip --disable-pip-version-check install --quiet --no-compile

.PHONY: run test lint types check compile simulated real-time again \
  long bench small-board fuzz mutants hostile witnesses lerobot soak deb clean

run: .venv/installed $(if $(filter webots,$(PLATFORM)),.venv/installed-mujoco)
	$(BIN)/urbihw serve --platform $(PLATFORM) $(if $(filter webots,$(PLATFORM)),,--fake) $(if $(PANEL),--web) $(ARGS)

# `make test` keeps all processors busy.  Tests in real time (e2e) mostly wait, so there are two for each processor, and
# all other tests take what these leave: niced, they hold none of them up.  What fails in real time is run once more, alone
# (see CONTRIBUTING.md); which tests those are is in a folder of its own, as both kinds run at the same time.
TOGETHER = $(MAKE) --no-print-directory --jobs --output-sync=target
PYTEST = $(BIN)/python -m pytest
REAL_TIME = -m 'e2e and not long' -o cache_dir=.pytest_cache/real-time
FAILED = .pytest_cache/real-time/v/cache/lastfailed

test: lint
	@echo 'Types and tests run at the same time; what they say is shown when each of them has ended.'
	$(TOGETHER) types again

check: .venv/installed-dev
	$(TOGETHER) again

lint: .venv/installed-dev
	$(BIN)/ruff check .

types: .venv/installed-dev
	$(BIN)/mypy

# In a new clone each of the processes below would compile what it imports; so one does, while mypy has the other processor.
# It says nothing: what cannot be imported is told below.
compile: .venv/installed-dev
	-@$(PYTEST) --collect-only -qq -m 'not long' $(ARGS) >/dev/null

simulated: compile
	nice -n 10 $(PYTEST) --numprocesses auto --dist loadfile -m 'not e2e and not long' $(ARGS)

real-time: compile
	@rm -f $(FAILED)
	$(PYTEST) --numprocesses $$((2 * $$(nproc))) --dist loadfile $(REAL_TIME) $(ARGS) || { [ $$? -eq 1 ] && [ -e $(FAILED) ]; }

again: simulated real-time
	@[ ! -e $(FAILED) ] || { echo '*** Tests in real time failed (above).  They are run once more, alone:' \
	  && $(PYTEST) $(REAL_TIME) --last-failed $(ARGS); }

long: .venv/installed-dev
	$(PYTEST) --numprocesses auto --dist loadfile -m long $(ARGS)

bench: .venv/installed-dev .venv/installed-mujoco
	$(BIN)/python -m bench.start
	$(BIN)/python -m bench.kernel_bench
	$(BIN)/python -m bench.dynamixel_cycle
	$(BIN)/python -m bench.segway
	$(BIN)/python -m bench.p3dx
	$(BIN)/python -m bench.nxt
	$(BIN)/python -m bench.spykee
	$(BIN)/python -m bench.nao
	$(BIN)/python -m bench.remote
	$(BIN)/python -m bench.stop
	$(BIN)/python -m bench.recording
	$(BIN)/python -m bench.worlds

small-board: .venv/installed-dev
	$(BIN)/python -m bench.small_board --page docs/performance.md $(ARGS)

fuzz: .venv/installed-dev
	$(PYTEST) -s tests/hostile/test_fuzz.py $(ARGS)

mutants: .venv/installed-dev
	$(BIN)/python -m tests.mutants.run $(ARGS)

hostile: .venv/installed-dev
	$(BIN)/python -m bench.hostile $(ARGS)

witnesses: .venv/installed-dev
	$(PIP) --upgrade --target .venv/witnesses 'pypot>=5,<6' 'lerobot[feetech]>=0.4,<0.5'
	PYTHONPATH=.venv/witnesses $(PYTEST) tests/fakes/test_more_witnesses.py $(ARGS)

lerobot:
	$(LEROBOT_PYTHON) -m venv .venv/lerobot
	.venv/lerobot/bin/pip --disable-pip-version-check install --quiet 'lerobot[dataset,viz]>=0.6,<0.7' deepdiff . ./packages/lerobot
	.venv/lerobot/bin/python bench/lerobot_record.py $(ARGS)

soak: .venv/installed-dev
	$(BIN)/python -m bench.soak $(ARGS)

# Built from a copy: the build writes into the sources.
deb:
	rm -rf build/deb && mkdir -p build/deb/urbihw
	tar --exclude-vcs --exclude='./.*' --exclude=./build --exclude=./dist --exclude='*.egg-info' --exclude=__pycache__ \
	  -c . | tar -x -C build/deb/urbihw
	cd build/deb/urbihw && { dpkg-checkbuilddeps 2>/dev/null || { dpkg-checkbuilddeps; \
	  echo 'make deb: packages are missing here; sudo apt build-dep . installs them' >&2; exit 1; }; }
	cd build/deb/urbihw && PATH=/usr/sbin:/usr/bin:/sbin:/bin dpkg-buildpackage -us -uc -b  # with Debian's own Python
	@ls build/deb/*.deb

clean:
	rm -rf .venv .mypy_cache .ruff_cache .pytest_cache build dist *.egg-info packages/*/*.egg-info packages/*/build
	find urbihw fakes packages tests bench -name __pycache__ -prune -exec rm -rf {} +

# The finder that setuptools installs, since packages are in several folders, takes 12 ms of each start of Python.
FIND_BY_FOLDER = for file in .venv/lib/python3*/site-packages/__editable__.urbihw-*.pth; do \
  printf '%s\n' '$(CURDIR)' '$(CURDIR)/fakes' >"$$file"; done; \
  for name in nao lerobot; do for file in .venv/lib/python3*/site-packages/__editable__.*$$name*.pth; do \
  [ ! -e "$$file" ] || printf '%s\n' "$(CURDIR)/packages/$$name" >"$$file"; done; done

.venv/made:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo 'urbihw needs Python 3.11 or later; name one: make PYTHON=python3.12 ...' >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null \
	  || { echo 'the venv module of Python is missing: sudo apt install python3-venv' >&2; exit 1; }
	$(PYTHON) -m venv $(VENV_FLAGS) .venv
	@touch $@

# The project is installed in place: an edited file needs no new installation, an edited pyproject.toml does.
.venv/installed: .venv/made pyproject.toml packages/nao/pyproject.toml
	@echo 'Installing the packages of urbihw into .venv; this takes about a minute.'
	$(PIP) -e '.[all]' -e packages/nao
	@echo 'urbihw is in .venv/bin. For urbihw alone, as the pages write it, type in each window: . .venv/bin/activate'
	@$(FIND_BY_FOLDER)
	@touch $@

.venv/installed-mujoco: .venv/installed
	$(PIP) -e '.[mujoco]'
	@$(FIND_BY_FOLDER)
	@touch $@

.venv/installed-dev: .venv/made pyproject.toml $(wildcard packages/*/pyproject.toml)
	$(PIP) -e '.[dev]' -e 'packages/nao[libqi]' -e packages/lerobot
	@$(FIND_BY_FOLDER)
	@touch .venv/installed .venv/installed-mujoco $@
