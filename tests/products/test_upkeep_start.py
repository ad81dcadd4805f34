"""Upkeep that begins with a foreign table, a drawing, or no calibration.

Kind of truth: closed forms; simulation by tanks and years that are not the model.
"""

import json
import shutil

import numpy as np
import pytest
from conftest import EXAMPLE
from example_logs import Station, TrueTank, write_station
from station_years import BASE_C, EXPANSION

from tankcal import cli
from tankcal.products.quantity.table import read_table
from tankcal.products.upkeep.causes import PRIORS, Operation
from tankcal.products.upkeep.start import DRAWING, LyingStock, estimate_sizes
from tankcal.products.upkeep.steps import Marks, Steps
from tankcal.tank.heads import End
from tankcal.tank.solids import LyingTank

SIZES = {"diameter_m": 2.5, "length_m": 5.7, "end": "ellipsoidal", "end_depth_m": 0.35}
METERS = "meter,factor,u_factor_ppm,certificate\n" + "".join(
    f"{name},1,300,C-{name}\n" for name in "1234"
)


def make_stock(**sizes):
    drawing = dict.fromkeys((field.name for field in DRAWING), None) | SIZES | sizes
    return LyingStock(drawing, EXPANSION, BASE_C)


def test_columns_are_differences_of_exact_tanks():
    """Each column is the change of the volume by a standard deviation of its size."""
    stock = make_stock(tilt_mm_per_m=8.0, dip_from_a_m=1.0)
    end, level = End("ellipsoidal", 0.35), np.array([0.4, 1.25, 2.0])
    exact = LyingTank(2.5, 2.5, 5.7, end, end, 0.008, dip_from_a_m=1.0)
    np.testing.assert_allclose(stock.volume_m3(level, stock.at), exact.volume_m3(level), rtol=1e-6)
    for name, moved in (
        ("diameter", LyingTank(2.525, 2.525, 5.7, end, end, 0.008, dip_from_a_m=1.0)),
        ("tilt", LyingTank(2.5, 2.5, 5.7, end, end, 0.023, dip_from_a_m=1.0)),
    ):
        place = stock.names.index(name)
        half = stock.moved_to(0.5 * np.eye(len(stock.names))[place])
        change = moved.volume_m3(level) - exact.volume_m3(level)
        column = half.columns(level, half.at)[:, place]
        np.testing.assert_allclose(column, change, rtol=3e-4, atol=2e-4)
    other = stock.columns(level, stock.at)[:, stock.names.index("end_form")]
    spherical = End("spherical", 0.35)
    swapped = LyingTank(2.5, 2.5, 5.7, spherical, spherical, 0.008, dip_from_a_m=1.0)
    expected = 0.7 * (swapped.volume_m3(level) - exact.volume_m3(level))
    np.testing.assert_allclose(other, expected, rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [0.06, -0.04])
def test_two_tilts_are_both_stated(tilt):
    """A gauge at mid-length does not show the sign of a tilt: both are minima, and stated."""
    rng, end = np.random.default_rng(3), End("ellipsoidal", 0.35)
    tank = LyingTank(2.5, 2.5, 5.7, end, end, tilt, dip_from_a_m=2.85)
    sold = np.tile(np.repeat([0.4, -0.4], 60), 5)
    inside = 27.0 - np.append(0.0, np.cumsum(sold))
    grid = np.linspace(0.0, 2.49, 2001)
    read = np.interp(inside, tank.volume_m3(grid), grid) + 2e-4 * rng.normal(size=len(inside))
    count, blank = len(sold), np.full(len(sold), np.nan)
    none = np.zeros(count, dtype=int)
    marks = Marks(np.arange(count + 1) * 3600 * 10**9, read, np.zeros(count + 1),
                  np.full(count + 1, BASE_C))  # fmt: skip
    steps = Steps(marks, ("m",), sold[:, None], blank[:, None], np.zeros(count), blank, none, none)
    priors = dict.fromkeys(PRIORS["station"], 0.0) | {
        "gauge_wander_days": 5.0, "layer_h": 12.0, "meter_percent": 0.05, "level_mm": 0.2,
    }  # fmt: skip
    stock = make_stock(u_tilt_mm_per_m=40.0)
    _, _, solutions = estimate_sizes(Operation(stock, {}, priors), steps)
    tilts = [size for end in solutions for size in end.sizes if size.name == "tilt"]
    assert sorted(np.sign(size.estimate) for size in tilts) == [-1, 1]
    for size in tilts:
        assert abs(size.estimate) == pytest.approx(1000 * abs(tilt), abs=3 * size.u)
        assert size.u < 30  # of 40 before
    assert solutions[0].chi2 == 0
    assert solutions[1].chi2 < 1


# ---- the command


@pytest.fixture(scope="module")
def station(tmp_path_factory):
    """Folder of a station without calibration: a year, levels over half of the height."""
    folder = tmp_path_factory.mktemp("start") / "station"
    tank = TrueTank(radius=1.257, length=5.66, end=0.36)
    write_station(folder, Station(
        days=200, tank=tank, period_s=300.0, sales_a_day=110, low_m3=1.2, load_m3=25.0
    ).run(np.random.default_rng(3)))  # fmt: skip
    (folder / "meters.csv").write_text(METERS)
    settings = folder / "upkeep.toml"
    lines = "".join(f"{key} = {json.dumps(value)}\n" for key, value in SIZES.items())
    settings.write_text(f'{settings.read_text()}\n[drawing]\ntank = "S-1"\n{lines}')
    return folder, tank


@pytest.mark.slow
def test_table_from_sales(station, tmp_path, capsys):
    """From nothing: the delivery is within U, far below that of the drawing; stock control."""
    folder, tank = station
    out = tmp_path / "out"
    run = ["upkeep", str(folder), "--from", "nothing"]
    assert cli.main([*run, "--out", str(out), "--quiet"]) == 0
    shown = capsys.readouterr().out
    assert "stock control" in shown
    saved = json.loads((out / "upkeep.json").read_text())
    assert saved["k"] == pytest.approx(2, abs=1e-6)
    assert saved["start"]["kind"] == "sales"
    whole = saved["deliveries"][-1]
    error = whole["volume_m3"] - np.diff(tank.below([whole["low_m"], whole["high_m"]]))[0]
    assert abs(error) < whole["U_m3"] < 0.1 * whole["former_U_m3"]
    # Levels from below 15 % to above 85 % and traceable meters are needed for a certificate.
    reach = whole["low_m"] < 0.15 * 2.5 and whole["high_m"] > 0.85 * 2.5
    assert saved["start"]["is_stock_control"] == (not reach)
    assert len(saved["rows"]) == 501
    assert (out / "sizes.csv").is_file()
    assert cli.main(["verify", str(out), "--job", str(folder)]) == 0
    assert "all equal" in capsys.readouterr().out
    assert cli.main([*run, "--record", str(tmp_path / "new"), "--quiet"]) == 2
    assert "not improved" in capsys.readouterr().err
    for language, text in (("es", "control de existencias"), ("pt-BR", "controle de estoque")):
        assert cli.main([*run, "--language", language, "--quiet"]) == 0
        assert text in capsys.readouterr().out


@pytest.mark.slow
def test_untraceable_or_narrow_is_for_stock_control(station, tmp_path, capsys):
    folder = tmp_path / "station"
    shutil.copytree(station[0], folder)
    (folder / "meters.csv").unlink()
    assert cli.main(["upkeep", str(folder), "--from", "nothing", "--json"]) == 0
    saved = json.loads(capsys.readouterr().out)
    assert saved["start"]["is_stock_control"]
    assert "stock_meter" in saved["reasons"]


def write_table(folder, facts):
    """Table of another laboratory, every centimetre to the litre, with a former.toml."""
    dips = np.arange(0.0, 2.501, 0.01)
    volumes = make_stock().volume_m3(dips, np.zeros(7))
    rows = [f"{dip:.2f},{1000 * volume:.0f}" for dip, volume in zip(dips, volumes, strict=True)]
    folder.mkdir()
    (folder / "old.csv").write_text("\n".join(["dip (m),volume (L)", *rows]) + "\n")
    (folder / "former.toml").write_text(
        f'[former]\nfile = "old.csv"\nkind = "horizontal"\nreference_temperature_c = 15\n{facts}'
    )
    return folder


@pytest.mark.slow
def test_table_of_another_laboratory(station, tmp_path, capsys):
    """A foreign table with U 0.4 % improves, its record is computed again bit by bit."""
    folder, tank = tmp_path / "station", station[1]
    shutil.copytree(station[0], folder)
    table = write_table(tmp_path / "old", "U_percent = 0.4\nk = 2\n")
    run = ["upkeep", str(folder), "--from", str(table / "former.toml")]
    assert cli.main([*run, "--record", str(tmp_path / "new"), "--json"]) == 0
    saved = json.loads(capsys.readouterr().out)
    assert (saved["start"]["kind"], saved["mode"]) == ("table", "improved")
    top = saved["rows"][-1]
    assert top["former_U_m3"] == pytest.approx(0.004 * top["former_m3"], rel=0.05)
    assert {"../old/former.toml", "../old/old.csv"} <= {file["file"] for file in saved["files"]}
    whole = saved["deliveries"][-1]
    error = whole["volume_m3"] - np.diff(tank.below([whole["low_m"], whole["high_m"]]))[0]
    assert abs(error) < whole["U_m3"] < whole["former_U_m3"]
    assert read_table(tmp_path / "new" / "record.json").volume_m3[100] == pytest.approx(
        saved["rows"][100]["volume_m3"], rel=1e-12
    )
    assert cli.main(["verify", str(tmp_path / "new"), "--job", str(folder)]) == 0
    assert "identical bit for bit" in capsys.readouterr().out


@pytest.mark.slow
def test_drawing_as_a_job(station, tmp_path, capsys):
    """The sizes of a job without survey are the start: contents are not stated."""
    job = tmp_path / "drawing"
    shutil.copytree(EXAMPLE.parent / "liquid-lying", job)
    for name in ("liquid.csv", "meters.toml"):
        (job / name).unlink()
    settings = job / "job.toml"
    text = settings.read_text()
    text = text[: text.index("[liquid]")] + text[text.index("[certificate]") :]
    for old, new in (("2.4", "2.5"), ("= 9.0", "= 5.7"), ("0.48", "0.35"), ("= 1.5", "= 2.85"),
                     ("44.0", "31.0")):  # fmt: skip
        text = text.replace(old, new)
    settings.write_text(text)
    assert cli.main(["upkeep", str(station[0]), "--from", str(job), "--json"]) == 0
    saved = json.loads(capsys.readouterr().out)
    assert (saved["start"]["kind"], saved["mode"]) == ("drawing", "deliveries")
    assert saved["rows"] == []


@pytest.mark.slow
@pytest.mark.parametrize("language", ["en", "es", "pt-BR"])
def test_bad_start_is_one_line(tmp_path, capsys, language):
    folder = tmp_path / "station"
    folder.mkdir()
    (folder / "upkeep.toml").write_text(
        f'[upkeep]\ntimezone = "UTC"\nservice = "station"\nlanguage = "{language}"\n'
        "[liquid]\nexpansion_per_k = 0.001\nbase_c = 15\n[gauge]\nresolution_mm = 0.1\n"
        '[levels]\nfiles = ["a.csv"]\n[meters]\nfiles = ["b.csv"]\n'
        '[drawing]\nend = "conical"\ndip_from_a_m = 2\n'
    )
    (folder / "a.csv").write_text("time,level_mm\n")
    (folder / "b.csv").write_text("time,volume_l\n")
    table = write_table(tmp_path / "old", "")
    run = ["upkeep", str(folder), "--quiet", "--language", language]
    for more, count, text in (
        ([], 1, "upkeep.record"),
        (["--from", "elsewhere.csv"], 1, "elsewhere.csv"),
        (["--from", "nothing"], 3, "drawing.end_depth_m"),
        (["--from", str(table / "former.toml")], 1, "U_percent"),
    ):
        assert cli.main([*run, *more]) == 2
        lines = capsys.readouterr().err.strip().splitlines()
        assert len([line for line in lines if text.partition(".")[0] in line]) == count
        assert any(text in line for line in lines)
        assert "Traceback" not in "".join(lines)
