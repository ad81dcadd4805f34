"""Profiles: the shipped ones, one's own, and every way in which one can be wrong."""

from fractions import Fraction

import numpy as np
import pytest
from exported_records import exact_record, lying

from tankcal.errors import InputError
from tankcal.job.tables import Log
from tankcal.products.exports.exporting import export_record
from tankcal.products.exports.profiles import find_profile, parse_profile, shipped_profiles
from tankcal.products.exports.writing import count_increments, to_quanta
from tankcal.tank.dips import parse_dip

GOOD = """
[profile]
name = "ours"
source = "our own"
[table]
columns = ["dip", "volume"]
grid = "every row"
[volumes]
unit = "L"
decimals = 0
"""


def told(text):
    """{column: message code} of what is told of a profile."""
    log = Log()
    profile = parse_profile("ours.toml", text.encode(), log)
    assert (profile is None) == bool(log.problems)
    return {one.column: one.expected.code for one in log.problems}


def test_limits_of_shipped_profiles():
    """Published: exports.md, section 1."""
    most = {code: one.max_points for code, one in shipped_profiles().items() if one.max_points}
    assert most == {
        "signet-9900": 10, "pepperl-fuchs-luc-t10": 11, "ametek-universal-iii": 21,
        "endress-hauser-cerabar-s": 32, "pulsar-ultra-3": 32, "level-meter-1500": 1500,
        "veeder-root-tls-20": 20,
    }  # fmt: skip
    not_read = {code for code, one in shipped_profiles().items() if not one.verified}
    assert not_read == {"csv"}


def test_increments():
    """Published: 5 ft 3 3/16 in at 1/16 in is 1011, 5.5 m at 1/100 m is 550."""
    assert count_increments(parse_dip("5 ft 3 3/16 in", "ft-in-16"), "1/16 in") == 1011
    assert count_increments(5.5, "1/100 m") == 550


@pytest.mark.parametrize("value", [0.1, 1e-9, 123456.7895, 0.0005, 7.0])
def test_quanta_are_rounded_once(value):
    """Second method: the nearest multiple, in rational numbers."""
    quantum = Fraction(1, 1000)
    found = to_quanta(value, quantum) * quantum
    assert abs(found - Fraction(value)) <= quantum / 2


def test_a_sound_profile_of_ones_own(tmp_path):
    path = tmp_path / "ours.toml"
    path.write_text(GOOD)
    profile = find_profile(str(path))
    assert (profile.code, profile.columns, profile.volume_unit) == ("ours", ("dip", "volume"), "L")
    assert (profile.interpolation, profile.separator, profile.verified) == ("linear", ",", False)


@pytest.mark.parametrize(
    ("before", "after", "column", "code"),
    [
        ('name = "ours"', "", "profile.name", "missing_key"),
        ('"dip", "volume"', '"dip", "vol"', "table.columns", "export_column"),
        ('"dip", "volume"', '"dip", "dip", "volume"', "table.columns", "export_column_twice"),
        ('"dip", "volume"', '"volume"', "table.columns", "export_column_of"),
        ('"dip", "volume"', '"increments", "volume"', "levels.increment", "export_no_increment"),
        ('columns = ["dip", "volume"]', "", "table.columns", "export_no_list"),
        ('columns = ["dip", "volume"]', "columns = 7", "table.columns", "export_texts"),
        ('"every row"', '"step"', "table.step_m", "export_no_step"),
        ('"every row"', '"every row"\nstep_m = 0.1', "table.step_m", "export_step"),
        ('"every row"', '"all"', "table.grid", "found_expected"),
        ('"every row"', '"every row"\nmax_points = 2.5', "table.max_points", "export_whole"),
        ('"every row"', '"every row"\nmin_points = 5\nmax_points = 4', "table.min_points",
         "export_points_cross"),
        ("decimals = 0", "decimals = 3\ndigits = 3", "volumes.digits", "export_digits_cross"),
        ("decimals = 0", "decimals = 0\n[levels]\nunit = 'ft-in-16'\ndecimals = 2",
         "levels.decimals", "export_marks"),
        ("decimals = 0", "decimals = 0\n[file]\ndecimal = ','", "file.separator",
         "export_mark_twice"),
        ("decimals = 0", "decimals = 0\n[file]\nthousands = ','", "file.thousands",
         "export_thousands"),
        ("decimals = 0", "decimals = 0\n[file]\nheadings = ['h']", "file.headings",
         "export_headings"),
        ("decimals = 0", "decimals = 0\n[file]\nheader = ['{x.y}']", "file.header",
         "export_placeholder"),
        ("decimals = 0", "decimals = 0\n[file]\nheader = ['{']", "file.header",
         "export_placeholder"),
        ("decimals = 0", "decimals = 0\n[colours]\nred = 1", "[colours]", "export_section"),
        ("decimals = 0", "decimals = 0\nlargset = 5", "volumes.largset", "unknown_key_of_section"),
        ('unit = "L"', 'unit = "kg"', "volumes.unit", "found_expected"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_profile(before, after, column, code):
    assert before in GOOD
    assert told(GOOD.replace(before, after)).get(column) == code


def test_every_problem_in_one_run():
    bad = GOOD.replace('"dip"', '"dop"').replace('"L"', '"kg"').replace("every row", "all")
    assert len(told(bad)) == 3


@pytest.mark.parametrize("data", [b"\xff\xfe", b"[profile", b"", b"\0", b"x = 1", b"[table]\n" * 2])
def test_files_that_are_no_profile(data, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_bytes(data)
    with pytest.raises(InputError):
        find_profile(str(path))


@pytest.mark.parametrize("name", ["nobody", "missing.toml", "../csv", "csv/", "", "a\0b.toml"])
def test_names_without_a_profile(name):
    with pytest.raises(InputError):
        find_profile(name)


@pytest.mark.slow
def test_fixed_levels_of_a_console(tmp_path):
    """Closed form of a lying cylinder at 5, 10, ... 100 % of its diameter; no level is chosen."""
    source = exact_record(tmp_path, lying, np.arange(0, 2.4001, 0.01))
    export = export_record(source, find_profile("veeder-root-tls-20"))
    top = max(export.dip_m)
    assert sorted(export.dip_m) == pytest.approx([top * k / 20 for k in range(1, 21)], abs=1e-5)
    exact = [lying(dip) for dip in export.dip_m]
    assert export.volume_m3 == pytest.approx(exact, abs=export.error_m3)
    between = np.linspace(0, top, 2001)
    read = np.interp(between, [0, *sorted(export.dip_m)], [0, *sorted(export.volume_m3)])
    worst = np.max(np.abs(read - [lying(dip) for dip in between]))
    assert 0.9 * export.error_m3 < worst <= export.error_m3 + 5e-4
    with pytest.raises(InputError):
        export_record(source, find_profile("veeder-root-tls-20"), points=10)


def test_parts_belong_to_fractions():
    assert "table.parts" in told(GOOD.replace("[table]", "[table]\nparts = 20"))
