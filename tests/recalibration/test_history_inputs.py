"""What `tankcal history` finds in an archive, what it leaves out, and what it refuses."""

import gzip
import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from tables_of_s1 import former_s1

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.products.recalibration.history import _worst_checks, find_files, history_of_files
from tankcal.record.recalibration import HISTORY

RECORDS = Path(__file__).parents[1] / "records" / "1"
EXAMPLE = Path(__file__).parents[2] / "examples" / "inspection"


def keep(folder, date="2024-05-31", kind="cluttered", factor=1.0, **tank):
    """A kept record in a folder, of another day, its volumes times a factor."""
    record = json.loads(gzip.decompress((RECORDS / f"{kind}.json.gz").read_bytes()))
    record["job"]["survey"]["date"] = date
    record["job"]["tank"] |= tank
    if record["capacity"]:
        volumes = [factor * one for one in record["capacity"]["volume_m3"]]
        record["capacity"]["volume_m3"] = volumes
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "record.json"
    path.write_text(json.dumps(record, ensure_ascii=False), encoding="utf-8")
    return path


@pytest.fixture
def archive(tmp_path):
    """Three certificates of T-1, one of T-2."""
    keep(tmp_path / "a" / "2014" / "T-1", "2014-05-31")
    keep(tmp_path / "a" / "2019" / "T-1", "2019-05-31", factor=1.0001)
    keep(tmp_path / "a" / "2024" / "T-1", "2024-05-31", factor=1.0003)
    keep(tmp_path / "a" / "2024" / "T-2", "2024-06-30", id="T-2")
    return tmp_path / "a"


def codes(problems):
    return [one.expected.code for one in problems]


def refused(*arguments, **options):
    with pytest.raises(InputError) as told:
        history_of_files(*arguments, **options)
    return codes(told.value.problems)


@pytest.mark.slow
def test_the_certificates_of_one_tank_of_an_archive(archive):
    found = history_of_files([archive], tanks=["T-1"])
    assert [one.date for one in found.certificates] == ["2014-05-31", "2019-05-31", "2024-05-31"]
    assert found.certificates[0].file == "2014/T-1/record.json"
    assert found.certificates[0].tankcal == "0.1.0"
    top = found.certificates[0].top_volume_m3
    assert found.changes[0].top_d_m3 == pytest.approx(1e-4 * top, rel=1e-9)
    assert len(found.radii) == 3 * 5
    radius = {(one.certificate, one.course): one.radius_m for one in found.radii}
    assert radius[2, 3] / radius[1, 3] - 1 == pytest.approx(5e-5, rel=1e-2)


@pytest.mark.slow
def test_an_archive_of_several_tanks_asks_which(archive):
    assert refused([archive]) == ["history_several_tanks"]


@pytest.mark.slow
def test_a_tank_with_two_names_is_one_when_asked(archive):
    found = history_of_files([archive], tanks=["T-1", "T-2"])
    assert len(found.certificates) == 4
    assert "history_other_id" in [one.code for one in found.warnings]


@pytest.mark.slow
def test_what_has_no_place_in_a_history_is_said(archive):
    one = archive / "2014" / "T-1"
    shutil.copytree(one, archive / "copies" / "es")
    keep(archive / "undated", "spring 1987")
    keep(archive / "survey", kind="survey")
    (archive / "other").mkdir()
    (archive / "other" / "record.json").write_text('{"tank": "T-1"}', encoding="utf-8")
    found = history_of_files([archive], tanks=["T-1"])
    left = {one.file: one.code for one in found.left_out}
    assert left == {
        "copies/es/record.json": "history_same_file",
        "undated/record.json": "history_no_date",
        "survey/record.json": "history_only_survey",
        "other/record.json": "history_not_ours",
    }
    assert len(found.certificates) == 3


def test_every_file_that_cannot_be_read_is_told(archive):
    for folder, text in (("x", '{"id": "T-1", '), ("y", '{"format": "tankcal-record/1", "T-1": 1}'),
                         ("z", '{"format": "tankcal-record/99", "id": "T-1"}')):  # fmt: skip
        (archive / folder).mkdir()
        (archive / folder / "record.json").write_text(text, encoding="utf-8")
    found = refused([archive], tanks=["T-1"])
    assert found[0] == "history_no_json"
    assert len(found) == 3


def test_a_file_cut_off_before_its_tank_is_said(archive):
    (archive / "cut").mkdir()
    (archive / "cut" / "record.json").write_text('{"format": "tankcal-rec', encoding="utf-8")
    assert "history_cut_off" in refused([archive], tanks=["T-9"])


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_loops_of_links_and_pipes_end(archive):
    (archive / "2014" / "loop").symlink_to(archive, target_is_directory=True)
    (archive / "2014" / "gone").symlink_to(archive / "nowhere")
    os.mkfifo(archive / "2014" / "inspection.json")
    (archive / ".hidden").mkdir()
    keep(archive / ".hidden" / "T-1")
    assert [name for _, name, _ in find_files([archive])] == [
        "2014/T-1/record.json", "2019/T-1/record.json", "2024/T-1/record.json",
        "2024/T-2/record.json",
    ]  # fmt: skip


def test_files_of_one_name_are_told_apart(archive):
    given = [archive / "2014", archive / "2014", archive / "2019" / "T-1" / "record.json"]
    names = [(name, sought) for _, name, sought in find_files(given)]
    assert names == [("2014/T-1/record.json", True), ("2019/T-1/record.json", False)]


@pytest.mark.slow
def test_a_former_table_stands_in_the_row(tmp_path):
    """By a former.toml with its date; its rows are those of another laboratory."""
    table = former_s1(np.round(np.arange(0.10, 8.405, 0.05), 3))
    rows = [f"{a:.2f},{b:.3f}" for a, b in zip(table.height_m, table.volume_m3, strict=True)]
    (tmp_path / "old.csv").write_text("\n".join(["dip_m,volume_m3", *rows]), encoding="utf-8")
    for name, date in (("one", "2004-05-01"), ("two", "2014-05-20")):
        text = f'[former]\nfile = "old.csv"\ndate = "{date}"\nkind = "vertical"\n'
        (tmp_path / f"{name}.toml").write_text(
            text + f"U_percent = 0.1\nk = 2.0\nnumber = '{name}'\n"
        )
    found = history_of_files([tmp_path / "one.toml"], courses=None)
    assert [one.number for one in found.certificates] == ["one"]
    assert found.certificates[0].origin == "table"


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lying", "uncertain", "furnished", "photographed"])
def test_every_kind_of_tank_has_a_history(tmp_path, kind):
    """A record and the same one of another day: nothing has changed."""
    keep(tmp_path / "1", "2004-05-31", kind)
    keep(tmp_path / "2", "2014-05-31", kind)
    found = history_of_files([tmp_path])
    assert found.changes[0].top_d_m3 == 0.0
    assert found.changes[0].worst_E_n in (0.0, None)
    assert bool(found.radii) == (kind in ("furnished", "photographed"))


def test_nothing_to_show_says_what_was_found(tmp_path):
    keep(tmp_path / "s", kind="survey")
    assert refused([tmp_path]) == ["history_no_table", "history_only_survey"]
    assert refused([tmp_path / "nowhere", tmp_path / "gone"]) == ["history_nothing_there"] * 2
    assert refused([tmp_path], courses=tmp_path / "none.csv") == ["read_no_file"]


# ---- as a user calls it


@pytest.mark.slow
def test_the_terminal_tells_the_row(archive, capsys):
    assert main(["history", str(archive), "--tank", "T-1", "--quiet"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "T-1: 3 certificates, 2014-05-31 to 2024-05-31"
    assert lines[1].startswith("  1  2014-05-31  ")
    assert lines[4].startswith("  1 to 2: +")
    assert main(["history", str(archive), "--tank", "T-1", "--quiet", "--language", "pt-BR"]) == 0
    assert capsys.readouterr().out.startswith("T-1: 3 certificados, de 2014-05-31")


@pytest.mark.slow
def test_for_programs(archive, capsys):
    assert main(["history", str(archive), "--tank", "T-1", "--json", "--at", "2,4.5"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found.pop("exit_status") == 0
    assert HISTORY.migrated(found, "out") == found
    assert found["dips_m"] == pytest.approx([2.0, 4.5])
    assert main(["history", str(archive), "--json"]) == 2
    assert json.loads(capsys.readouterr().out)["problems"][0]["code"] == "history_several_tanks"


@pytest.mark.parametrize("dips", ["x", "1,,2", "-1", "nan", "1;2", ""])
def test_dips_that_are_none_are_refused(archive, dips, capsys):
    with pytest.raises(SystemExit) as end:
        main(["history", str(archive), f"--at={dips}"])
    assert end.value.code == 2
    assert "expected dips in metres" in capsys.readouterr().err


@pytest.mark.slow(after=2)
@pytest.mark.parametrize("column", ["volume_m3", "stated_U_m3", "k", "factor_m3"])
def test_columns_of_unequal_length_are_told(archive, column):
    path = archive / "2019" / "T-1" / "record.json"
    record = json.loads(path.read_text(encoding="utf-8"))
    record["capacity"][column] = []
    path.write_text(json.dumps(record), encoding="utf-8")
    with pytest.raises(InputError) as told:
        history_of_files([archive], tanks=["T-1"])
    told_as = column.removesuffix("_m3") if column == "factor_m3" else column
    assert any(f"capacity.{told_as}" in str(one) or column == "volume_m3"
               for one in told.value.problems)  # fmt: skip
    assert all(one.file == "2019/T-1/record.json" for one in told.value.problems)


def test_what_could_not_be_judged_hides_behind_nothing_that_passed():
    """Property: of several places of a check the history shows the gravest verdict."""
    limit = {"value": 10.0}
    found = [
        {
            "code": "peaking",
            "unit": "mm",
            "value": value,
            "U": 1.0,
            "limit": limit,
            "verdict": verdict,
        }
        for value, verdict in ((3.0, "passed"), (None, "not_determined"), (8.0, "passed"))
    ]
    assert [one.verdict for one in _worst_checks(found)] == ["not_determined"]
    failed = found[0] | {"value": 12.0, "verdict": "failed"}
    (worst,) = _worst_checks([*found, failed])
    assert (worst.value, worst.verdict) == (12.0, "failed")
    (worst,) = _worst_checks([found[0], found[2]])
    assert worst.value == 8.0
