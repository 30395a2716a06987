# Two commands on a bare machine: `make demo` and `make test`. Each installs what it needs, and no more.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# What draws without a display or a GPU on Debian and Ubuntu.
GL_PACKAGES := libegl1 libgl1 libgl1-mesa-dri libosmesa6
WHEEL_VENV := build/wheel-venv
# They ask for opencv-python, which must not be beside opencv-python-headless; what else they need is in .[test].
SCORERS := trackeval==1.3.0 vot-toolkit==0.9.0

WITHOUT_GL := PYTHONPATH=tests/without_opengl
# Modules are compiled when they are first imported (most of the libraries never are), and then kept, also where the
# environment says not to: every process would compile them for more than a second.
unexport PYTHONDONTWRITEBYTECODE
PIP := $(BIN)/python -m pip install --disable-pip-version-check --no-compile

.PHONY: setup demo bare test test-slow fuzz lint perf docs wheel pictures results clean

# The package, and a check that frames can be drawn.
setup: $(VENV)/.package

$(VENV)/.package: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed; name one with: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || $(call install,python3-venv,"Python's venv module is missing")
	@$(call stage,virtual environment (1 of 3),$(PYTHON) -m venv $(VENV))
	@$(call stage,libraries (2 of 3),$(PIP) --editable .)
	@$(call stage,renderer (3 of 3),$(BIN)/pftrack-sim doctor --check) || $(call install,$(GL_PACKAGES),"nothing here can draw off-screen")
	@$(BIN)/pftrack-sim doctor --check
	@touch $@

$(VENV)/.test: $(VENV)/.package
	@$(call stage,what the tests need,$(PIP) --editable '.[test]')
	@$(call stage,public scorers,$(PIP) --no-deps $(SCORERS)) || \
	  echo "$(SCORERS): not installed; the tests that compare with them are skipped"
	@touch $@

$(VENV)/.lint: $(VENV)/.test
	@$(call stage,what the checks need,$(PIP) --editable '.[lint]')
	@touch $@

$(VENV)/.docs: $(VENV)/.package
	@$(call stage,what the site needs,$(PIP) --editable '.[docs]')
	@touch $@

$(VENV)/.build: $(VENV)/.package
	@$(call stage,what the wheel needs,$(PIP) build)
	@touch $@

# $(call stage,text,command): run it with a dot every other second; its output is shown where it fails.
define stage
{ printf '%s ' "installing: $(1)"; \
  { while sleep 2 && kill -0 $$$$ 2>/dev/null; do printf .; done; } & dots=$$!; \
  output=$$($(2) 2>&1); status=$$?; kill $$dots; echo; [ $$status = 0 ] || { echo "$$output"; false; }; }
endef

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

# The demo's path, shorter, where no OpenGL library can be found: the extra `warp` draws, which comes with the tests.
bare: $(VENV)/.test
	rm -rf build/bare
	$(WITHOUT_GL) $(BIN)/pftrack-sim doctor --check
	$(WITHOUT_GL) $(BIN)/pftrack-sim bench corridor --seeds 0:1 --trackers stay --set duration_s=0.5 --out build/bare

# Linear algebra on a thread for each core waits for its threads where every core is busy: up to ten times as long.
test test-slow fuzz: export OPENBLAS_NUM_THREADS := 1

test: $(VENV)/.test
	$(BIN)/python -m pytest -n 2 --dist worksteal -q -m "not slow"

# What .ci/run asks for besides.
test-slow: $(VENV)/.test
	$(BIN)/python -m pytest -n 2 --dist worksteal -q -m slow

# Mutated scenarios, command lines, run folders and recorded sequences: 10,000 cases, for a nightly run.
fuzz: $(VENV)/.test
	PFTRACK_SIM_FUZZ_CASES=10000 $(BIN)/python -m pytest -n 2 --dist worksteal -q -m slow tests/attack/test_fuzz.py

lint: $(VENV)/.lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/basedpyright
	$(BIN)/lint-imports

# The table of what a step and a reset cost, with the change against tests/perf/table.json, then the rest.
perf: $(VENV)/.test
	$(BIN)/python tests/perf/perf_table.py
	@for script in $(filter-out %/perf_table.py,$(wildcard tests/perf/perf_*.py)); do echo "== $$script"; $(BIN)/python $$script || exit 1; done

# The site, in build/site; a broken link is an error.
docs: $(VENV)/.docs
	$(BIN)/mkdocs build --quiet

# The pictures of README, gallery, environments and tutorials; PARTS="axes tutorials" draws some.
pictures: $(VENV)/.test
	$(BIN)/python docs/site/pictures.py $(PARTS)

# The tables of the pages, by the commands above them, as far as those that made them are not those of now; hours, so
# PARTS="ko2012 courses" makes some, PARTS=--list says which, and MORE="--scheduler ADDRESS" runs them on Dask.
results: $(VENV)/.test
	$(BIN)/python docs/site/results.py $(PARTS)

# The wheel as a stranger gets it: built, installed in a clean environment, every scenario stepped once from elsewhere.
wheel: $(VENV)/.build
	rm -rf build dist
	$(BIN)/python -m build --wheel
	$(PYTHON) -m venv $(WHEEL_VENV)
	$(WHEEL_VENV)/bin/python -m pip install --quiet --disable-pip-version-check dist/*.whl
	cd $(WHEEL_VENV) && bin/python $(CURDIR)/tests/smoke_wheel.py

clean:
	rm -rf $(VENV) build dist demo runs
