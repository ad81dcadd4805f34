"""Refusals and statements of an upkeep on what everyday data cannot determine, by the command.

Kind of truth: logs of simulated stations, in which the reason of each refusal is planted.
"""

import json
import shutil

import numpy as np
import openpyxl
import pytest
from conftest import EXAMPLE
from example_logs import Station, TrueTank, write_station
from test_upkeep_start import SIZES

from tankcal import cli
from tankcal.products.quantity.table import read_table
from tankcal.products.upkeep.levels import LevelSums

LANGUAGES = ("en", "es", "pt-BR")
LOGS = ("levels.csv", "meters.csv.log", "deliveries.csv")
DAY = "2025-02-05"  # the thirtieth day of a station, on which its faults begin
MOVING = {"sales_a_day": 120, "low_m3": 6.0, "load_m3": 24.0}  # levels over half of the height


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    place = tmp_path_factory.mktemp("former") / "rings"
    shutil.copytree(EXAMPLE.parent / "rings", place)
    assert cli.main(["run", str(place), "--no-papers", "--quiet"]) == 0
    return place / "results" / "record.json"


def write_logs(folder, record, **values):
    """Folder of a station of 60 days with the tank of a record."""
    tank = TrueTank()
    tank.grid, tank.volume = (read_table(record).height_m, read_table(record).volume_m3)
    data = Station(days=60, tank=tank, period_s=300.0, **MOVING, **values).run(
        np.random.default_rng(7))  # fmt: skip
    write_station(folder, data)
    shutil.copy(record, folder)
    return folder


@pytest.fixture(scope="module")
def station(record, tmp_path_factory):
    return write_logs(tmp_path_factory.mktemp("refusals") / "station", record)


@pytest.fixture
def folder(station, tmp_path):
    """A copy of the station whose files may be changed."""
    return shutil.copytree(station, tmp_path / "station")


def change_rows(folder, name, change):
    """Replace each row of a log by `change` of its cells; None: without the row."""
    heading, *lines = (folder / name).read_text().splitlines()
    rows = [change(line.split(",")) for line in lines]
    rows = [",".join(map(str, row)) for row in rows if row is not None]
    (folder / name).write_text("\n".join([heading, *rows, ""]))


def declare_event(folder, row, heading="time,kind,meter"):
    (folder / "events.csv").write_text(f"{heading}\n{row}\n")
    with open(folder / "upkeep.toml", "a") as stream:
        stream.write('\n[events]\nfiles = ["events.csv"]\n')


def run(capsys, folder, *options, status=0):
    """Text of a run in each language, and its saved upkeep (None: refused)."""
    shown = []
    for language in LANGUAGES:
        command = ["upkeep", str(folder), "--quiet", "--language", language, *options]
        assert cli.main(command) == status
        output = capsys.readouterr()
        shown.append(output.out + output.err)
        assert "Traceback" not in shown[-1]
    if status:
        return shown, None
    assert cli.main(["upkeep", str(folder), "--json", *options]) == 0
    return shown, json.loads(capsys.readouterr().out)


def read_result(out):
    """Text of the first sheet of the workbook."""
    sheet = openpyxl.load_workbook(out / "upkeep.xlsx").worksheets[0]
    return " ".join(str(cell.value) for row in sheet.iter_rows() for cell in row)


def hold(shown, *texts):
    """Whether the output in each language contains its text."""
    return all(text in output for text, output in zip(texts, shown, strict=True))


@pytest.mark.slow
def test_without_a_traceable_meter_the_scale_is_the_former(capsys, folder):
    """Meters that are all 1 % wrong do not move the scale of the table by more than its U."""
    change_rows(folder, "meters.csv.log", lambda row: [*row[:3], 1.01 * float(row[3])])
    shown, saved = run(capsys, folder)
    assert hold(shown, "the scale is that of the former table", "la escala es la de la tabla",
                "a escala é a da tabela anterior")  # fmt: skip
    assert saved["mode"] == "improved"
    whole = saved["deliveries"][-1]
    assert abs(whole["volume_m3"] - whole["former_m3"]) < whole["former_U_m3"]
    for meter in saved["meters"]:
        assert meter["certificate"] is None
        assert abs(meter["deviation_percent"] + 1) < 1.5 * meter["U_percent"]


@pytest.mark.slow
def test_causes_proportional_to_throughput_are_a_sum(capsys, folder, tmp_path):
    """All meters 0.6 % wrong from a day on: a cause with its five names, also on the report."""
    change_rows(folder, "meters.csv.log", lambda row: [
        *row[:3], float(row[3]) * (1.006 if row[0] >= DAY else 1)])  # fmt: skip
    out = tmp_path / "out"
    shown, saved = run(capsys, folder, "--out", str(out))
    assert hold(shown, "all meters, vapour, temperature at the meters, scale of",
                "todos los medidores, vapor, temperatura en los medidores, escala",
                "todos os medidores, vapor, temperatura nos medidores, escala")  # fmt: skip
    assert "throughput" in [row["kind"] for row in saved["watch"]["suspects"] if row["is_possible"]]
    assert "data determine their sum only" in read_result(out)


@pytest.mark.slow
def test_zero_of_the_gauge_is_not_determined(capsys, folder, record):
    """A gauge that is 5 mm high throughout shows no alarm; its zero keeps the u of its prior."""
    few = lambda row: row if row[0] < "2025-01-26" else None  # noqa: E731
    for name in LOGS:
        change_rows(folder, name, few)
    change_rows(folder, "levels.csv", lambda row: [row[0], f"{float(row[1]) + 5:.2f}"])
    shown, saved = run(capsys, folder)
    assert hold(shown, "do not determine the zero of the gauge", "no determinan el cero",
                "não determinam o zero")  # fmt: skip
    zero = next(cause for cause in saved["causes"] if cause["name"] == "gauge_zero")
    assert zero["u"] > 0.9 * zero["prior_u"]
    assert saved["watch"]["alarm"] is None


@pytest.mark.slow
def test_tilt_zero_and_roll_are_not_separable(capsys, folder):
    """Without a calibration and with a gauge near an end: the correlation of tilt with zero."""
    lines = "".join(f"{key} = {json.dumps(value)}\n" for key, value in SIZES.items())
    with open(folder / "upkeep.toml", "a") as stream:
        stream.write(f"\n[drawing]\n{lines}dip_from_a_m = 1.0\n")
    shown, saved = run(capsys, folder, "--from", "nothing")
    r = saved["start"]["solutions"][0]["correlation"][-1][-2]
    assert abs(r) > 0.5
    assert hold(shown, f"r = {r:.2f}), and no level shows the sign of a roll",
                "muestra el signo de un giro", "o sinal de uma rotação")  # fmt: skip


@pytest.mark.slow
def test_few_steps_are_refused(capsys, folder, tmp_path):
    """124 steps: watched, and no new record."""
    for name in LOGS:
        change_rows(folder, name, lambda row: row if row[0] < "2025-01-20" else None)
    shown, saved = run(capsys, folder)
    assert saved["mode"] == "watched"
    texts = "fewer than 200 steps", "menos de 200 pasos", "menos de 200 passos"
    assert hold(shown, *texts)
    shown, _ = run(capsys, folder, "--record", str(tmp_path / "new"), status=2)
    assert hold(shown, *texts)
    assert all(len(output.strip().splitlines()) == 1 for output in shown)


@pytest.mark.slow
def test_small_range_of_levels_is_refused(capsys, record, tmp_path):
    """Levels over less than a third of the height: watched, and no new record."""
    values = {"low_m3": 14.0, "load_m3": 6.0}
    tank = TrueTank()
    tank.grid, tank.volume = (read_table(record).height_m, read_table(record).volume_m3)
    station = Station(days=60, tank=tank, period_s=300.0, sales_a_day=120, **values)
    folder = tmp_path / "narrow"
    write_station(folder, station.run(np.random.default_rng(7)))
    shutil.copy(record, folder)
    shown, saved = run(capsys, folder)
    assert saved["mode"] == "watched"
    assert saved["period"]["used"] >= 200
    texts = (
        "less than a third of the height",
        "menos de un tercio de la altura",
        "menos de um terço",
    )
    assert hold(shown, *texts)
    shown, _ = run(capsys, folder, "--record", str(tmp_path / "new"), status=2)
    assert hold(shown, *texts)


def compress(folder, decimals):
    """Levels as a historian with a deviation of 3 mm exports them: interpolated, then rounded."""
    heading, *lines = (folder / "levels.csv").read_text().splitlines()
    level = np.array([float(line.split(",")[1]) for line in lines])
    kept = [0]
    for place in range(1, len(level)):
        if abs(level[place] - level[kept[-1]]) > 3.0:
            kept += [place - 1, place] if kept[-1] < place - 1 else [place]
    kept.append(len(level) - 1)
    lines_of = np.interp(np.arange(len(level)), kept, level[kept])
    rows = [f"{line.split(',')[0]},{value:.{decimals}f}"
            for line, value in zip(lines, lines_of, strict=True)]  # fmt: skip
    (folder / "levels.csv").write_text("\n".join([heading, *rows, ""]))


@pytest.mark.slow
@pytest.mark.parametrize("decimals", [9, 3, 2, 1])
def test_levels_of_a_historian_are_refused(capsys, folder, decimals):
    """Interpolations, rounded to any digit. They would seem to be a leak of 3 L/h."""
    compress(folder, decimals)
    shown, _ = run(capsys, folder, status=2)
    assert hold(shown, "on sloping lines of a historian", "de un historiador que interpola",
                "de um historiador que interpola")  # fmt: skip


@pytest.mark.parametrize(("leak_mm_h", "noise", "expected"), [(0.3, 0.02, 0.0), (0.0, 0.1, 0.0),
                                                             (None, 0.0, 1.0)])  # fmt: skip
def test_a_leak_is_no_interpolation(leak_mm_h, noise, expected):
    """Nights with equal slopes are a leak; nights with unequal slopes are interpolations."""
    rng, hour = np.random.default_rng(1), 3600 * 10**9
    start = 24 * hour * np.arange(30)
    windows = np.stack([start, start + 8 * hour], axis=1)
    sums = LevelSums(windows, 1e-4, [], lambda level: 14 * level)
    sums._lines = []
    for night in range(30):
        time = start[night] + 300 * 10**9 * np.arange(96)
        slope = rng.uniform(0.15, 0.5) if leak_mm_h is None else leak_mm_h
        level = 1200 - 20 * night - slope * np.arange(96) / 12 + noise * rng.normal(size=96)
        sums._test_rests(time, np.round(level, 1) / 1000, 1e-3)
    sums.slopes = sums._lines
    assert sums.interpolated_share() == expected


@pytest.mark.slow
def test_changed_product_gives_the_gauge_a_new_offset(capsys, folder):
    """A float that reads 3 mm more in another product: alarm, or with the event an offset."""
    change_rows(folder, "levels.csv", lambda row: [
        row[0], f"{float(row[1]) + 3 * (row[0] >= DAY):.2f}"])  # fmt: skip
    shown, saved = run(capsys, folder)
    assert saved["watch"]["alarm"] is not None
    assert hold(shown, "declare an event gauge_set", "un evento gauge_set", "um evento gauge_set")
    declare_event(folder, f"{DAY}T00:00:00,product_changed,")
    shown, saved = run(capsys, folder)
    assert hold(shown, "events.csv: the product changed", "el producto cambió",
                "o produto mudou")  # fmt: skip
    assert saved["watch"]["alarm"] is None
    offset = next(cause for cause in saved["causes"] if cause["name"] == f"gauge_offset {DAY}")
    assert offset["u"] < 0.5 * offset["prior_u"]
    assert abs(offset["estimate"] - 3) < 2 * offset["u"]


@pytest.mark.slow
def test_adjusted_meter_is_found_and_begins_anew(capsys, folder):
    """A meter that is adjusted by 1 % without an event is named; with it, it is two meters."""
    change_rows(folder, "meters.csv.log", lambda row: [
        *row[:3], float(row[3]) * (1.01 if row[0] >= DAY and row[2] == "1" else 1)])  # fmt: skip
    shown, saved = run(capsys, folder)
    possible = [row for row in saved["watch"]["suspects"] if row["is_possible"]]
    assert [(row["kind"], row["member"]) for row in possible] == [("meter", "1")]
    assert hold(shown, "declare an event adjusted", "un evento adjusted", "um evento adjusted")
    declare_event(folder, f"{DAY}T00:00:00,adjusted,1")
    _, saved = run(capsys, folder)
    assert saved["watch"]["alarm"] is None
    assert saved["mode"] == "improved"
    before, after = (next(meter for meter in saved["meters"] if meter["name"] == name)
                     for name in ("1", f"1 {DAY}"))  # fmt: skip
    change = after["deviation_percent"] - before["deviation_percent"]
    assert change == pytest.approx(-1.0, abs=0.25)


@pytest.mark.parametrize("language", LANGUAGES)
def test_missing_time_zone_is_refused(capsys, tmp_path, language):
    """Local times without a declared zone: one line with the key and the remedy."""
    (tmp_path / "upkeep.toml").write_text(
        '[upkeep]\nrecord = "record.json"\nservice = "station"\n[liquid]\nexpansion_per_k = 0\n'
        'base_c = 15\n[gauge]\nresolution_mm = 0.1\n[levels]\nfiles = ["a.csv"]\n'
        '[meters]\nfiles = ["b.csv"]\n'
    )
    assert cli.main(["upkeep", str(tmp_path), "--language", language]) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "upkeep.toml" in line]
    expected = {"en": "America/Sao_Paulo", "es": "America/Bogota", "pt-BR": "America/Sao_Paulo"}
    assert "upkeep.timezone" in line
    assert expected[language] in line


EMPTY = ("the file is empty", "el archivo está vacío", "o arquivo está vazio")
NO_VALUES = ("no row has a valid time and value", "ninguna fila tiene hora y valor válidos",
             "nenhuma linha tem horário e valor válidos")  # fmt: skip
LINES = {  # file: bad content, and where and how its line begins in each language
    "record.json": ("", ("record.json: cannot", "record.json: no se", "record.json: não")),
    "meters.csv": ("", ("meters.csv: empty", "meters.csv: vacío", "meters.csv: vazio")),
    "meters.log": ("", [f"meters.log: {text}" for text in EMPTY]),
    "deliveries.log": (" \n\n", [f"deliveries.log: {text}" for text in EMPTY]),
    "levels.log": ("time,level\n", ("levels.log, row 1: no column level_mm",
                                    "levels.log, fila 1: sin columna level_mm",
                                    "levels.log, linha 1: sem coluna level_mm")),
    "events.log": ("time,kind\n2025-02-01T00:00:00,moved\n", (
        "events.log, row 2, kind", "events.log, fila 2, kind", "events.log, linha 2, kind")),
}  # fmt: skip


@pytest.mark.parametrize(("place", "language"), [*enumerate(LANGUAGES)])
def test_problems_of_all_files_are_named_in_a_run(capsys, tmp_path, place, language):
    """A line for each planted fault, and no other; an empty log is called empty, not a copy."""
    kinds = ("levels", "meters", "deliveries", "events")
    (tmp_path / "upkeep.toml").write_text(
        '[upkeep]\nrecord = "record.json"\ntimezone = "UTC"\nservice = "station"\n[liquid]\n'
        "expansion_per_k = 0\nbase_c = 15\n[gauge]\nresolution_mm = 0.1\n"
        + "".join(f'[{kind}]\nfiles = ["{kind}.log"]\n' for kind in kinds)
    )
    for name, (content, _) in LINES.items():
        (tmp_path / name).write_text(content)
    assert cli.main(["upkeep", str(tmp_path), "--quiet", "--language", language]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == len(LINES)
    for _, texts in LINES.values():
        assert sum(f"tankcal: {texts[place]}" in line for line in lines) == 1


@pytest.mark.slow
@pytest.mark.parametrize("name", ["levels.csv", "air.csv"])
def test_a_log_with_headings_only_is_refused(capsys, folder, name):
    """No level, or no temperature of the air, although a log of it is declared."""
    heading = {"levels.csv": "time,level_mm", "air.csv": "time,temperature_c"}[name]
    (folder / name).write_text(f"{heading}\n")
    with open(folder / "upkeep.toml", "a") as stream:
        stream.write('\n[air]\nfiles = ["air.csv"]\n' if name == "air.csv" else "")
    shown, _ = run(capsys, folder, status=2)
    assert hold(shown, *(f"{name}: {text}" for text in NO_VALUES))


@pytest.mark.slow
def test_levels_are_checked_beside_meters_without_volume(capsys, folder):
    """The changed heading in the levels is named in the run that refuses the meters."""
    change_rows(folder, "meters.csv.log", lambda row: None)
    change_rows(folder, "levels.csv", lambda row: row if row[0] < DAY else ["time", "temperature"])
    shown, _ = run(capsys, folder, status=2)
    assert hold(shown, "no metered volume", "sin volumen medido", "sem volume medido")
    assert hold(shown, "the heading changes to", "el encabezado cambia a",
                "o cabeçalho muda para")  # fmt: skip


@pytest.mark.slow
def test_leak_and_breathing_are_a_sum(capsys, record, tmp_path):
    """A loss of 0.8 L/h is stated as a leak or another loss by time, with the season in words."""
    folder = write_logs(tmp_path / "station", record, fault="leak", fault_day=30.0, fault_size=0.8)
    out = tmp_path / "out"
    shown, saved = run(capsys, folder, "--out", str(out))
    assert hold(shown, "leak or another loss by time", "fuga u otra pérdida por tiempo",
                "vazamento ou outra perda no tempo")  # fmt: skip
    assert saved["months"][-1]["leak_l_h"] == pytest.approx(0.8, abs=saved["months"][-1]["U_l_h"])
    assert "Breathing follows the seasons" in read_result(out)


@pytest.mark.slow
def test_water_that_comes_in_is_a_gain(capsys, record, tmp_path):
    """Water of 0.8 L/h: a gain, and with a water float its rise and litres."""
    folder = write_logs(tmp_path / "station", record, fault="leak", fault_day=30.0, fault_size=-0.8)
    shown, saved = run(capsys, folder)
    assert hold(shown, "such as water that comes in", "agua que entra", "água que entra")
    assert [row["kind"] for row in saved["watch"]["suspects"] if row["is_possible"]] == ["gain"]
    assert saved["months"][-1]["verdict"] == "gain"
    table = read_table(record)

    def add_water(row):
        hours = (np.datetime64(row[0]) - np.datetime64(DAY)).astype(float) / 3600
        inside = 0.05 + 0.8e-3 * max(hours, 0)
        return [*row, round(1000 * float(np.interp(inside, table.volume_m3, table.height_m)))]

    change_rows(folder, "levels.csv", add_water)
    path = folder / "levels.csv"
    path.write_text(path.read_text().replace("level_mm", "level_mm,water_mm", 1))
    shown, _ = run(capsys, folder)
    assert hold(shown, "the water rose by", "el agua subió", "a água subiu")
    litres = float(shown[0].partition("the water rose by")[2].partition("(")[2].partition(" L")[0])
    assert litres == pytest.approx(0.8 * 24 * 29.5, rel=0.03)
