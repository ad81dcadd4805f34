"""What is said of a [ship] that cannot be: one line for each problem, all in one run."""

import pytest
from job_builder import job_parts, write_book, write_folder

from tankcal.errors import InputError
from tankcal.job import load

SHIP = {
    "ship.trim_m": [-1.0, 0.0, 2.0],
    "ship.length_between_marks_m": 100.0,
    "ship.list_deg": [0.0, 1.5],
    "ship.pipe_bottom_m": [-5.5, -2.5, 0.0],
    "ship.pipe_top_m": [-5.5, -2.5, 6.0],
}
BAD = [
    ({"ship.trim_m": None}, "ship.trim_m", "missing; expected together with"),
    ({"ship.pipe_top_m": None}, "ship.pipe_top_m", "missing"),
    ({"ship.length_between_marks_m": None}, "ship.length_between_marks_m", "missing"),
    ({"ship.trim_m": [1.0, 1.0]}, "ship.trim_m", "given twice"),
    ({"ship.trim_m": "steep"}, "ship.trim_m", "expected numbers"),
    ({"ship.list_deg": [60.0]}, "ship.list_deg", "-45 to 45"),
    ({"ship.length_between_marks_m": 5.0}, "ship.trim_m", "at most 1 m over 5 m"),
    ({"ship.pipe_bottom_m": [0.0, 0.0]}, "ship.pipe_bottom_m", "2 numbers"),
    ({"ship.pipe_top_m": [-5.5, -2.5, -6.0]}, "ship.pipe_top_m", "upside down"),
    ({"ship.pipe_top_m": [90.0, -2.5, 6.0]}, "ship.pipe_top_m", "for each metre"),
    ({"ship.contraction_percent": 40.0}, "ship.contraction_percent", "-1 to 2"),
    (
        {"ship.contraction_percent": 0.4, "survey.shell_temperature_c": 20.0},
        "ship.contraction_percent",
        "only one of them",
    ),
    ({"datum.dip_plate_z_m": 0.1}, "datum.dip_plate_z_m", "ship.pipe_bottom_m"),
    ({"ship.trims": [1.0]}, "ship", "trim_m"),
    (
        {"ship.trim_m": [0.01 * i for i in range(30)], "ship.list_deg": [*map(float, range(15))]},
        "ship.trim_m",
        "450 pairs",
    ),
]


def problems_of(parts, folder):
    with pytest.raises(InputError) as caught:
        load(write_folder(folder / "job", parts))
    return [str(one) for one in caught.value.problems]


@pytest.mark.parametrize(("changes", "place", "words"), BAD)
def test_one_line_for_each(tmp_path, changes, place, words):
    parts = job_parts(kind="mesh", mesh=b"solid", settings=SHIP | changes)
    (problem,) = problems_of(parts, tmp_path)
    assert place in problem
    assert words in problem


def test_all_in_one_run(tmp_path):
    changes = {"ship.trim_m": [1.0, 1.0], "ship.pipe_bottom_m": [0.0], "datum.dip_plate_z_m": 0.0}
    parts = job_parts(
        kind="mesh",
        mesh=b"solid",
        settings=SHIP | changes,
        deadwood=[("coil", 0.5, 1.0, -0.2)],
    )
    assert len(problems_of(parts, tmp_path)) == 4


def test_only_for_a_mesh(tmp_path):
    (problem,) = problems_of(job_parts(kind="sphere", settings=SHIP), tmp_path)
    assert "[ship]" in problem
    assert "kind mesh" in problem


@pytest.mark.parametrize(
    ("name", "unit"), [("trim", "mm"), ("pipe_lean", "mm/m"), ("contraction", "%")]
)
def test_inputs_without_a_ship(tmp_path, name, unit):
    parts = job_parts(kind="mesh", mesh=b"solid", uncertainty=[(name, 0.1, unit)])
    (problem,) = problems_of(parts, tmp_path)
    assert "[ship]" in problem or "ship.contraction_percent" in problem


def test_blank_is_no_ship(tmp_path):
    job = load(write_folder(tmp_path / "job", job_parts(kind="mesh", mesh=b"solid")))
    assert job.ship is None


def test_a_workbook_gives_the_same_ship(tmp_path):
    """Lists of a workbook are texts with semicolons between, one number stands for itself."""
    folder = load(write_folder(tmp_path / "job", job_parts(kind="mesh", mesh=b"s", settings=SHIP)))
    texts = {
        "ship.trim_m": "2; -1; 0",
        "ship.list_deg": "0; 1.5",
        "ship.pipe_bottom_m": "-5.5; -2.5; 0",
        "ship.pipe_top_m": "-5.5; -2.5; 6",
    }
    parts = job_parts(kind="mesh", mesh=b"s", settings=SHIP | texts)
    assert load(write_book(tmp_path / "job.xlsx", parts)).ship == folder.ship
