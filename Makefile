# Two commands matter: `make demo` and `make test`. Both set everything up first, once: .venv and the pinned packages.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STUDY := PYTHONPATH=docs $(BIN)/python -m studies
STAMP := $(VENV)/.installed
DOCS_STAMP := $(VENV)/.installed-docs
FAST_STAMP := $(VENV)/.installed-fast
LOWEST := .venv-lowest
LOWEST_STAMP := $(LOWEST)/.installed
INSTALL := -m pip install --disable-pip-version-check --constraint
PIP := $(BIN)/python $(INSTALL) constraints.txt
# The tests of a file stay in one process, so that the fixtures of a module are made once.
PYTEST := $(BIN)/pytest -n auto --dist loadfile
SITE := build/docs
# Byte code is kept, also where the machine's default is not to.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo test test-slow test-all explore test-lowest lint types unit generated docs bench regress reproduce benchmark consistency regret faults learned clean

demo: $(STAMP)
	@echo
	@echo "Twenty seconds of \`cut-in\` in closed loop: traffic, six radars, the default tracker, the planner idm."
	@echo "In numpy; with numba (pip install --constraint constraints.txt -e \".[fast]\") tracker and radar are compiled at their first use."
	EOT_COMPILED=off $(BIN)/testbed run cut-in --radar surround --seed 0 --out runs

test: $(STAMP)  # side by side; the tests end last
	@$(MAKE) --no-print-directory --jobs=2 lint types unit

# What is marked slow in some minutes: every entry of the registries. Without the hostile calls and the Monte Carlo bars.
test-slow: $(FAST_STAMP)
	@$(BIN)/testbed info --compile > /dev/null
	$(PYTEST) -m slow --ignore tests/fuzz --ignore tests/reproduction

test-all: lint types $(FAST_STAMP)  # with all that is marked slow
	$(PYTEST) -m ""

explore: $(FAST_STAMP)  # every property with EXAMPLES new random examples; a failure prints the example that fails
	EXPLORE=$(EXAMPLES) $(PYTEST) -m hypothesis
explore: EXAMPLES ?= 500

test-lowest: $(LOWEST_STAMP)  # what users meet, with the lowest versions that pyproject.toml allows
	$(LOWEST)/bin/pytest -n auto --dist loadfile --disable-warnings tests/sensors tests/scenarios tests/trackers tests/testbed

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(STAMP)
	$(BIN)/mypy

unit: $(FAST_STAMP)  # compiled once for all processes, about a minute where a compiled file was changed
	@$(BIN)/testbed info --compile > /dev/null
	$(PYTEST)

generated: $(STAMP)  # what the documentation says about the registries; after adding a scenario, tracker, radar, ...
	$(STUDY) generated
	$(STUDY) vehicles --docs docs
	$(STUDY) radars --docs docs

docs: $(DOCS_STAMP)  # the pages and the API reference as a site; a warning or a broken link is an error
	$(BIN)/sphinx-build --fail-on-warning --keep-going --quiet -c docs . $(SITE)
	@echo "open     $(SITE)/docs/index.html"

bench: $(STAMP)
	$(BIN)/testbed bench

regress: $(STAMP)  # some minutes; after a wanted change `testbed regress --update`
	$(BIN)/testbed regress

# `make study-modes` writes docs/modes.md, and so for every name of `make study-`: what it needs is driven anew, what is
# committed is taken, and what was interrupted goes on. DATA is a folder of recordings, for those that need one.
study-%: $(STAMP)
	$(STUDY) $* $(DATA) --docs docs $(OPTIONS)

# About an hour on two cores. A claim that is not confirmed is an answer, not a failure of the command, hence `|| test`.
reproduce: $(STAMP)
	for paper in hoher2022 xia2020 xia2020-learned xu2023 yao2021; do \
		$(BIN)/testbed reproduce $$paper --runs 100 --out runs/reproduce || test $$? -eq 1 || exit; \
	done
	$(STUDY) verdicts

# The comparison of record: all trackers in the benchmark, two of other libraries, and the default without its layers. It
# takes CPU hours; the same command goes on where it was interrupted. OPTIONS may name a cluster, or `--first 2` seeds.
# `make study-comparison DATA=runs/benchmark` writes docs/comparison.md and the figures of the README from what is there.
LAYERS := --tracker imm-spline:size=off --tracker imm-spline:motion=off
OTHERS := --tracker filterpy_tracker:Points --tracker stonesoup_tracker:Soup
benchmark: $(STAMP)
	$(PIP) filterpy==2.0.0 stonesoup==1.9
	PYTHONPATH=docs/examples $(BIN)/testbed benchmark run v1 --tracker all $(LAYERS) $(OTHERS) --jobs -1 $(OPTIONS) \
		--out runs/benchmark
	$(STUDY) comparison runs/benchmark --docs docs

# Ten CPU minutes; the same command goes on where it was interrupted. Seeds that no parameter was set on.
consistency: $(STAMP)
	$(BIN)/testbed compare all --tracker imm-spline --seeds 990:994 --duration 30 --after 3 --settle 2 --jobs -1 \
		--out runs/consistency
	$(STUDY) consistency runs/consistency --docs docs

# Four CPU hours; the same command goes on where it was interrupted. Seeds that no parameter was set on.
REGRET_TRACKERS := imm-spline edra-imm rm-feldmann rm-koch
REGRET_PLANNERS := idm mpc mpc-cautious tree
REGRET_DOSES := velocity_lag=0.25 velocity_lag=0.5 velocity_lag=1 lateral_velocity=0.5 lateral_velocity=1 near_edge=-1 \
	near_edge=1 birth_delay=0.6 birth_delay=1.2 loss_rate=0.1 loss_rate=0.3 latency=0.2 latency=0.4
ATTRIBUTION := probe-oncoming probe-passing probe-reveal
CAUTION := probe-reveal probe-pullout
REGRET := $(BIN)/testbed regret --jobs -1
regret: $(STAMP)
	$(REGRET) $(REGRET_PLANNERS:%=--planner %) $(REGRET_TRACKERS:%=--tracker %) --seeds 200:220 --out runs/regret/main
	$(REGRET) probe-merge --planner idm-keen $(REGRET_TRACKERS:%=--tracker %) --seeds 200:220 --out runs/regret/merge
	$(REGRET) $(ATTRIBUTION) --planner mpc --tracker imm-spline --tracker rm-feldmann --attribute --seeds 200:205 \
		--out runs/regret/attribution
	$(REGRET) $(REGRET_DOSES:%=--inject %) --seeds 200:205 --out runs/regret/doses
	$(REGRET) $(CAUTION) --planner mpc --planner mpc-cautious --tracker imm-spline \
		--tracker imm-spline+covariance=0.25 --tracker imm-spline+covariance=4 --seeds 240:280 --out runs/regret/caution
	$(STUDY) regret $(foreach part,main attribution doses caution,$(part)=runs/regret/$(part)) main=runs/regret/merge --docs docs

# Twenty trainings, about three CPU hours; needs the extra rl. Trainings that are there are kept.
LEARNED := $(foreach tracker,truth imm-spline,$(foreach seed,0 1 2 3 4 5 6 7 8 9,runs/learned/$(tracker)-$(seed).npz))
learned: $(LEARNED)
	$(STUDY) learned-policies runs/learned --docs docs
runs/learned/%.npz: $(STAMP)
	$(PIP) --editable '.[rl]'
	mkdir -p runs/learned
	$(BIN)/python docs/examples/train.py --tracker $(shell echo $* | sed 's/-[0-9]*$$//') --seed $(lastword $(subst -, ,$*)) \
		--episodes 1 --out $@

# Half a CPU hour; the same command goes on where it was interrupted. Seeds that no parameter was set on.
FAULTS := front:outage:2:4 outage:2:3 front:yaw:0.5 corners:yaw:2 clock:0.05 drop:0.2 drop:0.5 burst:3:500 \
	burst:2:200:2 blind:rain:0.5 blind:dirt:0.5
FAULT_TRACKERS := imm-spline edra-imm htg-map rm-feldmann
FAULT_SCENARIOS := cut-in dense-traffic
faults: $(STAMP)
	$(BIN)/testbed compare $(FAULT_SCENARIOS) $(FAULT_TRACKERS:%=--tracker %) $(FAULTS:%=--fault %) \
		--seeds 300:310 --duration 6 --jobs -1 --out runs/faults
	$(STUDY) faults runs/faults --docs docs

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c "import sys; v = sys.version_info; sys.exit(0 if v >= (3, 11) else f'Python >= 3.11 is needed, $(PYTHON) is {v[0]}.{v[1]}; call make PYTHON=python3.11')"
	@echo "Setting up, once. 1 of 2: $(VENV), some seconds"
	$(PYTHON) -m venv $(VENV)
	@echo "2 of 2: the pinned packages of constraints.txt, about 410 MB, 1 to 3 minutes, of which pip unpacks the last one in silence"
	$(PIP) --editable '.[dev]'
	@touch $(STAMP)

$(FAST_STAMP): $(STAMP)
	@echo "numba, for the tests of the compiled form, about 215 MB"
	$(PIP) --editable '.[dev,fast]'
	@touch $@

$(DOCS_STAMP): $(STAMP)
	$(PIP) --editable '.[dev,docs]'
	@touch $(DOCS_STAMP)

$(LOWEST_STAMP): pyproject.toml constraints.txt tests/lowest.py
	$(PYTHON) -m venv $(LOWEST)
	$(LOWEST)/bin/python tests/lowest.py > $(LOWEST)/constraints.txt
	$(LOWEST)/bin/python $(INSTALL) $(LOWEST)/constraints.txt --editable '.[dev]'
	@touch $@

clean:
	rm -rf $(VENV) $(LOWEST) runs build docs/api *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
