"""Whatever is handed in, it is read, or refused in plain lines: nothing else ever comes out.

Property: of jobs, plans, workbooks and tables spoilt at random, from fixed seeds, each one is read
and computed, or gives an InputError or a SolutionError, whose every line says something.
"""

import os

import numpy as np
import pytest
from called_commands import COARSE, FULL, LYING
from conftest import EXAMPLE
from draws import draws
from fuzzing import spoilt_csv, spoilt_folder, spoilt_parts
from job_builder import job_parts, write_book, write_folder
from metered_tanks import metered_parts
from survey_builder import survey_parts

from tankcal.errors import InputError, SolutionError
from tankcal.job import load
from tankcal.pipeline.chain import run
from tankcal.planning.reading import load_plan
from tankcal.products.linter.linting import lint

pytestmark = pytest.mark.slow

FEW, MANY = 60, draws(200, 3000)  # of each kind: in every run of the tests, in the study
METERED = {"table__step_m": 0.5}


def bases():
    """{name: (Parts, whether what is read is computed, too)}."""
    return {
        "vertical": (job_parts(settings=COARSE, **FULL), True),
        "lying": (job_parts(**LYING), True),
        "sphere": (job_parts(kind="sphere", settings=COARSE), True),
        "survey": (survey_parts(), False),
        "liquid": (
            job_parts(settings=COARSE, bottom_volumes=[(0, 0, 0), (0.1, 10, 0.1)], courses=2),
            True,
        ),
        "metered": (metered_parts(strapped=True, **METERED), False),
        "metered-lying": (metered_parts("horizontal", **METERED), False),
    }


def text_files(folder):
    return {
        path.name: path.read_bytes()
        for path in folder.iterdir()
        if path.suffix in (".csv", ".toml")
    }


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """{name: ({file: bytes}, whether it is computed)} of every kind of job."""
    place = tmp_path_factory.mktemp("bases")
    found = {}
    for name, (parts, computed) in bases().items():
        found[name] = text_files(write_folder(place / name, parts)), computed
    found["stations"] = text_files(EXAMPLE.parent / "total-station"), False
    return found


def test_the_jobs_are_valid_before_they_are_spoilt(tmp_path):
    for name, (parts, computed) in bases().items():
        if computed:
            run(load(write_folder(tmp_path / name, parts)))


def told(act, *arguments):
    """What `act` gives; None when it refuses in plain lines. Anything else is raised."""
    try:
        return act(*arguments)
    except (InputError, SolutionError) as error:
        text = str(error)
    assert all(line.strip() for line in text.split("\n"))
    assert len(text) < 100_000
    return None


def written(folder, files):
    folder.mkdir(exist_ok=True)
    for path in folder.iterdir():
        path.unlink()
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return folder


def assert_jobs(folders, folder, seeds):
    for name, (files, computed) in folders.items():
        for seed in seeds:
            spoilt = spoilt_folder(files, np.random.default_rng([len(name), seed]))
            with at(name, seed, spoilt, folder):
                job = told(load, written(folder, spoilt))
                if computed and job is not None:
                    told(run, job)


class at:
    """Says which seed it was, and leaves its files to be looked at."""

    def __init__(self, *what):
        self.what = what

    def __enter__(self):
        return self

    def __exit__(self, kind, error, _):
        if kind is not None and issubclass(kind, Exception):
            error.add_note(f"seed of {self.what[0]}: {self.what[1]}; files in {self.what[3]}")


def test_spoilt_jobs_are_reported(folders, tmp_path):
    assert_jobs(folders, tmp_path / "job", range(FEW))


def test_spoilt_workbooks_are_reported(tmp_path):
    for name, (parts, _) in bases().items():
        for seed in range(FEW // 10):
            spoilt = spoilt_parts(parts, np.random.default_rng([7, seed]))
            with at(name, seed, spoilt, tmp_path):
                told(load, write_book(tmp_path / "job.xlsx", spoilt))


@pytest.mark.parametrize(
    "name",
    [
        "plan-silva",
        "plan-reference-line",
        "plan-wall-hits",
        "plan-tangents",
        "plan-liquid",
        "plan-triangulation",
    ],
)
def test_spoilt_plans_are_reported(tmp_path, name):
    files = text_files(EXAMPLE.parent / name)
    for seed in range(FEW):
        spoilt = spoilt_folder(files, np.random.default_rng([8, seed]))
        with at("plan", seed, spoilt, tmp_path):
            told(load_plan, written(tmp_path / "plan", spoilt))


def test_spoilt_tables_are_reported_by_the_linter(tmp_path):
    rows = [f"{k / 100:.2f},{1.3 * k:.3f}" for k in range(60)]
    wide = [f"{k},{k * 13},{k + 60},{(k + 60) * 13}" for k in range(60)]
    lines = (["height_m,volume_m3", *rows], ["cm,L,cm,L", *wide], rows)
    texts = ["\n".join(one) for one in lines]
    for seed in range(FEW):
        rng = np.random.default_rng([9, seed])
        for name, text in enumerate(texts):
            (tmp_path / "table.csv").write_bytes(spoilt_csv(text, rng).encode())
            with at(name, seed, text, tmp_path):
                told(lint, tmp_path / "table.csv")


@pytest.mark.study
def test_very_many_spoilt_inputs(folders, tmp_path):
    """A share of MANY, from the seed in TANKCAL_FUZZ_FROM on: other ones in each study."""
    start = int(os.environ.get("TANKCAL_FUZZ_FROM", "1000"))
    assert_jobs(folders, tmp_path / "job", range(start, start + MANY))
