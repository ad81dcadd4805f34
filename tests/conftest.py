"""Fixtures shared by the tests: where data lies, and the shipped example computed once."""

import os
from pathlib import Path

import pytest

import tankcal
from tankcal.record import record_of, save

ROOT = Path(__file__).resolve().parent.parent
EXAMPLE = ROOT / "examples" / "silva-1995"


@pytest.fixture(scope="session")
def shared():
    """The folder of data that is read in place; tests skip where it is absent."""
    folder = Path(os.environ.get("TANKCAL_DATA", ROOT.parent / "shared"))
    if not folder.is_dir():
        pytest.skip("no shared data here: set TANKCAL_DATA to its folder")
    return folder


@pytest.fixture(scope="session")
def example_result():
    """The shipped example, computed."""
    return tankcal.run(tankcal.load(EXAMPLE))


@pytest.fixture(scope="session")
def example_record(example_result, tmp_path_factory):
    """Path of the record.json of the shipped example."""
    path = tmp_path_factory.mktemp("example") / "record.json"
    save(record_of(example_result), path)
    return path
