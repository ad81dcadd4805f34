"""job.toml and lists under edit: one value changes, comments, order and spaces of all else stay."""

import tomllib
from pathlib import Path

import pytest
import tomlkit

from tankcal.job.fields import Field
from tankcal.products.desk.keys import EditedKeys, Entry, toml_value
from tankcal.products.desk.tables import AmbiguousNumber

EXAMPLES = Path(__file__).parents[2] / "examples"
SETTINGS = (EXAMPLES / "silva-1995" / "job.toml").read_text(encoding="utf-8")
INSTRUMENTS = (EXAMPLES / "total-station" / "instruments.toml").read_text(encoding="utf-8")


def settings(text=SETTINGS):
    return EditedKeys("job", "job.toml", text)


def changed_lines(text, before=SETTINGS):
    return [line for line in text.splitlines() if line not in before.splitlines()]


def test_every_value_of_an_example_is_listed():
    entries = settings().entries
    assert entries[:3] == [
        Entry("tank", "id", "SILVA-1995"),
        Entry("tank", "kind", "vertical"),
        Entry("tank", "nominal_diameter_m", "13.0"),
    ]
    assert Entry("survey", "date", "1995-06-30") in entries
    assert len(entries) == sum(map(len, tomllib.loads(SETTINGS).values()))


@pytest.mark.parametrize(
    ("owner", "key", "text", "line"),
    [
        ("tank", "nominal_height_m", "9.75", "nominal_height_m = 9.75             # published"),
        ("survey", "date", "1995-07-01", "date = 1995-07-01                  # invented"),
        ("survey", "shell_temperature_c", "warm", 'shell_temperature_c = "warm"         # inve'),
        ("tank", "owner", "", 'owner = ""'),
        ("tank", "year", "1990", 'year = "1990"'),
    ],
)
def test_one_line_changes_and_its_comment_stays(owner, key, text, line):
    made = settings().set_value(owner, key, text)
    (changed,) = changed_lines(made.text)
    assert changed.startswith(line)
    assert dict(tomllib.loads(made.text)[owner])[key] != tomllib.loads(SETTINGS)[owner].get(key)


def test_same_value_again_changes_nothing():
    assert settings().set_value("tank", "nominal_height_m", "9.5").text == SETTINGS
    assert settings().set_value("roof", "mass_kg", "").text == SETTINGS  # blank, and not there


def test_a_section_that_is_not_there_is_made():
    made = (
        settings().set_value("roof", "mass_kg", "9000").set_value("adjustment.camera", "K3", "off")
    )
    read = tomllib.loads(made.text)
    assert read["roof"] == {"mass_kg": 9000}
    assert read["adjustment"] == {"camera": {"K3": "off"}}
    assert made.text.startswith(SETTINGS)


def test_lists_of_numbers_stay_lists():
    text = "[table]\nfine_zones = [[0, 0.3], [2.1, 2.4]] # low\nminimum_delivery_m = [1.5, 2]\n"
    read = settings(text)
    assert [one.text for one in read.entries] == ["0-0.3; 2.1-2.4", "1.5; 2"]
    made = read.set_value("table", "fine_zones", "0-0.5").set_value(
        "table", "minimum_delivery_m", "3"
    )
    assert tomllib.loads(made.text)["table"] == {
        "fine_zones": [[0.0, 0.5]], "minimum_delivery_m": [3.0],
    }  # fmt: skip
    assert "# low" in made.text


def test_instruments_are_listed_by_name():
    read = EditedKeys("instruments", "instruments.toml", INSTRUMENTS)
    owner, key = read.entries[0].owner, read.entries[0].key
    assert (owner, key) == ("TS", "kind")
    made = read.set_value("TS", "u_scale_ppm", "2").set_value("New one", "kind", "edm")
    assert tomllib.loads(made.text)["instruments"]["New one"] == {"kind": "edm"}
    assert changed_lines(made.text, INSTRUMENTS)[0] == "u_scale_ppm = 2"


def test_marks_of_a_camera_are_a_section_within_it():
    text = "[cameras.C]\nc_mm = 50.0\n[cameras.C.marks]\n1 = [-83.01, 0.02]\n"
    read = EditedKeys("cameras", "cameras.toml", text)
    assert read.entries[-1] == Entry("C", "marks.1", "-83.01; 0.02")
    made = read.set_value("C", "marks.1", "-83.02; 0")
    assert tomllib.loads(made.text)["cameras"]["C"]["marks"]["1"] == [-83.02, 0.0]


def test_what_is_not_told_apart_is_not_written():
    made = settings().set_value("tank", "nominal_height_m", AmbiguousNumber("9.500"))
    assert tomllib.loads(made.text)["tank"]["nominal_height_m"] == ""
    assert Entry("tank", "nominal_height_m", "9.500") in made.entries
    mended = made.set_value("tank", "nominal_height_m", "9.6")
    assert mended.ambiguous == {}
    assert tomllib.loads(mended.text)["tank"]["nominal_height_m"] == 9.6


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        ("number", "1e-5", 1e-5), ("number", "5.", 5.0), ("number", "007", 7.0),
        ("number", "1,5", "1,5"), ("flag", "True", True), ("flag", "sim", "sim"),
        ("date", "2024-02-30", "2024-02-30"), ("text", "12", "12"), ("numbers", "1; 2", "1; 2"),
    ],
)  # fmt: skip
def test_texts_become_values(kind, text, value):
    found = toml_value(Field("a", kind, ""), text)
    read = tomllib.loads(tomlkit.dumps({"a": found}))["a"]
    assert read == value
    assert type(read) is type(value)
