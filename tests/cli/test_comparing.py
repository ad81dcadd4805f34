"""`tankcal compare` as a user calls it."""

import json
from pathlib import Path

import numpy as np
import pytest
from tables_of_s1 import former_s1, new_s1

from tankcal.cli import main
from tankcal.record.recalibration import COMPARISON


@pytest.fixture
def tables(tmp_path):
    """Paths of old.csv and new.csv: rows of 5 cm in litres."""
    dips = np.round(np.arange(0.10, 8.395, 0.05), 3)
    paths = []
    for name, table in (("old", former_s1(dips)), ("new", new_s1(dips))):
        rows = zip(table.height_m, table.volume_m3, strict=True)
        lines = [f"{dip:.2f},{volume:.3f}" for dip, volume in rows]
        paths.append(tmp_path / f"{name}.csv")
        paths[-1].write_text("\n".join(["dip_m,volume_m3", *lines]), encoding="utf-8")
    return [str(path) for path in paths]


def test_two_tables_alone(tables, capsys):
    """Nothing is declared: it is said what was not done, and U is not known."""
    assert main(["compare", *tables, "--quiet"]) == 0
    said = capsys.readouterr()
    assert "old.csv compared with new.csv: 165 rows from 0.1 to 8.3 m" in said.out
    assert "temperature 0.000" in said.out
    for word in ("former.reference_temperature_c", "former.liquid_density_kg_m3", "U of one"):
        assert word in said.out


def test_for_programs(tables, capsys):
    assert main(["compare", *tables, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found.pop("exit_status") == 0
    assert COMPARISON.migrated(found, "out") == found


@pytest.mark.parametrize(("language", "word"), [("pt-BR", "veredito"), ("es", "veredicto")])
def test_in_other_languages(tables, capsys, language, word):
    assert main(["compare", *tables, "--quiet", "--language", language]) == 0
    said = capsys.readouterr()
    assert f"{word}: " in said.out
    assert "Franç" in said.out or "Francia" in said.out
    assert "0,000" in said.out


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--rule", "france_2021"], "--rule: found 'france_2021'; expected a .toml file there"),
        (["--rule", "nowhere.toml"], "--rule: no such file"),
        (["--courses", "nowhere.csv"], "nowhere.csv: not found; expected a file"),
        (["--former", "nowhere.toml"], "nowhere.toml: not found; expected a file"),
    ],
)
def test_input_to_be_mended(tables, capsys, more, words):
    assert main(["compare", *tables, *more, "--quiet"]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("junk", ["", "x", "height_m,volume_m3\n", "\0" * 50, "{}", "[1"])
def test_what_is_no_table(tables, capsys, junk, tmp_path):
    pdf = ("junk.pdf",) if junk == "x" else ()  # a child looks at each
    for name in ("junk.csv", "junk.json", "junk.xlsx", "junk.toml", *pdf):
        path = tmp_path / name
        path.write_text(junk, encoding="utf-8")
        assert main(["compare", str(path), tables[1], "--quiet"]) == 2
        assert main(["compare", tables[0], str(path), "--quiet"]) == 2
    assert "tankcal: " in capsys.readouterr().err


def test_no_such_file(tables, capsys):
    assert main(["compare", "nowhere.csv", tables[1]]) == 2
    assert "nowhere.csv" in capsys.readouterr().err


@pytest.mark.slow
def test_papers_all_or_nothing(tables, tmp_path, capsys):
    out = tmp_path / "comparison"
    assert main(["compare", *tables, "--out", str(out), "--quiet"]) == 0
    saved = (out / "comparison.json").read_bytes()
    assert COMPARISON.version_of(json.loads(saved)) == 1
    assert (out / "comparison.pdf").read_bytes().startswith(b"%PDF")
    assert main(["compare", tables[0], "nowhere.csv", "--out", str(out), "--quiet"]) == 2
    assert (out / "comparison.json").read_bytes() == saved


def test_a_folder_of_somebody_else(tables, tmp_path, capsys):
    other = tmp_path / "mine"
    other.mkdir()
    Path(other, "letter.txt").write_text("dear", encoding="utf-8")
    assert main(["compare", *tables, "--out", str(other), "--quiet"]) == 2
    assert "letter.txt" in capsys.readouterr().err
