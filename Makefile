# The commands of developers and of CI. Each target does its own set-up.
VENV := .venv
BIN := $(VENV)/bin
PEERS := $(VENV)/peers# what is compared with, on top of $(VENV)
export OPENBLAS_NUM_THREADS ?= 1
unexport PYTHONDONTWRITEBYTECODE # else each process compiles all modules and tests again: 14 s
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PIP_CONSTRAINT := $(CURDIR)/constraints.txt

.DEFAULT_GOAL := help
.PHONY: help demo test test-slow test-rest test-all study study-full check format notebooks job-format schemas bench benchmark-page picture site site-of-notebooks wheel offline frozen clean

help: ## what can be made
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

demo: $(VENV)/base ## run the example, or any job: make demo JOB=path/to/job
ifdef JOB
	$(BIN)/tankcal run "$(JOB)"
else
	$(BIN)/tankcal demo --out demo-results
endif

test: $(VENV)/full ## the tests of a tenth of a second or less, and those of the core (a minute)
	$(BIN)/pytest

test-slow: $(VENV)/full ## the others: papers of all kinds, many cases, studies at a twentieth of their size
	$(BIN)/pytest -m 'slow and not study'

test-all: test test-slow ## every test but the studies at full size

study: $(VENV)/full ## the statistical studies and what else takes long (ten minutes)
	$(BIN)/pytest -m study --dist worksteal --durations 25

test-rest: $(VENV)/full ## what make test leaves out, in one run that shares its papers; PART=1/6: a sixth of it
	$(BIN)/pytest -m '$(if $(PART),slow,(slow and not twentieth)) or study' --dist worksteal --durations 25 $(if $(PART),--part $(PART))

study-full: export TANKCAL_STUDIES := full
study-full: study ## the same with as many draws as the figures in docs/ were measured with (an hour)

check: $(VENV)/full ## style, layers, words and names to avoid, structure, notebooks without outputs
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/python notebooks/stripped.py notebooks report_templates
	$(BIN)/python tests/house/prose_counts.py
	$(BIN)/python tests/house/page_counts.py
	$(BIN)/python tests/house/spelling.py
	$(BIN)/python tests/house/structure_counts.py

format: $(VENV)/full ## format the code and mend what ruff can
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

notebooks: $(VENV)/full ## execute every notebook, top to bottom
	mkdir -p build/notebooks/studies
	cd notebooks && printf '%s\n' studies/*.ipynb *.ipynb | xargs -P 2 -I {} \
	  sh -c '../$(BIN)/jupyter nbconvert --to notebook --execute --output-dir ../build/notebooks/$$(dirname {}) {}'

job-format: $(VENV)/full ## fill the tables of docs/job-format.md from the contract of the job
	$(BIN)/python -m tankcal.job.starter.texts docs/job-format.md
	$(BIN)/python tests/support/plausible_page.py

schemas: $(VENV)/full ## write the JSON schemas of what is saved and docs/saved-keys.md
	PYTHONPATH=.:tests $(BIN)/python tests/schemas.py

bench: export ROUNDS ?= 5
bench: $(PEERS)/errors.json ## time and memory of what people wait for, beside Ceres, gtsam, GTC, open3d, fluids: build/benchmarks.json
	$(PEERS)/bin/python benchmarks/run.py $(ONLY)

benchmark-page: ## fill the tables of docs/studies/benchmarks.md with the last make bench
	$(BIN)/python benchmarks/page.py build/benchmarks.json docs/studies/benchmarks.md

picture: notebooks ## the pictures in the README, of the example's report and the notebooks (needs poppler)
	$(BIN)/tankcal demo --quiet --out demo-results
	mkdir -p build && pdftoppm -r 55 -png demo-results/report.pdf build/page
	$(BIN)/python docs/picture.py build docs/images/certificate.png
	$(BIN)/python docs/notebook_pictures.py build/notebooks docs/images
	$(BIN)/python docs/wall_pictures.py docs/images

site: notebooks ## these pages, the executed notebooks and the API as a site: build/site/index.html
	$(MAKE) site-of-notebooks

site-of-notebooks: $(VENV)/docs # that were executed already
	$(BIN)/python docs/stage.py build/site-source build/notebooks
	$(BIN)/sphinx-build -q -W --keep-going -c docs -b html build/site-source build/site

wheel: $(VENV)/release ## wheel and source archive in dist/, built twice and compared; run from the wheel, away from here
	.ci/wheel $(TAG)

offline: $(VENV)/release ## after make wheel: zips that install tankcal without a network (Windows, macOS, Linux)
	$(BIN)/python installers/offline.py dist/*.whl
	if command -v makensis >/dev/null; then installers/windows.sh $(PYTHON_ZIP); else echo "no makensis here: the installer for Windows was not built"; fi
	rm -rf build/offline/trial && mkdir -p build/offline/trial
	cd build/offline/trial && ../../../$(BIN)/python -m zipfile -e ../../../dist/tankcal-offline-linux.zip . && \
	  HOME=$$PWD PIP_NO_INDEX=1 PYTHON=python3 sh tankcal-offline/install.command
	$(BIN)/python installers/try_app.py build/offline/trial/tankcal-app/bin/tankcal
	rm -rf build/offline/trial

frozen: $(VENV)/release ## after make wheel: a folder with Python and tankcal for Linux, tried (PyInstaller)
	installers/frozen.sh dist/*.whl

$(VENV)/base: pyproject.toml constraints.txt
	@echo "setting up $(VENV), once: about 35 packages, 125 MB to fetch"
	@test -x $(BIN)/python || python3 -m venv $(VENV)
	@$(BIN)/python .ci/install.py --editable .
	@touch $@

$(VENV)/full: $(VENV)/base
	$(BIN)/pip install --quiet --editable '.[test,check,images,clouds,cluster,lab,fast]'
	$(BIN)/python -m tankcal.cli.kernels
	touch $@

$(PEERS)/errors.json: $(VENV)/full benchmarks/peers.py
	$(BIN)/python benchmarks/peers.py $(PEERS)

$(VENV)/release: $(VENV)/full
	$(BIN)/pip install --quiet --editable '.[release]'
	touch $@

$(VENV)/docs: $(VENV)/full
	$(BIN)/pip install --quiet --editable '.[docs]'
	touch $@

clean: ## remove what was made, but not results of yours
	rm -rf $(VENV) build dist demo-results .pytest_cache .ruff_cache .hypothesis .import_linter_cache
