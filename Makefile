# Two commands on a bare machine: `make demo` and `make test`. Each does its own set-up.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
# What draws without a display or a GPU on Debian and Ubuntu.
GL_PACKAGES := libegl1 libgl1 libgl1-mesa-dri libosmesa6
WHEEL_VENV := build/wheel-venv
# They ask for opencv-python, which must not be beside opencv-python-headless; what else they need is in .[dev].
SCORERS := trackeval==1.3.0 vot-toolkit==0.9.0

WITHOUT_GL := PYTHONPATH=tests/without_opengl

.PHONY: setup demo bare test test-slow fuzz lint perf docs wheel pictures clean

setup: $(STAMP)

$(STAMP): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed; name one with: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || $(call install,python3-venv,"Python's venv module is missing")
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps $(SCORERS) || \
	  echo "$(SCORERS): not installed; the tests that compare with them are skipped"
	@$(BIN)/pftrack-sim doctor --check || $(call install,$(GL_PACKAGES),"nothing here can draw off-screen")
	@$(BIN)/pftrack-sim doctor --check
	@touch $(STAMP)

# $(call install,packages,reason): as root on Debian or Ubuntu install them, elsewhere say what to install.
define install
{ if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
    echo "$(2): installing $(1)"; \
    apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $(1) >/dev/null; \
  else \
    echo "$(2). Install it, then run make again:"; \
    echo "  Debian, Ubuntu:  sudo apt-get install $(1)"; \
    echo "  Fedora:          sudo dnf install python3 mesa-libEGL mesa-libGL mesa-dri-drivers mesa-libOSMesa"; \
    exit 1; \
  fi; }
endef

demo: setup
	rm -rf demo
	$(BIN)/pftrack-sim bench quick --out demo

# The demo's path, shorter, where no OpenGL library can be found.
bare: setup
	rm -rf build/bare
	$(WITHOUT_GL) $(BIN)/pftrack-sim doctor --check
	$(WITHOUT_GL) $(BIN)/pftrack-sim bench corridor --seeds 0:1 --trackers stay --set duration_s=0.5 --out build/bare

test: setup
	$(BIN)/python -m pytest -n 2 --dist worksteal -q -m "not slow"

# What .ci/run asks for besides.
test-slow: setup
	$(BIN)/python -m pytest -n 2 --dist worksteal -q -m slow

# Mutated scenarios, command lines, run folders and recorded sequences: 10,000 cases, for a nightly run.
fuzz: setup
	PFTRACK_SIM_FUZZ_CASES=10000 $(BIN)/python -m pytest -n 2 --dist worksteal -q -m slow tests/attack/test_fuzz.py

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/basedpyright
	$(BIN)/lint-imports

# The table of what a step and a reset cost, with the change against tests/perf/table.json, then the rest.
perf: setup
	$(BIN)/python tests/perf/perf_table.py
	@for script in $(filter-out %/perf_table.py,$(wildcard tests/perf/perf_*.py)); do echo "== $$script"; $(BIN)/python $$script || exit 1; done

# The site, in build/site; a broken link is an error.
docs: setup
	$(BIN)/mkdocs build --quiet

# The pictures of README, gallery, environments and tutorials; PARTS="axes tutorials" draws some.
pictures: setup
	$(BIN)/python docs/site/pictures.py $(PARTS)

# The wheel as a stranger gets it: built, installed in a clean environment, every scenario stepped once from elsewhere.
wheel: setup
	rm -rf build dist
	$(BIN)/python -m build --wheel
	$(PYTHON) -m venv $(WHEEL_VENV)
	$(WHEEL_VENV)/bin/python -m pip install --quiet --disable-pip-version-check dist/*.whl
	cd $(WHEEL_VENV) && bin/python $(CURDIR)/tests/smoke_wheel.py

clean:
	rm -rf $(VENV) build dist demo runs
