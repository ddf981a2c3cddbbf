# First set-up: make demo, make test. Everything lives in .venv; nothing is installed once it is there.
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
KERNELS := $(VENV)/.kernels
SOURCES := $(shell find companion sitl -name '*.py')
# The forerunners of sedighi take an hour here, and no unknown map is made for them.
NAVIGATORS := hybrid,bspline-ga,astar,theta-star,dstar-lite,dijkstra,achour,prm,vertex++
CANDIDATES := python3.11 python3.12 python3.13 python3.14 python3 python

.PHONY: demo test lint bench results soak fuzz clean

demo: $(KERNELS)
	@$(BIN)/rover-sitl drive missions/rooms.toml --image out/rooms.png --map out/rooms-map

# One worker more than processors: many tests wait for real time.
test: $(KERNELS) lint
	$(BIN)/python -m pytest -n 3 --dist loadgroup

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

bench: $(KERNELS)
	$(BIN)/python -m pytest tests/bench --override-ini addopts= -q -s --benchmark-columns=median,min,max,rounds

# Each reader of bytes from outside for a minute, guided by what of the program the bytes reach.
fuzz: $(KERNELS)
	$(BIN)/python -m tests.fuzz all --seconds 60

results: $(KERNELS)
	$(BIN)/rover-sitl experiment kwasniewski-table1 --docs docs
	$(BIN)/rover-sitl experiment adaptive-control-points --docs docs
	$(BIN)/rover-sitl experiment kwasniewski-maps --docs docs
	$(BIN)/rover-sitl experiment sedighi-table1 $(addprefix --maps ,$(wildcard ../shared/data/ga_benchmarks)) --docs docs
	$(BIN)/rover-sitl experiment achour-table1 --docs docs
	$(BIN)/rover-sitl experiment wang-table4 --docs docs
	$(BIN)/rover-sitl experiment navigation --runs 10 --planners $(NAVIGATORS) --docs docs
	$(BIN)/rover-sitl experiment driving --runs 5 --docs docs
	$(BIN)/rover-sitl experiment dead-companion --runs 6 --docs docs
	$(BIN)/rover-companion bench $(wildcard ../shared/data/movingai/dao/arena.map ../shared/data/movingai/dao/lak104d.map) --cell-s 2 --docs docs

soak: $(KERNELS)
	$(BIN)/rover-sitl experiment soak --runs 100 --json out/soak.json --docs docs

# A virtual environment with the versions of constraints.txt, made once and from then on used without a network.
# PYTHON=... chooses the interpreter; otherwise the first one that works is taken.
$(READY): pyproject.toml constraints.txt
	@for python in $(or $(PYTHON),$(CANDIDATES)); do \
	  if "$$python" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
	    echo "setting up $(VENV) with $$("$$python" --version) (once, some minutes) ..."; \
	    "$$python" -m venv $(VENV) && \
	    $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test]' && \
	    touch $(READY); exit; \
	  fi; \
	done; \
	echo "rover-companion needs Python 3.11 or newer with its venv module; tried: $(or $(PYTHON),$(CANDIDATES))" >&2; exit 1

# numba keeps compiled kernels beside their sources, but looks only at the file a kernel is in, not at the files it calls
# into. So when any source is newer than the last look, all kernels are compiled anew.
$(KERNELS): $(READY) $(SOURCES)
	@find companion sitl tests \( -name '*.nbi' -o -name '*.nbc' \) -delete
	@touch $(KERNELS)

clean:
	rm -rf $(VENV) out build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks .import_linter_cache
	find companion sitl tests missions -name __pycache__ -prune -exec rm -rf {} +
