"""A file of a survey that is missing, empty, without rows or broken is one problem: one line."""

import shutil
from pathlib import Path

import pytest
from messages_told import lines

import tankcal
from tankcal.errors import InputError

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SURVEYS = ("strapping", "reference-line", "wall-hits", "tangents")
OF_MANY_KEYS = {  # a key of job.toml needs it, or each key that is missing is one
    ("tangents", "control.csv"),
    *((survey, "job.toml") for survey in SURVEYS),
}


def without_rows(text):
    rows = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    return rows[0] + "\n"


SPOILT = {
    "missing": None,
    "empty": lambda text: "",
    "without rows": without_rows,
    "broken": lambda text: text.replace("=", "= [", 1) + '\n"',
}


def told_without(folder, name, spoil):
    """Lines of what is told of the job of a folder with a file spoilt."""
    path = folder / name
    text = path.read_text(encoding="utf-8")
    path.unlink()
    if spoil is not None:
        path.write_text(spoil(text), encoding="utf-8")
    try:
        tankcal.load(folder)
        return []
    except InputError as error:
        return lines(error.problems)
    finally:
        path.write_text(text, encoding="utf-8")


@pytest.mark.slow(after=2)
@pytest.mark.parametrize("how", SPOILT)
@pytest.mark.parametrize("survey", SURVEYS)
def test_one_file_is_one_line(tmp_path, survey, how):
    folder = shutil.copytree(EXAMPLES / survey, tmp_path / survey)
    for path in sorted(folder.iterdir()):
        is_table = path.suffix == ".csv"
        if not (is_table or (path.suffix == ".toml" and how != "without rows")):
            continue
        told = told_without(folder, path.name, SPOILT[how])
        if (survey, path.name) not in OF_MANY_KEYS:
            assert len(told) <= 1, (path.name, told)
        assert all(line.partition(",")[0].partition(":")[0].endswith((".csv", ".toml"))
                   for line in told)  # fmt: skip


def test_a_missing_instruments_toml_is_told_of_itself(tmp_path):
    for survey in SURVEYS:
        folder = shutil.copytree(EXAMPLES / survey, tmp_path / survey)
        (told,) = told_without(folder, "instruments.toml", None)
        assert told.startswith("instruments.toml: missing or empty; expected it: the column ")
