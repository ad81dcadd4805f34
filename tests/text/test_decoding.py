"""Texts of other programs: byte order marks and UTF-16 make no difference, whatever reads them."""

import codecs
import json

import pytest
from conftest import EXAMPLE

import tankcal
from tankcal.cli import main
from tankcal.products.desk.draft import Draft
from tankcal.text.delimited import decode_text, find_encoding, read_json

FORMER = """
[former]
file = "former.csv"
date = 1995-01-01
U_percent = 0.2
k = 2
reference_temperature_c = 20
height_unit = "m"
volume_unit = "m3"
"""
ENCODED = {
    "plain": lambda text: text.encode(),
    "UTF-8 with mark": lambda text: codecs.BOM_UTF8 + text.encode(),
    "UTF-16": lambda text: text.encode("utf-16"),
    "UTF-16 big, no mark": lambda text: text.encode("utf-16-be"),
}


@pytest.fixture(params=ENCODED)
def encode(request):
    return ENCODED[request.param]


def test_encodings_are_recognised(encode):
    assert decode_text(encode("a,b\nção\n")) == "a,b\nção\n"


def test_short_texts_are_utf8():
    assert [find_encoding(one) for one in (b"", b"a", b"a,", b"a,b")] == ["utf-8"] * 4


def test_json_is_read(tmp_path, encode):
    (tmp_path / "a.json").write_bytes(encode(json.dumps({"a": [1, "ç"]})))
    assert read_json(tmp_path / "a.json") == {"a": [1, "ç"]}


def test_a_job_is_the_same(tmp_path, encode):
    """Settings and tables of the example, each file encoded anew."""
    for path in EXAMPLE.iterdir():
        if path.suffix in (".toml", ".csv"):
            (tmp_path / path.name).write_bytes(encode(path.read_text(encoding="utf-8")))
    job, other = tankcal.load(tmp_path), tankcal.load(EXAMPLE)
    assert (job.points.xyz_m == other.points.xyz_m).all()
    assert job.tank == other.tank


@pytest.mark.slow
def test_a_former_table_is_read_by_history_and_compare(tmp_path, capsys, example_record, encode):
    table = "height_m,volume_m3\n" + "".join(f"{k / 10:.1f},{13.2 * k:.3f}\n" for k in range(95))
    (tmp_path / "former.csv").write_bytes(encode(table))
    (tmp_path / "former.toml").write_bytes(encode(FORMER))
    for command in ("history", "compare"):
        status = main([command, str(tmp_path / "former.toml"), str(example_record)])
        said = "".join(capsys.readouterr())
        assert status == 0, said
        assert "Traceback" not in said


def test_a_draft_names_a_key_that_is_given_twice(tmp_path):
    for path in EXAMPLE.iterdir():
        if path.suffix in (".toml", ".csv"):
            (tmp_path / path.name).write_bytes(path.read_bytes())
    settings = tmp_path / "job.toml"
    settings.write_text(settings.read_text().replace("[tank]", '[tank]\nid = "twice"', 1))
    (problem,) = [one for one in Draft(tmp_path).unreadable if one.file == "job.toml"]
    assert "given twice" in problem.text
