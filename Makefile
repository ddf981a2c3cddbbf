PYTHON ?= $(shell command -v python3.11 || command -v python3.12 || command -v python3.13 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: demo test lint bench results clean

# One set-up for everything: a virtual environment with the pinned versions, made once and then used without a network.
$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit("rover-companion needs Python 3.11 or newer, this is " + sys.version.split()[0]) if sys.version_info < (3, 11) else None'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test]'
	touch $(READY)

demo: $(READY)
	$(BIN)/rover-sitl drive missions/rooms.toml --image out/rooms.png --map out/rooms-map

test: $(READY) lint
	$(BIN)/python -m pytest -n 2 --dist loadgroup

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(READY)
	$(BIN)/python -m pytest tests/bench --override-ini addopts= -q -s --benchmark-columns=median,min,max,rounds

results: $(READY)
	$(BIN)/rover-sitl experiment kwasniewski-table1 --docs docs
	$(BIN)/rover-sitl experiment kwasniewski-maps --docs docs

clean:
	rm -rf $(VENV) out build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache
