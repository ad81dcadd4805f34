"""Reading and cleaning of level logs, meters and tickets, from captures made for the tests.

Kind of truth: closed form; every file is written here, with known contents.
"""

import struct
from dataclasses import replace

import numpy as np
import pytest

from tankcal.job.tables import Log
from tankcal.products.upkeep import logs
from tankcal.products.upkeep.flows import quiet_windows, read_flows
from tankcal.products.upkeep.levels import LevelSums, find_lines
from tankcal.products.upkeep.logs import Findings, LogFile, read_log_profile
from tankcal.products.upkeep.steps import StepRules, Tickets, build_steps, mean_sd_m

SECOND = 10**9
START = np.datetime64("2025-06-02T00:00:00", "ns").astype(np.int64)


def open_log(folder, text, kind="levels", profile=None, zone="UTC"):
    """`LogFile` of a text or bytes."""
    path = folder / f"{kind}.log"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    log = Log()
    read = read_log_profile(profile, kind, folder, log)
    assert not log.problems, log.problems
    return LogFile(path, kind, read, zone, Findings(), log)


def read_all(file):
    """{column: values} of all chunks."""
    chunks = list(file.chunks())
    return {key: np.concatenate([chunk[key] for chunk in chunks]) for key in chunks[0]}


def iso(times):
    return [str(time)[:19] for time in np.asarray(times).view("datetime64[ns]")]


def counts(file):
    return {kind: entry[0] for (_, kind), entry in file.findings.counts.items()}


# ---- times


def test_doubled_hour_goes_by_the_order_of_rows(tmp_path):
    """Berlin, 2025-10-26: 02:00 to 03:00 occurs twice; the fall of the local time divides it."""
    local = ["01:50", "02:10", "02:30", "02:50", "02:10", "02:30", "02:50", "03:10"]
    rows = "".join(f"2025-10-26T{time}:00,{i}\n" for i, time in enumerate(local))
    file = open_log(tmp_path, "time,level_mm\n" + rows, zone="Europe/Berlin")
    expected = [f"2025-10-{day}T{time}:00" for day, time in (
        (25, "23:50"), (26, "00:10"), (26, "00:30"), (26, "00:50"), (26, "01:10"), (26, "01:30"),
        (26, "01:50"), (26, "02:10"))]  # fmt: skip
    assert iso(read_all(file)["time"]) == expected


def test_doubled_hour_without_order_is_left_out(tmp_path):
    rows = "2025-10-26T01:50:00,1\n2025-10-26T02:30:00,2\n2025-10-26T03:10:00,3\n"
    file = open_log(tmp_path, "time,level_mm\n" + rows, zone="Europe/Berlin")
    assert iso(read_all(file)["time"]) == ["2025-10-25T23:50:00", "2025-10-26T02:10:00"]
    assert counts(file)["doubled_hour"] == 1


def test_doubled_hour_in_two_chunks(tmp_path, monkeypatch):
    """The chunk ends within the doubled hour; the fall of the time is in the next chunk."""
    local = ["01:50", "02:10", "02:30", "02:50", "02:10", "02:30", "02:50", "03:10"]
    rows = "".join(f"2025-10-26T{time}:00,{i}\n" for i, time in enumerate(local))
    monkeypatch.setattr(logs, "CHUNK", 3)
    file = open_log(tmp_path, "time,level_mm\n" + rows, zone="Europe/Berlin")
    times = read_all(file)["time"]
    assert len(times) == 8
    assert np.all(np.diff(times) > 0)


def test_skipped_hour_is_an_error_with_its_row(tmp_path):
    rows = "2025-03-30T01:50:00,1\n2025-03-30T02:30:00,2\n"
    file = open_log(tmp_path, "time,level_mm\n" + rows, zone="Europe/Berlin")
    list(file.chunks())
    (problem,) = file.log.problems
    assert (problem.row, problem.column) == (3, "time")


def test_times_with_an_offset_need_no_zone(tmp_path):
    rows = "2025-10-26T02:30:00+02:00,1\n2025-10-26T02:30:00+01:00,2\n"
    file = open_log(tmp_path, "time,level_mm\n" + rows, zone="Europe/Berlin")
    assert iso(read_all(file)["time"]) == ["2025-10-26T00:30:00", "2025-10-26T01:30:00"]


# ---- formats


def test_decimal_comma_of_course_data(tmp_path):
    """First row as published; the file has no heading."""
    rows = "2014-01-01 00:05:00;;;1;1361;9511,4;15\n2014-01-01 00:10:00;;;2;1200,5;9;14,5\n"
    file = open_log(tmp_path, rows, profile="course-levels")
    table = read_all(file)
    assert table["level"].tolist() == pytest.approx([1.361, 1.2005])
    assert table["temperature"].tolist() == [15.0, 14.5]
    one = replace(file, profile=replace(file.profile, only={"tank": "1"}))
    assert read_all(one)["level"].tolist() == [1.361]


def tls(code, stamp, data, spoil=False):
    """Block of a console with its check sum: all characters and the sum are 0 modulo 65536."""
    text = f"\x01i{code}{stamp}{data}&&"
    total = (-sum(text.encode())) % 65536
    return f"{text}{(total + spoil) % 65536:04X}\x03".encode()


def floats(*values):
    return "".join(struct.pack(">f", value).hex().upper() for value in values)


def test_inventory_of_a_console(tmp_path):
    """Two tanks in a block; a spoilt block is left out and counted; two-digit years."""
    values = floats(9511.4, 9400.0, 500.0, 1361.0, 12.5, 15.25, 30.0)
    data = f"011000007{values}02P000007{values}"
    capture = tls("20100", "2501062330", data) + b"\r\n" + tls("20100", "9901062330", data, True)
    file = open_log(tmp_path, capture, profile="tls-inventory")
    table = read_all(file)
    assert table["tank"].tolist() == ["1", "2"]
    assert iso(table["time"]) == ["2025-01-06T23:30:00"] * 2
    np.testing.assert_allclose(table["level"], 1.361)
    np.testing.assert_allclose(table["water"], 0.0125)
    np.testing.assert_allclose(table["volume"], 9.5114, rtol=1e-6)
    assert counts(file)["wrong_check_sum"] == 1


def test_lost_first_character_keeps_the_check_sum(tmp_path):
    capture = tls("20100", "2501062330", f"011000007{floats(*range(7))}").replace(b"\x01", b"")
    file = open_log(tmp_path, capture, profile="tls-inventory")
    assert len(read_all(file)["time"]) == 1


def test_deliveries_of_a_console(tmp_path):
    values = floats(5000, 4990, 0, 15, 17000, 16950, 0, 16, 700, 1700)
    data = f"01102250106090025010609200A{values}250107100025010710250A{values}"
    file = open_log(tmp_path, tls("20200", "2501080000", data), "deliveries", "tls-delivery")
    table = read_all(file)
    np.testing.assert_allclose(table["volume"], 12.0)
    assert iso(table["begin"]) == ["2025-01-06T09:00:00", "2025-01-07T10:00:00"]
    assert iso(table["time"])[1] == "2025-01-07T10:25:00"


def test_historian_export(tmp_path):
    """A tag in each row, states in place of values, quality and decimal commas."""
    (tmp_path / "pi.toml").write_text(
        '[columns]\ntime = "Zeit"\ntag = "Tag"\nvalue = "Wert"\nquality = "Status"\n'
        '[tags]\nlevel = "LT1"\ntemperature = "TT1"\n[units]\nlength = "mm"\n'
        '[file]\nseparator = ";"\ndecimal = ","\ntime_format = "%d.%m.%Y %H:%M:%S"\n'
        'good = ["Good"]\nmissing = ["No Data"]\n'
    )
    rows = (
        "LT1;1234,5;Good",
        "TT1;15,5;Good",
        "LT1;Bad Input;Good",
        "LT1;9;Bad",
        "LT1;No Data;Good",
    )
    text = "".join(f"02.06.2025 00:0{i}:00;{row}\n" for i, row in enumerate(rows))
    file = open_log(tmp_path, "Zeit;Tag;Wert;Status\n" + text, profile="pi.toml")
    sums = LevelSums(np.array([[START - SECOND, START + 3600 * SECOND]]), 1e-4, (), np.asarray)
    sums.read([file])
    assert sums._sums["n"].sum() == 1
    assert sums._reference[0] == pytest.approx(1.2345)
    assert sums._sums["T"].sum() == 15.5
    found = counts(file)
    assert (found["not_a_number"], found["bad_quality"]) == (1, 1)


def test_other_heading_is_named(tmp_path):
    file = open_log(tmp_path, "Time,Height\n2025-06-02,1\n")
    list(file.chunks())
    assert "Time, Height" in str(file.log.problems[0].expected)


# ---- meters


def totals(values, meter="1"):
    rows = "".join(f"2025-06-02T{i:02d}:00:00,{meter},{value}\n" for i, value in enumerate(values))
    return "time,meter,total_l\n" + rows


def test_rollover_is_added_and_reset_breaks(tmp_path):
    file = open_log(tmp_path, totals([999_900, 999_990, 40, 140, 3, 53]), "meters")
    (flow,) = read_flows([file])
    hour = START + 3600 * SECOND * np.arange(6)
    np.testing.assert_allclose(flow.volume_m3(hour), [0, 0.09, 0.14, 0.24, 0.24, 0.29])
    assert flow.is_broken(hour[:-1], hour[1:]).tolist() == [False, False, False, True, False]
    found = counts(file)
    assert (found["rollover"], found["reset"]) == (1, 1)


def test_rows_that_come_twice(tmp_path):
    """Equal rows are dropped, late rows sorted; another total at the same time is a problem."""
    text = totals([10, 20, 30]) + "2025-06-02T01:00:00,1,20\n2025-06-02T02:00:00,1,31\n"
    file = open_log(tmp_path, text, "meters")
    read_flows([file])
    assert counts(file)["duplicate"] == 1
    assert counts(file)["late"] == 1
    assert len(file.log.problems) == 1
    assert file.log.problems[0].row == 6


def test_transactions_leave_quiet_windows(tmp_path):
    text = (
        "time,begin,meter,volume_l\n2025-06-02T01:10:00,2025-06-02T01:00:00,1,35\n"
        "2025-06-02T01:12:00,2025-06-02T01:05:00,2,20\n"
    )
    flows = read_flows([open_log(tmp_path, text, "meters")])
    windows = quiet_windows(flows, 120, START, START + 7200 * SECOND)
    assert ((windows - START) // SECOND).tolist() == [[0, 3600], [4320 + 120, 7200]]


# ---- levels


def quiet_log(tmp_path, levels, start=0, profile=None):
    times = (START + SECOND * 60 * (start + np.arange(len(levels)))).view("datetime64[ns]")
    rows = "".join(f"{str(time)[:19]},{level}\n" for time, level in zip(times, levels, strict=True))
    return open_log(tmp_path, "time,level_mm\n" + rows, profile=profile)


def test_lines_of_a_historian():
    """Straight lines are found, noise and equal levels are not."""
    time = START + 60 * SECOND * np.arange(40)
    rng = np.random.default_rng(0)
    level = np.concatenate([1 + 1e-4 * rng.normal(size=20), 1 + 1e-5 * np.arange(10), np.ones(10)])
    assert np.flatnonzero(find_lines(time, level)).tolist() == [*range(21, 29)]


def test_stuck_float(tmp_path):
    """Equal levels while 500 L are sold from a tank of 10 m2: 50 mm were missed."""
    sold = totals([0, 0, 500, 500])
    flows = read_flows([open_log(tmp_path, sold, "meters")])
    windows = quiet_windows(flows, 120, START, START + 4 * 3600 * SECOND)
    for level, stuck in (
        (np.full(240, 1000.0), 240),
        (np.r_[np.full(70, 1000.0), np.full(170, 950.0)], 0),
    ):
        file = quiet_log(tmp_path, level)
        sums = LevelSums(windows, 1e-4, flows, lambda level: 10 * np.asarray(level))
        sums.read([file])
        pieces = sums.means(file.findings)
        assert (len(pieces) == 0) == bool(stuck)


@pytest.mark.parametrize("chunk", [7, 50, 200_000])
def test_sums_do_not_depend_on_chunks(tmp_path, monkeypatch, chunk):
    """Duplicates, late rows and two values at one time, over the edges of chunks."""
    monkeypatch.setattr(logs, "CHUNK", chunk)
    rng = np.random.default_rng(3)
    file = quiet_log(tmp_path, np.round(1000 + rng.normal(size=100), 2))
    lines = file.path.read_text().splitlines()
    lines[40], lines[41] = lines[41], lines[40]
    lines.insert(60, lines[59])
    lines.insert(80, lines[79].split(",")[0] + ",1.0")
    file.path.write_text("\n".join(lines) + "\n")
    sums = LevelSums(np.array([[START - 1, START + 9000 * SECOND]]), 1e-5, (), np.asarray)
    sums.read([file])
    pieces = sums.means(file.findings)
    assert pieces.count.sum() in (98, 99)
    found = counts(file)
    assert (found["duplicate"], found["other_value"]) == (1, 1)


@pytest.mark.parametrize(
    ("noise", "expected"), [(0.05, 0.24), (0.1, 0.20), (0.3, 0.07), (0.5, 0.07)]
)
def test_mean_of_a_coarse_gauge(noise, expected):
    """Simulation: means of 60 readings of a gauge of 1 mm steps; the stated sd is no smaller."""
    rng = np.random.default_rng(5)
    level = rng.uniform(0, 10, size=(4000, 1))
    read = np.round(level + noise * rng.normal(size=(4000, 60)))
    error = np.sqrt(np.mean((read.mean(axis=1) - level[:, 0]) ** 2))
    assert error == pytest.approx(expected, abs=0.012)
    stated = mean_sd_m(read.std(axis=1, ddof=1), np.full(4000, 60), 1.0)
    assert np.sqrt(np.mean(stated**2)) > 0.95 * error


# ---- steps


def test_steps_close_and_say_why_not(tmp_path):
    """A tank of 10 m2: sales, a delivery with its ticket, a rise without one."""
    hours = np.arange(12)
    sold = np.r_[0, 0.3, 0.6, 0.6, 0.9, 1.2, 1.2, 1.5, 1.8, 1.8, 2.1, 2.4]
    delivered = np.where(hours >= 3, 2.0, 0.0) + np.where(hours >= 9, 1.5, 0.0)
    flow_text = totals(1000 * sold)
    flows = read_flows([open_log(tmp_path, flow_text, "meters")])
    level = 1.0 + (delivered - sold) / 10
    from tankcal.products.upkeep.levels import Pieces

    time = START + 3600 * SECOND * hours
    nan = np.full(12, np.nan)
    pieces = Pieces(hours, time, level, np.full(12, 1e-4), np.full(12, 30), nan, nan)
    tickets = Tickets(np.array([START + 4 * 3600 * SECOND]), np.array([2.01]), np.array([15.0]),
                      np.array([2]))  # fmt: skip
    findings = Findings()
    rules = StepRules(1e-5, 3e-4, 0.5, 0.5, 3.0)
    steps = build_steps(pieces, flows, tickets, lambda h: 10 * h, rules, findings)
    used = steps.is_used
    balance = steps.delivered_m3 - steps.sold_m3.sum(axis=1) - np.diff(10 * steps.marks.level_m)
    assert np.abs(balance[used]).max() == pytest.approx(0.01)
    assert steps.tickets.tolist() == [0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0][: len(steps)]
    assert [int(reason) for reason in steps.reason if reason] == [2]
    assert findings.number("deliveries", "no_ticket") == 1
