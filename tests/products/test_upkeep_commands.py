"""`tankcal upkeep` on every format and defect of a log, in three languages.

Kind of truth: the same station in plain CSV files; every other file is written from them.
"""

import hashlib
import json
import shutil

import numpy as np
import pytest
from example_logs import Station, TrueTank, write_station
from test_upkeep_logs import floats, tls
from test_upkeep_start import METERS, SIZES

from tankcal import cli
from tankcal.products.upkeep.paper import UpkeepPaper, pages

LANGUAGES = ("en", "es", "pt-BR")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """Twelve days of a station in plain CSV files, and its saved upkeep."""
    folder = tmp_path_factory.mktemp("plain") / "station"
    data = Station(days=12, period_s=300.0, quantum=1e-4, low_m3=6.0).run(np.random.default_rng(9))
    write_station(folder, data)
    (folder / "meters.csv").write_text(METERS)
    settings = folder / "upkeep.toml"
    lines = "".join(f"{key} = {json.dumps(value)}\n" for key, value in SIZES.items())
    text = settings.read_text().replace('"record.json"', '"nothing"').replace("0.01", "0.1")
    settings.write_text(f"{text}\n[drawing]\n{lines}")
    return folder


@pytest.fixture
def station(plain, tmp_path):
    """Copy of the folder, to be changed."""
    return shutil.copytree(plain, tmp_path / "station")


def run(folder, capsys):
    """Saved upkeep of a folder."""
    capsys.readouterr()
    assert cli.main(["upkeep", str(folder), "--json"]) == 0, capsys.readouterr().err
    return json.loads(capsys.readouterr().out)


def refusals(folder, capsys):
    """Messages of a refusal in each language, which are a line each."""
    texts = []
    for language in LANGUAGES:
        capsys.readouterr()
        assert cli.main(["upkeep", str(folder), "--quiet", "--language", language]) == 2
        texts.append(capsys.readouterr().err.strip())
        assert "Traceback" not in texts[-1]
        assert all(line.startswith("tankcal: ") for line in texts[-1].splitlines())
    assert len(set(texts)) == len(LANGUAGES), "a language is missing"
    return texts


def rows_of(folder, name):
    """Cells of the rows of a log, without its heading."""
    return [line.split(",") for line in (folder / name).read_text().splitlines()[1:]]


def declare(folder, kind, profile):
    """Add a profile to the section of a log."""
    settings = folder / "upkeep.toml"
    text = settings.read_text().replace(f"[{kind}]\n", f'[{kind}]\nprofile = "{profile}"\n')
    settings.write_text(text)


# ---- formats


def write_inventory(folder):
    """Levels as captures of a console: two-digit years, minutes, one block spoilt."""
    blocks = []
    for time, level in rows_of(folder, "levels.csv"):
        stamp = time[2:16].translate(str.maketrans("", "", "-T:"))
        values = floats(9000.0, 9000.0, 0.0, float(level), 0.0, 15.0, 0.0)
        blocks.append(tls("20100", stamp, f"011000007{values}"))
    blocks.append(tls("20100", "2502010000", f"011000007{values}", spoil=True))
    (folder / "levels.csv").write_bytes(b"\r\n".join(blocks))
    declare(folder, "levels", "tls-inventory")


def write_deliveries(folder):
    """Tickets as captures of a console, from 5000 L on."""
    blocks = []
    for time, litres in rows_of(folder, "deliveries.csv"):
        end = time[2:16].translate(str.maketrans("", "", "-T:"))
        values = floats(5000, 0, 0, 15, 5000 + float(litres), 0, 0, 15, 0, 0)
        blocks.append(tls("20200", "2502010000", f"01101{end}{end}0A{values}"))
    (folder / "deliveries.csv").write_bytes(b"".join(blocks))
    declare(folder, "deliveries", "tls-delivery")


def write_course(folder):
    """Files of the course data: no heading, semicolons, decimal commas, running totals."""
    levels = [f"{time.replace('T', ' ')};;;1;{level.replace('.', ',')};0;15"
              for time, level in rows_of(folder, "levels.csv")]  # fmt: skip
    (folder / "levels.csv").write_text("\n".join(levels) + "\n")
    totals, lines = dict.fromkeys("1234", 0.0), []
    for time, begin, meter, litres in rows_of(folder, "meters.csv.log"):
        for moment, added in ((begin, 0.0), (time, float(litres))):
            totals[meter] += added
            total = f"{totals[meter]:.3f}".replace(".", ",")
            lines.append(f"{moment.replace('T', ' ')};;{meter};1;0;{total};1")
    (folder / "meters.csv.log").write_text("\n".join(sorted(lines)) + "\n")
    tickets = [f"{time.replace('T', ' ')};1;{litres.replace('.', ',')};333,33"
               for time, litres in rows_of(folder, "deliveries.csv")]  # fmt: skip
    (folder / "deliveries.csv").write_text("\n".join(tickets) + "\n")
    for kind in ("levels", "meters", "deliveries"):
        declare(folder, kind, f"course-{kind}")


def write_historian(folder):
    """Levels in long form with states in place of values."""
    (folder / "pi.toml").write_text(
        '[columns]\ntime = "Time"\ntag = "Tag"\nvalue = "Value"\nquality = "Status"\n'
        '[tags]\nlevel = "LT1"\n[units]\nlength = "m"\n[file]\nmissing = ["No Data"]\n'
        'good = ["Good"]\n'
    )
    lines = [f"{time},LT1,{float(level) / 1000:.4f},Good"
             for time, level in rows_of(folder, "levels.csv")]  # fmt: skip
    lines += ["2025-01-17T23:56:00,LT1,Bad Input,Good", "2025-01-17T23:57:00,LT1,1,Bad"]
    (folder / "levels.csv").write_text("\n".join(["Time,Tag,Value,Status", *lines]) + "\n")
    declare(folder, "levels", "pi.toml")


def write_truck(folder):
    """Tickets of a truck meter: totals at the begin and end, and a place that is not read."""
    (folder / "truck.toml").write_text(
        '[columns]\ntime = "Finish"\nvolume = "Gross"\n[units]\nvolume = "L"\n'
        '[file]\ntime_format = "%d/%m/%Y %H:%M:%S"\n'
    )
    lines = ["Finish,Latitude,Longitude,Gross,Net"]
    for time, litres in rows_of(folder, "deliveries.csv"):
        day, clock = time.split("T")
        lines.append(f"{'/'.join(reversed(day.split('-')))} {clock},-23.55,-46.63,{litres},0")
    (folder / "deliveries.csv").write_text("\n".join(lines) + "\n")
    declare(folder, "deliveries", "truck.toml")


@pytest.mark.parametrize(
    ("write", "found"),
    [
        (write_inventory, {"wrong_check_sum": 1}),
        (write_deliveries, {}),
        (write_course, {}),
        (write_historian, {"not_a_number": 1, "bad_quality": 1}),
        (write_truck, {}),
    ],
)
def test_formats_give_the_result_of_plain_files(plain, station, capsys, write, found):
    """The same steps, volumes and deliveries; each defect is counted by its word."""
    expected = run(plain, capsys)
    write(station)
    saved = run(station, capsys)
    for key in ("steps", "used", "lowest_m", "highest_m", "sold_m3", "delivered_m3"):
        assert saved["period"][key] == pytest.approx(expected["period"][key], rel=1e-6), key
    counted = {row["kind"]: row["count"] for row in saved["cleaning"]}
    assert {kind: counted.get(kind) for kind in found} == found
    for mine, other in zip(saved["deliveries"], expected["deliveries"], strict=True):
        assert mine["volume_m3"] == pytest.approx(other["volume_m3"], abs=0.1 * other["U_m3"])


# ---- defects that are counted


def change(folder, name, function):
    """Change the lines of a file."""
    lines = (folder / name).read_text().splitlines()
    (folder / name).write_text("\n".join(function(lines)) + "\n")


def swap(lines):
    return [*lines[:40], lines[41], lines[40], *lines[42:]]


def repeat(lines):
    return [*lines[:41], lines[40], *lines[41:]]


def contradict(lines):
    return [*lines[:41], lines[40].split(",")[0] + ",1.0", *lines[41:]]


def roll(folder, fall):
    """Meters as running totals that fall once: to 0 above 999 999 L, or as a reset."""
    start, lines = 998_700.0 if fall == "rollover" else 400_000.0, ["time,meter,total_l"]
    totals = dict.fromkeys("1234", start)
    for time, begin, meter, litres in rows_of(folder, "meters.csv.log"):
        for moment, added in ((begin, 0.0), (time, float(litres))):
            totals[meter] += added
            if fall == "rollover":
                totals[meter] %= 1e6
            elif totals[meter] > start + 1300:
                totals[meter] = 500.0
            lines.append(f"{moment},{meter},{totals[meter]:.3f}")
    (folder / "meters.csv.log").write_text("\n".join([lines[0], *sorted(lines[1:])]) + "\n")


DEFECTS = {
    "late": lambda folder: change(folder, "levels.csv", swap),
    "duplicate": lambda folder: change(folder, "levels.csv", repeat),
    "other_value": lambda folder: change(folder, "levels.csv", contradict),
    "no_time": lambda folder: change(folder, "levels.csv", lambda rows: [*rows, "soon,1000"]),
    "rollover": lambda folder: roll(folder, "rollover"),
    "reset": lambda folder: roll(folder, "reset"),
    "no_rise": lambda folder: change(
        folder, "deliveries.csv", lambda rows: [*rows, "2025-01-17T23:00:00,9000"]),
    "no_ticket": lambda folder: change(folder, "deliveries.csv", lambda rows: rows[:-1]),
    "no_volume": lambda folder: change(
        folder, "deliveries.csv", lambda rows: [*rows, "2025-01-17T23:00:00,"]),
}  # fmt: skip


@pytest.mark.parametrize("kind", DEFECTS)
def test_defects_have_a_word(station, capsys, kind):
    """A defect is counted, and the report names it in each language."""
    DEFECTS[kind](station)
    saved = run(station, capsys)
    rows = [row for row in saved["cleaning"] if row["kind"] == kind]
    assert sum(row["count"] for row in rows) >= 1
    words = {UpkeepPaper(saved, language).words["findings"][kind] for language in LANGUAGES}
    assert len(words) == len(LANGUAGES)


def test_doubled_hour_through_the_command(station, capsys):
    """Berlin, 26 October: with the times in order all rows are used, sorted they are counted."""
    settings = station / "upkeep.toml"
    settings.write_text(settings.read_text().replace('"UTC"', '"Europe/Berlin"'))
    shift = np.datetime64("2025-10-20") - np.datetime64("2025-01-06")
    for name in ("levels.csv", "meters.csv.log", "deliveries.csv"):
        lines = (station / name).read_text().splitlines()
        count = 2 if name == "meters.csv.log" else 1
        moved = [lines[0]]
        for line in lines[1:]:
            cells = line.split(",")
            for place in range(count):
                utc = np.datetime64(cells[place]) + shift
                offset = 2 if utc < np.datetime64("2025-10-26T01:00") else 1
                cells[place] = str(utc + np.timedelta64(offset, "h"))
            moved.append(",".join(cells))
        (station / name).write_text("\n".join(moved) + "\n")
    saved = run(station, capsys)
    assert "doubled_hour" not in {row["kind"] for row in saved["cleaning"]}
    change(station, "levels.csv", lambda lines: [lines[0], *sorted(lines[1:])])
    saved = run(station, capsys)
    (row,) = [row for row in saved["cleaning"] if row["kind"] == "doubled_hour"]
    assert row["count"] == 24  # two hours of 12 readings at the same local times


# ---- refusals


def copy_with(encoding=None, ends=None, share=1.0, name="copy.csv", of="levels.csv"):
    """Function that adds a copy of a log to its section."""

    def write(folder):
        heading, *lines = (folder / of).read_text().splitlines()
        text = "\n".join([heading, *lines[: int(share * len(lines))]]) + "\n"
        text = text.replace("\n", ends) if ends else text
        (folder / name).write_bytes(text.encode(encoding or "utf-8"))
        settings = folder / "upkeep.toml"
        settings.write_text(settings.read_text().replace(f'["{of}"]', f'["{of}", "{name}"]'))

    return write


def replace_first(folder, name, before, after):
    text = (folder / name).read_text()
    assert before in text
    (folder / name).write_text(text.replace(before, after, 1))


def join_headings(folder):
    """The columns change their order in the middle of a file."""
    lines = (folder / "meters.csv.log").read_text().splitlines()
    rows = [",".join([row.split(",")[place] for place in (0, 1, 3, 2)]) for row in lines[200:]]
    text = "\n".join([*lines[:200], "time,begin,volume_l,meter", *rows])
    (folder / "meters.csv.log").write_text(text + "\n")


def bytes_in(name, content):
    return lambda folder: (folder / name).write_bytes(content)


REFUSED = {
    "renamed copy": (copy_with(), "copy.csv"),
    "copy with other line ends": (copy_with(ends="\r\n"), "copy.csv"),
    "copy in UTF-16": (copy_with(encoding="utf-16"), "copy.csv"),
    "part in another file": (copy_with(share=0.5), "copy.csv"),
    "copy of sales with other line ends": (
        copy_with(ends="\r\n", of="meters.csv.log"), "copy.csv"),
    "copy of tickets with other line ends": (
        copy_with(ends="\r\n", of="deliveries.csv"), "copy.csv"),
    "other heading": (
        lambda folder: replace_first(folder, "levels.csv", "level_mm", "height"), "height"),
    "heading that changes": (join_headings, "volume_l"),
    "display format": (
        lambda folder: (bytes_in("levels.csv", b"I20100\r\n 1 REGULAR 8500 52.31")(folder),
                        declare(folder, "levels", "tls-inventory")), "i201"),
    "shift format": (
        lambda folder: (bytes_in("levels.csv", tls("20400", "2501062330", "0110" * 9))(folder),
                        declare(folder, "levels", "tls-inventory")), "i201"),
    "xls": (bytes_in("levels.csv", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(2000)), "levels"),
    "volumes without levels": (
        bytes_in("levels.csv", b"Tank ID,Fuel Level,Time stamp\nT1,4000,2025-01-06 00:00\n"),
        "Fuel Level"),
    "no time zone": (
        lambda folder: replace_first(folder, "upkeep.toml", 'timezone = "UTC"\n', ""), "timezone"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refusals_in_three_languages(station, capsys, name):
    write, part = REFUSED[name]
    write(station)
    for text in refusals(station, capsys):
        assert part in text


@pytest.mark.parametrize("of", ["meters.csv.log", "deliveries.csv"])
def test_parts_of_sales_and_tickets_do_not_count_twice(plain, station, capsys, of):
    """Rows that come again in another file are dropped and counted; the result is equal."""
    expected = run(plain, capsys)
    copy_with(share=0.5, of=of)(station)
    saved = run(station, capsys)
    assert saved["deliveries"] == expected["deliveries"]
    kind = "meters" if of == "meters.csv.log" else "deliveries"
    (row,) = [row for row in saved["cleaning"] if (row["log"], row["kind"]) == (kind, "duplicate")]
    assert row["count"] == len(rows_of(plain, of)) // 2


# ---- integrity


def text_of(saved, language="en"):
    """Text of the report."""
    return str([block.data for block in pages(UpkeepPaper(saved, language))])


@pytest.mark.parametrize("declared", [False, True])
def test_changed_table_of_the_gauge_through_the_command(station, capsys, declared):
    """From day 6 on, the gauge states 1 % more volume at equal levels."""
    lines = ["time,level_mm,volume_l"]
    for time, level in rows_of(station, "levels.csv"):
        litres = 1000 * TrueTank().below(float(level) / 1000)
        lines.append(f"{time},{level},{(1.01 if time > '2025-01-12' else 1.0) * litres:.0f}")
    (station / "levels.csv").write_text("\n".join(lines) + "\n")
    if declared:
        (station / "events.csv").write_text("time,kind\n2025-01-12T00:00:00,table_changed\n")
        settings = station / "upkeep.toml"
        settings.write_text(f'{settings.read_text()}\n[events]\nfiles = ["events.csv"]\n')
    saved = run(station, capsys)
    codes = [warning["code"] for warning in saved["warnings"]]
    assert ("upkeep_table_changed" in codes) == (not declared)
    for language in LANGUAGES:
        word = UpkeepPaper(saved, language).words["findings"]["table_changed"]
        assert (word in text_of(saved, language)) == (not declared)


def test_removed_sale_shows_in_the_totals_through_the_command(station, capsys):
    """The log has the counter and the volume of each sale; one row of it is removed."""
    totals, lines = dict.fromkeys("1234", 1000.0), ["time,begin,meter,total_l,volume_l"]
    for time, begin, meter, litres in rows_of(station, "meters.csv.log"):
        totals[meter] += float(litres)
        lines.append(f"{time},{begin},{meter},{totals[meter]:.3f},{litres}")
    for removed, count in ((None, None), (300, 1)):
        kept = [line for number, line in enumerate(lines) if number != removed]
        (station / "meters.csv.log").write_text("\n".join(kept) + "\n")
        counts = {row["kind"]: row["count"] for row in run(station, capsys)["cleaning"]}
        assert counts.get("total_unlike_sum") == count


def test_paper_names_each_log_and_its_chain(station, capsys):
    """SHA-256, rows, first and last hour and chain of each file; a removed file changes them."""
    days = {}
    heading, *lines = (station / "levels.csv").read_text().splitlines()
    for line in lines:
        days.setdefault("a" if line < "2025-01-10" else "b", []).append(line)
    (station / "levels.csv").unlink()
    for name, rows in days.items():
        (station / f"levels-{name}.csv").write_text("\n".join([heading, *rows]) + "\n")
    replace_first(station, "upkeep.toml", '"levels.csv"', '"levels-*.csv"')
    whole = run(station, capsys)
    for language in LANGUAGES:
        text = text_of(whole, language)
        for file in whole["files"]:
            digest = hashlib.sha256((station / file["file"]).read_bytes()).hexdigest()
            assert file["sha256"] == digest
            assert digest[:12] in text
            assert file["chain"][:12] in text
        first = next(file for file in whole["files"] if file["file"] == "levels-b.csv")
        assert (first["rows"], first["first"]) == (len(days["b"]), "2025-01-10T00")
        assert "2025-01-10 00 h" in text
    (station / "levels-a.csv").unlink()
    less = run(station, capsys)
    assert whole["files"][-1]["chain"][:12] not in text_of(less)
