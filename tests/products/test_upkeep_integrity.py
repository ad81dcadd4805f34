"""Privacy and integrity of everyday data: what is kept, and what shows that a log was altered.

Kind of truth: closed form; every file is written here, with known contents.
"""

import io
import json
import re
import shutil
import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import openpyxl
import pypdf
import pytest
from example_logs import Station, TrueTank, write_station
from station_years import HEIGHTS_M, NOMINAL, draw_year, make_table
from test_upkeep_filter import written_out
from test_upkeep_logs import counts, open_log, read_all
from test_upkeep_start import METERS, SIZES

from tankcal import cli
from tankcal.job.tables import Log
from tankcal.products.upkeep import logs
from tankcal.products.upkeep.estimation import estimate
from tankcal.products.upkeep.flows import read_flows
from tankcal.products.upkeep.levels import compare_own_volumes
from tankcal.products.upkeep.paper import UpkeepPaper, pages
from tankcal.products.upkeep.upkeep import list_steps

CARD, PLATE = "4000123412341234", "BRA2E19"
PLACE = ("-23.550651", "-46.633382")  # latitude and longitude of a truck


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
    path = folder / "deliveries.csv"
    heading, *rows = path.read_text().splitlines()
    rows = [",".join([row, *PLACE]) for row in rows]
    path.write_text("\n".join([f"{heading},latitude,longitude", *rows]) + "\n")
    (folder / "meters.csv").write_text(METERS)
    settings = folder / "upkeep.toml"
    lines = "".join(f"{key} = {json.dumps(value)}\n" for key, value in SIZES.items())
    settings.write_text(f"{settings.read_text()}\n[drawing]\n{lines}")
    return folder


def contents_of(folder):
    """Bytes of all files of a folder: parts of workbooks and states, texts and streams of PDFs."""
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.suffix in (".xlsx", ".npz"):
            with zipfile.ZipFile(path) as archive:
                yield from ((f"{name}/{part}", archive.read(part)) for part in archive.namelist())
        elif path.is_file():
            yield name, path.read_bytes()
        if path.suffix == ".pdf":
            for attached, (content,) in pypdf.PdfReader(path).attachments.items():
                yield f"{name}/{attached}", content
            if shutil.which("pdftotext"):
                text = subprocess.run(["pdftotext", path, "-"], capture_output=True, check=True)
                yield f"{name} text", text.stdout


def numbers_in(name, content):
    """Whole numbers of a file, with which a time could be written."""
    if name.endswith(".npy"):
        return np.load(io.BytesIO(content), allow_pickle=False).ravel().tolist()
    return [int(text) for text in re.findall(rb"\d{9,19}", content)]


@pytest.mark.slow
def test_no_card_and_no_time_of_a_sale_leaves_the_folder(station, tmp_path, capsys):
    """Results, state, record and its reports, batch: no card, plate, place or time of a sale."""
    site = tmp_path / "site"
    shutil.copytree(station, site / "station")
    settings = site / "station" / "upkeep.toml"
    settings.write_text(settings.read_text().replace('"record.json"', '"nothing"'))
    kept = tmp_path / "kept"
    out, state = kept / "out", kept / "state"
    run = ["upkeep", str(site / "station"), "--out", str(out), "--state", str(state)]
    assert cli.main([*run, "--quiet"]) == 0
    batch = ["batch", str(site), "--do", "upkeep", "--out", str(kept / "batch"), "--workers", "0"]
    assert cli.main([*batch, "--quiet"]) == 0
    shown = capsys.readouterr()
    (kept / "shown").write_text(shown.out + shown.err)
    sales = [row.split(",")[:2] for row in
             (station / "meters.csv.log").read_text().splitlines()[1:]]  # fmt: skip
    times = np.array(sales, dtype="datetime64[s]").ravel()
    texts = {text[:16] for pair in sales for text in pair}
    seconds = {int(time) * size for time in times.astype(np.int64) for size in (1, 10**3, 10**9)}
    found = list(contents_of(kept))
    names = {Path(name.split(" ")[0]).suffix for name, _ in found}
    assert {".json", ".jsonl", ".csv", ".pdf", ".html", ".xml", ".npy"} <= names
    for name, content in found:
        for secret in (CARD, PLATE, *PLACE):
            assert secret.encode() not in content, name
        minutes = re.findall(rb"20\d\d-\d\d-\d\d[T ]\d\d:\d\d", content)
        assert not {text.decode().replace(" ", "T") for text in minutes} & texts, name
        assert not seconds.intersection(numbers_in(name, content)), name
        if name.startswith("out/") and name.endswith((".json", ".csv")):
            assert not re.search(rb"\dT\d\d:\d\d", content), name
    saved = json.loads((out / "upkeep.json").read_text())
    assert "steps" not in saved
    files = {file["file"]: file for file in saved["files"]}
    levels = (station / "levels.csv").read_text().splitlines()[1:]
    assert files["levels.csv"]["rows"] == len(levels)
    assert files["levels.csv"]["first"] == levels[0][:13]
    assert files["levels.csv"]["last"] == levels[-1][:13]
    assert files["upkeep.toml"]["rows"] is None
    # With kept sums, the files are described alike.
    assert cli.main([*run, "--quiet"]) == 0
    assert json.loads((out / "upkeep.json").read_text()) == saved


@pytest.mark.slow
def test_single_steps_only_on_demand(station, tmp_path, capsys):
    """Balance of each step against the logs; workbook, CSV file and a line on the report."""
    out = tmp_path / "out"
    run = ["upkeep", str(station), "--from", "nothing", "--out", str(out), "--steps", "--quiet"]
    assert cli.main(run) == 0
    saved = json.loads((out / "upkeep.json").read_text())
    steps = saved["steps"]
    assert len(steps) == saved["period"]["steps"]
    sales = [row.split(",") for row in (station / "meters.csv.log").read_text().splitlines()[1:]]
    for step in steps:
        litres = [float(row[3]) for row in sales if step["first"] < row[0] <= step["last"]]
        # Meters wear by 250 ppm a year as expected: 34 ppm in 50 days.
        assert -1e-12 <= step["by_meters_m3"] - sum(litres) / 1000 <= 35e-9 * sum(litres)
        total = step["by_tickets_m3"] - step["by_meters_m3"] - step["losses_m3"]
        assert abs(total - step["by_table_m3"] - step["misclosure_m3"]) < 1e-9
        assert (step["kind"] == "rest") == (not litres and not step["by_tickets_m3"])
        assert (step["w"] is None) == (step["left_out"] is not None)
    left_out = [step["left_out"] for step in steps if step["left_out"]]
    assert left_out.count("outlier") == saved["period"]["rejected"]
    # The drawing is wrong by far more than the levels, which u contains.
    ratio = [step["misclosure_m3"] / step["u_m3"] for step in steps]
    assert 0.05 < np.sqrt(np.mean(np.square(ratio))) < 1.5
    assert len((out / "steps.csv").read_text().splitlines()) == 1 + len(steps)
    book = openpyxl.load_workbook(out / "upkeep.xlsx")
    assert book["Steps"].max_row > len(steps)
    capsys.readouterr()
    assert cli.main(["verify", str(out), "--job", str(station), "--quiet"]) == 0
    for language in ("en", "es", "pt-BR"):
        paper = UpkeepPaper(saved, language)
        assert str(len(steps)) in paper.word("texts.single_steps", count=len(steps))
        shown = str([block.data for block in pages(paper)])
        assert paper.word("texts.single_steps", count=len(steps)) in shown
        assert paper.word("texts.privacy") not in shown


def test_uncertainty_of_single_steps():
    """u of each misclosure is that of the covariance written out, and its columns."""
    year = draw_year(np.random.default_rng(4), make_table(), days=20)
    estimation = estimate(year.operation, year.steps)
    steps = list_steps(year.operation, estimation)
    balance = year.operation.linearize(year.steps)
    covariance, _ = written_out(balance.drift)
    variance = np.diag(covariance) + np.sum(balance.columns_m3**2, axis=1)
    np.testing.assert_allclose([step.u_m3 for step in steps], np.sqrt(variance), rtol=1e-9)


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


@pytest.mark.slow
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
