.DEFAULT_GOAL := help
.PHONY: help setup lint fmt test bench peers

VENV ?= .venv
BIN  := $(abspath $(VENV))/bin
export PATH := $(BIN):$(PATH)
export VIRTUAL_ENV := $(abspath $(VENV))
# The binding crate is built by maturin with the venv's interpreter; cargo must see the same one,
# or every switch between the two rebuilds it.
export PYO3_PYTHON := $(BIN)/python

PYTHON ?= $(shell command -v python3.11 || command -v python3)
BENCH_ARGS ?= --quick

RUST_SOURCES := $(shell find crates -name '*.rs' -o -name Cargo.toml) Cargo.toml Cargo.lock $(wildcard assets/weights/*.safetensors)

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || { echo "make: '$(PYTHON)' is not Python 3.11, and PyBullet has no wheels for later ones: install Python 3.11 or pass PYTHON=/path/to/python3.11" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install -q 'maturin>=1.16,<2'

$(VENV)/.installed: pyproject.toml $(RUST_SOURCES) | $(BIN)/python
	$(BIN)/pip install -q --no-build-isolation -e '.[dev]'
	@touch $@

setup: $(VENV)/.installed ## Create the venv and install everything (release build of the extension)

fmt: setup ## Format Rust and Python
	cargo fmt --all
	$(BIN)/ruff check --fix-only .
	$(BIN)/ruff format .

lint: setup ## Everything CI checks, without running tests
	cargo fmt --all -- --check
	cargo clippy --workspace --all-targets --release -- -D warnings
	RUSTDOCFLAGS='-D warnings' cargo doc --workspace --no-deps --release
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

test: setup ## Set up, then the fast Rust and Python tests
	cargo test --workspace --release
	$(BIN)/pytest -n auto --dist loadfile

bench: setup ## Set up, then the benchmark (BENCH_ARGS="--scenes 32" for a longer one)
	$(BIN)/harness bench $(BENCH_ARGS)

peers: setup ## Time our kernels beside their peers (octree, scorer; the GP's needs gpytorch)
	$(BIN)/python -m harness.benchmarks.octomap_peer
	$(BIN)/python -m harness.benchmarks.score_peer
	$(BIN)/python -m harness.benchmarks.gp_peer

help: ## Show this list
	@awk 'BEGIN {FS = ":.*?## "} /^[a-z-]+:.*?## / {printf "  \033[36m%-10s\033[0m %s\n", $$1, $$2}' $(MAKEFILE_LIST)
