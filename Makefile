# make demo and make test need nothing but make and Python 3.11 or newer. Everything lives in .venv, and the compiled
# kernels in the user's cache (~/.cache/rover-companion).
VENV := .venv
BIN := $(VENV)/bin
PROGRAM := $(VENV)/.program
TOOLS := $(VENV)/.tools
KERNELS := $(VENV)/.kernels
ALL_KERNELS := $(VENV)/.all-kernels
SOURCES := $(shell find companion sitl -name '*.py')
# The forerunners of sedighi take an hour here, and no unknown map is made for them.
NAVIGATORS := hybrid,bspline-ga,astar,theta-star,dstar-lite,dijkstra,achour,prm,vertex++
CANDIDATES := python3.11 python3.12 python3.13 python3.14 python3 python
GAME_MAPS := $(addprefix ../shared/data/movingai/dao/,arena.map lak104d.map)
BARN := $(addprefix --worlds ,$(wildcard ../shared/data/barn/worlds.npz))
# For make fuzz: how long it searches.
SECONDS := 600
# Container images often set this. Without compiled bytecode each start of a program takes three times as long.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-all lint collect pytest bench results soak fuzz clean

demo: $(KERNELS)
	@echo "driving missions/rooms.toml ..."
	@$(BIN)/rover-sitl drive missions/rooms.toml --image out/rooms.png --map out/rooms-map

# The tools are installed while kernels are compiled, then come linters and tests.
test: $(PROGRAM)
	@$(MAKE) --no-print-directory --jobs=3 lint collect $(ALL_KERNELS)
	@$(MAKE) --no-print-directory pytest

# Compiles the tests to bytecode once; each of the workers that begin with none would do it for itself. What cannot be
# collected is told by the tests that follow.
collect: $(TOOLS)
	@$(BIN)/python -m pytest --collect-only -q > /dev/null || true

# More workers than processors: many tests wait for real time.
pytest: $(TOOLS) $(ALL_KERNELS)
	$(BIN)/python -m pytest -n 5 --dist worksteal

# With the drives that show a little more and take long: every mission with every sensor suite, more seeds. Properties
# are tried with all their examples.
test-all: $(TOOLS) $(ALL_KERNELS)
	ALL_EXAMPLES=1 $(BIN)/python -m pytest -n 5 --dist worksteal -m ""

lint: $(TOOLS)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

bench: $(TOOLS) $(ALL_KERNELS)
	$(BIN)/python -m pytest tests/bench --override-ini addopts= -q -s --benchmark-columns=median,min,max,rounds

# Looks for inputs that break something: new ones every time, for SECONDS in all.
fuzz: $(TOOLS) $(ALL_KERNELS)
	ALL_EXAMPLES=1 $(BIN)/python -m tests.fuzz all properties --seconds $(SECONDS)

results: $(TOOLS)
	$(BIN)/rover-sitl experiment kwasniewski-table1 --docs docs
	$(BIN)/rover-sitl experiment adaptive-control-points --docs docs
	$(BIN)/rover-sitl experiment kwasniewski-maps --docs docs
	$(BIN)/rover-sitl experiment sedighi-table1 $(addprefix --maps ,$(wildcard ../shared/data/ga_benchmarks)) --docs docs
	$(BIN)/rover-sitl experiment achour-table1 --docs docs
	$(BIN)/rover-sitl experiment wang-table4 --docs docs
	$(BIN)/rover-sitl experiment navigation --runs 30 --planners $(NAVIGATORS) --docs docs
	$(BIN)/rover-sitl experiment driving --runs 30 --docs docs
	$(BIN)/rover-sitl experiment traffic --docs docs
	$(BIN)/rover-sitl experiment barn --runs 2 $(BARN) --docs docs
	for setup in guarded jackal strict; do for lidar in "" "--lidar LD19"; do \
	  $(BIN)/rover-sitl experiment barn --runs 10 --controllers motion-ga --setups $$setup $$lidar $(BARN) --docs docs || exit; \
	done; done
	$(BIN)/rover-sitl experiment missions --runs 25 --controllers motion-ga --guard --docs docs
	$(BIN)/rover-sitl experiment missions --runs 8 --controllers motion-ga --docs docs
	$(BIN)/rover-sitl experiment controllers --runs 34 --controllers points,motion-ga,dwa,mppi --docs docs
	$(BIN)/rover-sitl experiment controllers --runs 34 --controllers motion-ga,mppi,dwa --off 0.5 --docs docs
	$(BIN)/rover-sitl experiment gates --runs 50 --controllers motion-ga --setups guarded --docs docs
	$(BIN)/rover-sitl experiment gates --runs 4 --setups strict --docs docs
	$(BIN)/rover-sitl experiment dead-companion --runs 6 --docs docs
	$(BIN)/rover-sitl experiment dead-companion --runs 140 --controllers motion-ga --guard --docs docs
	$(BIN)/rover-sitl experiment dead-companion --runs 140 --controllers motion-ga --docs docs
	$(BIN)/rover-companion bench $(wildcard $(GAME_MAPS)) --sizes 1,4,16,40 --cell-s 0.8 --docs docs
	$(BIN)/rover-sitl experiment killed-companion --runs 10 --docs docs
	$(BIN)/rover-sitl experiment killed-companion --runs 1 --controllers motion-ga --guard --docs docs
	$(BIN)/rover-sitl experiment killed-companion --runs 1 --controllers motion-ga --docs docs

soak: $(KERNELS)
	$(BIN)/rover-sitl experiment soak --runs 100 --json out/soak.json --docs docs

# The environment, with the versions of constraints.txt; once it is there, no network is needed. PYTHON=... chooses the
# interpreter; otherwise it is the first one that works. One that is there and works is kept: a second interpreter's
# files in it would make a mixture in which neither works.
$(PROGRAM): pyproject.toml constraints.txt
	@if $(BIN)/python -c 'import pip, ssl, sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then exit; fi; \
	for python in $(or $(PYTHON),$(CANDIDATES)); do \
	  if "$$python" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
	    echo "making $(VENV) with $$("$$python" --version) ..."; "$$python" -m venv --clear $(VENV); exit; \
	  fi; \
	done; \
	echo "rover-companion needs Python 3.11 or newer with its venv module; tried: $(or $(PYTHON),$(CANDIDATES))" >&2; exit 1
	@$(call install,.,the program: about 450 MB)
	@touch $(PROGRAM)

# Beside the compiler, which needs the program only and finds it in this folder.
$(TOOLS): $(PROGRAM)
	@$(call install,.[test],the tools of its tests: another GB)
	@touch $(TOOLS)

define install
echo "installing $(2) ..." && \
$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt -e '$(1)'
endef

# Compiled before they are needed, in several processes. Kernels whose sources have not changed are only loaded.
$(KERNELS): $(PROGRAM) $(SOURCES)
	@echo "compiling the kernels, once: about a minute ..."
	@$(BIN)/python -m sitl.cli.compile
	@touch $(KERNELS)

$(ALL_KERNELS): $(PROGRAM) $(SOURCES)
	@echo "compiling all kernels, once: some minutes ..."
	@$(BIN)/python -m sitl.cli.compile --all
	@touch $(KERNELS) $(ALL_KERNELS)

# With the kernels in the user's cache: after it, everything is made from nothing.
clean:
	rm -rf $(VENV) out build dist *.egg-info .hypothesis .benchmarks
	rm -rf .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
	rm -rf "$${XDG_CACHE_HOME:-$$HOME/.cache}/rover-companion"
	find companion sitl tests missions -name __pycache__ -prune -exec rm -rf {} +
