"""Privacy and integrity of everyday data: what is kept, and what shows that a log was altered.

Kind of truth: closed form; every file is written here, with known contents.
"""

import json
import re
import shutil
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from example_logs import Station, TrueTank, write_station
from station_years import HEIGHTS_M, NOMINAL, make_table
from test_upkeep_logs import counts, open_log, read_all
from test_upkeep_start import METERS, SIZES

from tankcal import cli
from tankcal.job.tables import Log
from tankcal.products.upkeep import logs
from tankcal.products.upkeep.flows import read_flows
from tankcal.products.upkeep.own_table import compare_own_volumes

CARD, PLATE = "4000123412341234", "BRA2E19"


@pytest.fixture(scope="module")
def station(tmp_path_factory):
    """Two months of a station from its sales, with cards and plates in the log of the meters."""
    folder = tmp_path_factory.mktemp("integrity") / "station"
    write_station(folder, Station(days=50, tank=TrueTank(), period_s=300.0).run(
        np.random.default_rng(5)))  # fmt: skip
    path = folder / "meters.csv.log"
    heading, *rows = path.read_text().splitlines()
    rows = [f"{row},{CARD},{PLATE}" for row in rows]
    path.write_text("\n".join([f"{heading},card,plate", *rows]) + "\n")
    (folder / "meters.csv").write_text(METERS)
    settings = folder / "upkeep.toml"
    lines = "".join(f"{key} = {json.dumps(value)}\n" for key, value in SIZES.items())
    settings.write_text(f"{settings.read_text()}\n[drawing]\n{lines}")
    return folder


def contents_of(folder):
    """Bytes of all files of a folder, those inside workbooks and states included."""
    for path in sorted(folder.rglob("*")):
        if path.suffix in (".xlsx", ".npz"):
            with zipfile.ZipFile(path) as archive:
                yield from ((path.name, archive.read(name)) for name in archive.namelist())
        elif path.is_file():
            yield path.name, path.read_bytes()


@pytest.mark.slow
def test_no_card_and_no_time_of_a_sale_leaves_the_folder(station, tmp_path):
    """All results and the state: no card, no plate; no time is finer than an hour."""
    out, state = tmp_path / "out", tmp_path / "state"
    run = ["upkeep", str(station), "--from", "nothing", "--out", str(out), "--state", str(state)]
    assert cli.main([*run, "--quiet"]) == 0
    found = list(contents_of(tmp_path))
    assert len(found) > 20
    for name, content in found:
        assert CARD.encode() not in content, name
        assert PLATE.encode() not in content, name
        if name.endswith((".json", ".csv")):
            assert not re.search(rb"\dT\d\d:\d\d", content), name
    saved = json.loads((out / "upkeep.json").read_text())
    assert "steps" not in set(saved) - {"period"}
    files = {file["file"]: file for file in saved["files"]}
    levels = (station / "levels.csv").read_text().splitlines()[1:]
    assert files["levels.csv"]["rows"] == len(levels)
    assert files["levels.csv"]["first"] == levels[0][:13]
    assert files["levels.csv"]["last"] == levels[-1][:13]
    assert files["upkeep.toml"]["rows"] is None
    # With kept sums, the files are described alike.
    assert cli.main([*run, "--quiet"]) == 0
    assert json.loads((out / "upkeep.json").read_text()) == saved


def test_columns_without_a_profile_are_not_read(tmp_path):
    """No chunk has a column that the profile does not name."""
    text = f"time,level_mm,card,attendant\n2025-01-01T00:00:00,1000,{CARD},Ana\n"
    table = read_all(open_log(tmp_path, text))
    assert set(table) == {"time", "level", "row"}
    assert CARD not in str(table)


@pytest.mark.slow
def test_a_removed_month_shows_in_the_chain(station, tmp_path, capsys):
    """Chains are equal up to the removed log, and differ from there on."""
    chains = []
    for name, removed in (("whole", None), ("less", "2025-02")):
        folder = tmp_path / name
        shutil.copytree(station, folder)
        heading, *rows = (folder / "levels.csv").read_text().splitlines()
        (folder / "levels.csv").unlink()
        for month in ("2025-01", "2025-02"):
            if month != removed:
                part = [row for row in rows if row.startswith(month)]
                (folder / f"levels-{month}.csv").write_text("\n".join([heading, *part]) + "\n")
        settings = folder / "upkeep.toml"
        settings.write_text(settings.read_text().replace("levels.csv", "levels-*.csv"))
        capsys.readouterr()
        assert cli.main(["upkeep", str(folder), "--from", "nothing", "--json"]) == 0
        files = json.loads(capsys.readouterr().out)["files"]
        chains.append({file["file"]: file["chain"] for file in files})
    whole, less = chains
    place = list(whole).index("levels-2025-02.csv")
    assert list(less) == [name for name in whole if name != "levels-2025-02.csv"]
    assert list(whole.values())[:place] == list(less.values())[:place]
    assert not set(list(whole.values())[place:]) & set(list(less.values())[place:])


def test_a_removed_transaction_shows_in_the_totals(tmp_path):
    """The counter rises by two transactions where the log has one."""
    totals = np.cumsum([30.0, 20.0, 45.0, 10.0, 25.0])
    rows = [
        f"2025-06-02T0{i}:10:00,2025-06-02T0{i}:00:00,1,{total},{volume}"
        for i, (total, volume) in enumerate(zip(totals, (30, 20, 45, 10, 25), strict=True))
    ]
    heading = "time,begin,meter,total_l,volume_l\n"
    whole = open_log(tmp_path, heading + "\n".join(rows) + "\n", "meters")
    read_flows([whole])
    assert "total_unlike_sum" not in counts(whole)
    less = open_log(tmp_path, heading + "\n".join(rows[:2] + rows[3:]) + "\n", "meters")
    read_flows([less])
    assert counts(less)["total_unlike_sum"] == 1


@pytest.mark.parametrize("declared", [False, True])
def test_a_changed_table_of_the_gauge_is_found(tmp_path, declared):
    """From day 20 on, the gauge states 1 % more at equal levels; noise alone is no change."""
    rng, table = np.random.default_rng(2), make_table()
    time = np.arange(40 * 48) * 1800
    level = 1.2 + 0.3 * np.sin(time / 50000) + 1e-4 * rng.normal(size=len(time))
    volume = 1000 * np.interp(level, HEIGHTS_M, NOMINAL.below(HEIGHTS_M)) * 1.003
    stamps = np.datetime64("2025-01-01", "s") + time
    for changed in (False, True):
        stated = np.where(changed & (time >= 20 * 86400), 1.01, 1.0) * volume
        rows = "".join(f"{stamp},{1000 * h:.1f},{v:.0f}\n"
                       for stamp, h, v in zip(stamps, level, stated, strict=True))  # fmt: skip
        file, log = open_log(tmp_path, "time,level_mm,volume_l\n" + rows), Log()
        events = [{"kind": "table_changed"}] if declared else []
        compare_own_volumes(file, table, file.findings, events, log)
        assert len(log.warnings) == (changed and not declared)
        if log.warnings:
            assert log.warnings[0].expected.values["day"] == "2025-01-21"
            assert counts(file)["table_changed"] == 20


def test_too_large_logs_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(logs, "MOST_LOG_BYTES", 10)
    file = open_log(tmp_path, "time,level_mm\n2025-01-01T00:00:00,1000\n")
    assert list(file.chunks()) == []
    assert len(file.log.problems) == 1


def test_workbooks_and_pickles_are_not_opened(tmp_path):
    """A workbook with macros or a pickle is no text: one problem, and nothing of it runs."""
    pickle = b"\x80\x04cposix\nsystem\n(S'touch hacked'\ntR."
    for content in (pickle, b"PK\x03\x04" + bytes(range(256)) * 4):
        file = open_log(tmp_path, content)
        assert list(file.chunks()) == []
        assert len(file.log.problems) == 1
    assert not (tmp_path / "hacked").exists()
    damaged = replace(open_log(tmp_path, ""), path=tmp_path / "none.csv")
    assert list(damaged.chunks()) == []
