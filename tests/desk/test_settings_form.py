"""Form of the settings, states of a job, new and recent jobs."""

import shutil
import tomllib
import zipfile
from io import BytesIO
from pathlib import Path

import pytest
from job_builder import write_job

from tankcal.errors import InputError
from tankcal.job.contract import KEYS
from tankcal.products.desk.desk import Desk
from tankcal.products.desk.display import Group, Reader, form_of
from tankcal.products.desk.draft import Draft
from tankcal.products.desk.jobs import (
    RecentJobs,
    State,
    copy_job,
    create_job,
    folder_name,
    pack,
    state_of,
)
from tankcal.text.words import load_words

ROOT = Path(__file__).parents[2]


def form(folder, language="pt-BR"):
    desk = Desk(Draft.open(folder), folder / "results", Reader(language))
    return {field.name: field for field in form_of(desk)}


@pytest.fixture
def folder(tmp_path):
    return write_job(tmp_path / "job", rings=2)


def test_a_field_has_label_unit_kind_and_value(folder):
    fields = form(folder)
    diameter = fields["tank.nominal_diameter_m"]
    assert (diameter.label, diameter.unit, diameter.entry) == ("Diâmetro nominal", "m", "number")
    side = fields["survey.side"]
    assert side.entry == "choice"
    assert dict(side.choices) == {"outside": "fora", "inside": "dentro"}
    assert side.is_required
    assert side.group is Group.NEEDED
    assert fields["certificate.number"].is_asked
    assert fields["certificate.number"].group is Group.CERTIFICATE
    assert fields["tank.owner"].group is Group.CERTIFICATE
    assert fields["table.monte_carlo"].entry == "flag"
    assert fields["table.monte_carlo"].group is Group.EXPERT
    assert "horizontal.length_m" not in fields  # another kind of tank
    assert "liquid.run_ppm" not in fields  # no metered liquid
    assert "adjustment.camera.K1" not in fields  # no photographs
    assert "csv.decimal" not in fields


def test_a_setting_with_a_problem_is_in_sight(folder):
    desk = Desk(Draft.open(folder), folder / "results", Reader("es"))
    desk.enter("job", "table", "coverage_probability", "2")
    field = next(one for one in form_of(desk) if one.name == "table.coverage_probability")
    assert field.group is Group.NEEDED
    assert field.level == "bad"
    assert "se espera" in field.problem
    assert field.value == "2"


def test_each_setting_has_a_short_label_in_each_language():
    expected = {
        f"{section}.{field.name}"
        for section, fields in KEYS.items()
        if section not in ("csv", "adjustment.camera")
        for field in fields
    } | {"adjustment.camera.default"}
    for language in ("en", "pt-BR", "es"):
        labels = load_words(language)["desk"]["labels"]
        assert set(labels) == expected
        assert all(0 < len(label) <= 50 for label in labels.values())


def test_the_state_follows_from_the_files(folder, tmp_path):
    assert state_of(folder).state is State.READY
    text = (folder / "points.csv").read_text()
    (folder / "points.csv").write_text(text.replace("\n", "\nX,a,b,c,,,\n", 2))
    state = state_of(folder)
    assert state.state is State.DRAFT
    assert state.problems >= 3
    assert state_of(tmp_path / "nothing").state is State.GONE


def test_results_are_computed_or_stale(folder):
    import hashlib
    import json

    out = folder / "results"
    out.mkdir()
    files = [
        {
            "file": path.name,
            "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
            "bytes": path.stat().st_size,
        }
        for path in folder.glob("*.*")
    ]
    (out / "record.json").write_text(json.dumps({"files": files}))
    assert state_of(folder).state is State.COMPUTED
    path = folder / "points.csv"
    path.write_text(path.read_text().replace("1", "2", 1))  # the size remains
    assert state_of(folder).state is State.STALE
    path.unlink()
    assert state_of(folder).state is State.STALE
    (out / "record.json").write_text("{")
    assert state_of(folder).state is State.DRAFT


@pytest.mark.slow
def test_a_new_job_has_a_folder_of_its_own(tmp_path):
    first = create_job(tmp_path, "TQ/21", "vertical", None, "pt-BR")
    second = create_job(tmp_path, "TQ/21", "horizontal", "strapping", "es")
    assert [first.name, second.name] == ["TQ-21", "TQ-21-2"]
    assert tomllib.loads((first / "job.toml").read_text())["tank"]["id"] == "TQ-21"
    with pytest.raises(InputError):
        create_job(tmp_path, "X", "mesh", "strapping", "en")
    assert not (tmp_path / "X").exists()


@pytest.mark.parametrize(
    ("tank", "name"),
    [
        ("TQ 21", "TQ-21"),
        ("../../etc/passwd", "etc-passwd"),
        ("CON", "tank-CON"),
        ("..", "tank"),
        ("a" * 300, "a" * 60),
        ("água", "água"),
        ("a\0b\n", "a-b"),
    ],
)
def test_names_of_folders_are_harmless(tank, name):
    assert folder_name(tank) == name


def test_copies_leave_the_results_behind(folder, tmp_path):
    (folder / "results").mkdir()
    (folder / "results" / "record.json").write_text("{}")
    copied = copy_job(folder, tmp_path / "work", "T 2")
    names = {path.name for path in copied.iterdir()}
    assert names == {path.name for path in folder.iterdir()} - {"results"}
    archive = zipfile.ZipFile(BytesIO(pack(sorted(copied.iterdir()), copied)))
    assert set(archive.namelist()) == names


@pytest.mark.slow
def test_recent_jobs_are_listed_with_their_states(folder, tmp_path):
    recent = RecentJobs(tmp_path / "state")
    assert recent.list() == []
    other = tmp_path / "other"
    shutil.copytree(folder, other)
    recent.add(folder)
    recent.add(other)
    assert [(item.source.name, item.state.state) for item in recent.list()] == [
        ("other", State.READY),
        ("job", State.READY),
    ]
    shutil.rmtree(other)
    (folder / "courses.csv").unlink()
    listed = RecentJobs(tmp_path / "state").list()
    assert [item.state.state for item in listed] == [State.GONE, State.DRAFT]
    recent.remove(other.resolve())
    assert [item.source.name for item in recent.list()] == ["job"]
    recent.path.write_text("[")
    assert recent.list() == []
