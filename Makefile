# make demo    everything at small scale, from nothing to a report      make test    the whole test suite
# make install only the environment                                     make check   lint, types, import rules
# make study   the numbers in results/ again, hours: recipes/study.yaml
# make docs    the documentation site, build/docs/index.html; INTERSPHINX=1 links numpy's, torch's and trimesh's pages
#
# All of them set up .venv first, from pinned versions. A machine with a GPU can bring its own torch:
# make install PIP_FLAGS="--index-url ..." CONSTRAINTS=/dev/null

PYTHON ?= $(shell command -v python3.11 || command -v python3)
CONSTRAINTS ?= constraints.txt
PIP_FLAGS ?=
# A file's tests share what they render, so a file stays with one process.
PYTEST_FLAGS ?= -n auto --dist loadfile
DEMO ?= demo
STUDY ?= study
INTERSPHINX ?=
BIN := .venv/bin
# What Blender's library wants from the system, where it is not there already (Debian's names).
BLENDER_LIBRARIES := libx11-6 libxrender1 libxfixes3 libxi6 libxkbcommon0 libxext6 libsm6 libice6 libgl1
# And what it draws drafts with (render --engine workbench), in software.
DRAFT_LIBRARIES := libegl1 libgl1-mesa-dri

# Blender's other line of long-term support comes as a library for Python 3.13 only; no torch beside it.
PYTHON313 ?= python3.13
BLENDER_5_2 := .venv-blender-5.2

.PHONY: install demo study test check docs test-blender-5.2 clean

install: .venv/.installed

demo: .venv/.installed
	$(BIN)/stereoforge demo --out $(DEMO)

study: .venv/.installed
	$(BIN)/stereoforge study --plan recipes/study.yaml --out $(STUDY)
	rm -rf results && cp -R $(STUDY)/results results && rm results/report.html
	@echo "the report: $(STUDY)/results/report.html; the networks: $(STUDY)/runs (stereoforge/weights/ are flying_things')"

test: .venv/.installed-dev
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m pytest $(PYTEST_FLAGS)

check: .venv/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: .venv/.installed-docs
	INTERSPHINX=$(INTERSPHINX) $(BIN)/python -m sphinx --builder html --fail-on-warning --keep-going --quiet docs build/docs

test-blender-5.2: $(BLENDER_5_2)/.installed
	OMP_NUM_THREADS=1 $(BLENDER_5_2)/bin/python -m pytest $(PYTEST_FLAGS) tests/scenes tests/datagen tests/stereoforge_kit/files tests/stereoforge_kit/viewing

$(BLENDER_5_2)/.installed: pyproject.toml constraints-blender-5.2.txt
	@$(PYTHON313) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 13))' 2>/dev/null || \
	  { echo "Blender 5.2's library needs Python 3.13, which is not here; say where with make test-blender-5.2 PYTHON313=/path/to/python3.13"; exit 1; }
	$(PYTHON313) -m venv $(BLENDER_5_2)
	$(BLENDER_5_2)/bin/python -m pip install --quiet --progress-bar off --constraint constraints-blender-5.2.txt $(PIP_FLAGS) --editable '.[render,dev]'
	@touch $@

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || \
	  { echo "StereoForge's pinned environment needs Python 3.11; say where with make PYTHON=/path/to/python3.11"; exit 1; }
	$(PYTHON) -m venv .venv || { echo "python3 cannot make environments here: apt-get install python3-venv"; exit 1; }

.venv/.installed: .venv/bin/python pyproject.toml $(CONSTRAINTS)
	$(BIN)/python -m pip install --quiet --progress-bar off --constraint $(CONSTRAINTS) $(PIP_FLAGS) --editable .
	@# That is enough for the kernels, which are compiled while the large packages come. They are compiled from this
	@# folder, since pip replaces what it has installed of it.
	$(BIN)/python -m stereoforge warm-up & compiling=$$!; \
	$(BIN)/python -m pip install --quiet --progress-bar off --constraint $(CONSTRAINTS) $(PIP_FLAGS) --editable '.[all]'; \
	installed=$$?; wait $$compiling && exit $$installed
	@$(BIN)/python -c 'import bpy' >/dev/null 2>&1 || $(MAKE) --no-print-directory blender-libraries
	@touch $@

.venv/.installed-dev: .venv/.installed
	$(BIN)/python -m pip install --quiet --progress-bar off --constraint $(CONSTRAINTS) $(PIP_FLAGS) --editable '.[all,dev]'
	@$(BIN)/python -c 'import ctypes; ctypes.CDLL("libEGL.so.1")' 2>/dev/null || $(MAKE) --no-print-directory draft-libraries
	@# Its other networks need packages that need a GPU; the tests train its GwcNet alone.
	$(BIN)/python -m pip install --quiet --progress-bar off --constraint $(CONSTRAINTS) $(PIP_FLAGS) --no-deps stereo-toolbox
	@touch $@

.venv/.installed-docs: .venv/.installed
	$(BIN)/python -m pip install --quiet --progress-bar off --constraint $(CONSTRAINTS) $(PIP_FLAGS) --editable '.[all,docs]'
	@touch $@

.PHONY: blender-libraries
blender-libraries:
	@if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  apt-get update -qq && apt-get install -y -qq $(BLENDER_LIBRARIES) >/dev/null; fi
	@$(BIN)/python -c 'import bpy' || { echo "Blender needs system libraries: apt-get install $(BLENDER_LIBRARIES)"; exit 1; }

.PHONY: draft-libraries
draft-libraries:
	@if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  apt-get update -qq && apt-get install -y -qq $(DRAFT_LIBRARIES) >/dev/null; \
	else echo "drafts are not tested here: apt-get install $(DRAFT_LIBRARIES)"; fi

clean:
	rm -rf .venv $(BLENDER_5_2) build *.egg-info
