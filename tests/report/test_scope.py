"""Scope of a laboratory: CMC in the letterhead, refusal of a smaller U, mark only inside it."""

import json

import pytest
from conftest import EXAMPLE

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.report.laboratory import (
    LETTERHEAD_FILE,
    find_capability,
    is_outside_scope,
    letterhead_in_scope,
    load,
    read_saved,
)
from tankcal.report.verified_again import letterhead_of

LABORATORY = '[laboratory]\nname = "Metrolab"\naccreditation_place = true\n'
SCOPE = """
[cmc.small]
tanks = ["vertical"]
to_m3 = 100
percent = 0.3

[cmc.large]
tanks = ["vertical", "horizontal"]
from_m3 = 100
percent = {percent}
"""


def write(folder, text):
    path = folder / "lab.toml"
    path.write_text(LABORATORY + text, encoding="utf-8")
    return path


def record_of(kind, capacity_m3):
    return {"job": {"tank": {"kind": kind}}, "capacity": {"volume_m3": [0.0, capacity_m3]}}


@pytest.mark.parametrize(
    ("kind", "capacity_m3", "percent"),
    [
        ("vertical", 50.0, 0.3),
        ("vertical", 100.0, 0.1),  # both entries apply: the smaller uncertainty
        ("vertical", 1e5, 0.1),
        ("horizontal", 50.0, None),
        ("sphere", 5000.0, None),
    ],
)
def test_the_entry_of_a_tank(kind, capacity_m3, percent, tmp_path):
    letterhead = load(write(tmp_path, SCOPE.format(percent=0.1))).data()
    record = record_of(kind, capacity_m3)
    capability = find_capability(letterhead, record)
    assert (capability and capability["percent"]) == percent
    assert is_outside_scope(letterhead, record) == (percent is None)
    assert bool(letterhead_in_scope(letterhead, record)["mark"]) == (percent is not None)


def test_a_letterhead_without_scope_is_not_limited(tmp_path):
    letterhead = load(write(tmp_path, "")).data()
    assert "cmc" not in letterhead
    assert not is_outside_scope(letterhead, record_of("sphere", 1.0))
    assert letterhead_in_scope(letterhead, record_of("sphere", 1.0)) == letterhead
    assert not is_outside_scope(None, record_of("sphere", 1.0))


def test_a_scope_comes_back_as_it_was_saved(tmp_path):
    letterhead = load(write(tmp_path, SCOPE.format(percent=0.1)))
    letterhead.save(tmp_path)
    assert letterhead_of(tmp_path) == letterhead
    saved = json.loads((tmp_path / LETTERHEAD_FILE).read_text(encoding="utf-8"))
    del saved["cmc"][0]["percent"]
    (tmp_path / LETTERHEAD_FILE).write_text(json.dumps(saved), encoding="utf-8")
    with pytest.raises(InputError, match="percent"):
        read_saved(tmp_path / LETTERHEAD_FILE)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ('[cmc.a]\ntanks = ["cone"]\npercent = 0.1\n', "cmc.a.tanks: found 'cone'"),
        ('[cmc.a]\ntanks = ["vertical"]\n', "cmc.a.percent"),
        ('[cmc.a]\ntanks = ["vertical"]\npercent = -1\n', "cmc.a.percent"),
        ("[cmc]\npercent = 0.1\n", "[cmc]: unknown section"),
    ],
)
def test_a_mistake_in_the_scope_is_one_line(text, place, tmp_path):
    with pytest.raises(InputError) as refused:
        load(write(tmp_path, text))
    [line] = str(refused.value).splitlines()
    assert place in line


@pytest.mark.slow
def test_no_certificate_states_less_than_the_cmc(tmp_path, capsys):
    """The example has U = 0.12 % of the capacity."""
    out, command = tmp_path / "out", ["run", str(EXAMPLE), "--quiet", "--out"]
    lab = write(tmp_path, SCOPE.format(percent=0.05))
    assert main([*command, str(out), "--letterhead", str(lab)]) == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    assert b"CMC" in before["report.html"]
    lab = write(tmp_path, SCOPE.format(percent=0.2))
    capsys.readouterr()
    assert main([*command, str(out), "--letterhead", str(lab)]) == 2
    refusals = [line for line in capsys.readouterr().err.splitlines() if "CMC" in line]
    assert len(refusals) == 1
    assert "0.12 %, below the CMC of 0.2 %" in refusals[0]
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
