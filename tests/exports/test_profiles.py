"""Profiles: the shipped ones, one's own, and every way in which one can be wrong."""

from fractions import Fraction

import pytest

from tankcal.errors import InputError
from tankcal.job.tables import Log
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
    assert not_read == {"veeder-root-tls-20", "csv"}


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
