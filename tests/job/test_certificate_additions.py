"""Seal plan, identification plate and next verification of a certificate."""

import json
import re
import shutil
from datetime import date

import pytest
from conftest import EXAMPLE

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.job.building import _add_years
from tankcal.job.rule_files import parse_rule
from tankcal.job.tables import Log
from tankcal.tank.rules import PLATE

SEALS = """
[seals.S-1]
place = "cover of the dip hatch"
mark = "INM 004512"
secures = "datum plate"
attached = 1995-07-01

[seals.S-2]
place = "manhole"
"""
RULE = """
[rule]
name = "Rule X"
source = "its text"
verified = {verified}
plate = {plate}

[uncertainty.all]
of = "volumes"
limit_percent = 5

[period.short]
tanks = ["vertical_fixed_roof"]
of = "all"
years = 2.5
clause = "7.1"

[period.long]
of = "all"
years = 4

[period.bottom]
of = "bottom_course"
years = 1
"""


def write_job(folder, certificate=(), table=(), **files):
    """Copy the example with keys of [certificate] and [table], and files beside it."""
    job = shutil.copytree(EXAMPLE, folder / "job", ignore=shutil.ignore_patterns("results"))
    text = (job / "job.toml").read_text(encoding="utf-8")
    for section, keys in (("certificate", certificate), ("table", table)):
        text = text.replace(f"[{section}]\n", f"[{section}]\n" + "".join(f"{k}\n" for k in keys))
    (job / "job.toml").write_text(text, encoding="utf-8")
    for name, content in files.items():
        (job / f"{name}.toml").write_text(content, encoding="utf-8")
    return job


def rule(plate=("tank_id",), verified=True):
    return RULE.format(plate=json.dumps(plate), verified=str(verified).lower())


# ---- seals


def test_seals_are_read_with_their_day(tmp_path):
    job = tankcal.load(write_job(tmp_path, seals=SEALS))
    assert [(seal.name, seal.mark, seal.attached) for seal in job.seals] == [
        ("S-1", "INM 004512", "1995-07-01"),
        ("S-2", "", ""),
    ]
    assert tankcal.load(EXAMPLE).seals == ()


def test_a_seal_needs_the_place_that_it_seals(tmp_path):
    with pytest.raises(InputError, match=r"seals\.toml, .*place"):
        tankcal.load(write_job(tmp_path, seals='[seals.S-1]\nmark = "7"\n'))


# ---- next verification


def test_period_of_a_rule_counts_from_the_survey(tmp_path):
    """Article 34.1 has ten years; the example was surveyed on 30 June 1995."""
    keys = ['next_verification_rule = "france_2020_recalibration"']
    last = tankcal.load(write_job(tmp_path, keys)).next_verification
    assert (last.date, last.years) == ("2005-06-30", 10)
    assert last.clause.startswith("34.1")


def test_shortest_period_of_the_whole_tank_counts(tmp_path):
    """2.5 years, not the 4 of all tanks, and not 1 year of the bottom course alone."""
    keys = ['next_verification_rule = "x.toml"']
    job = tankcal.load(write_job(tmp_path, keys, x=rule()))
    assert job.next_verification.date == "1997-12-30"
    assert job.next_verification.rule == "Rule X"
    assert "x.toml" in [file.file for file in job.files]


def test_the_customer_may_ask_for_a_date(tmp_path):
    last = tankcal.load(write_job(tmp_path, ["next_verification = 1999-01-31"])).next_verification
    assert (last.date, last.rule) == ("1999-01-31", None)
    assert tankcal.load(EXAMPLE).next_verification is None


@pytest.mark.parametrize("name", ["x.toml", "api_2_2a_period"])
def test_a_rule_from_memory_gives_no_date(name, tmp_path):
    keys = [f'next_verification_rule = "{name}"']
    job = tankcal.load(write_job(tmp_path, keys, x=rule(verified=False)))
    assert job.next_verification is None
    [warning] = [str(one) for one in job.warnings if "next_verification_rule" in str(one)]
    assert "not compared with its text" in warning


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        (['next_verification_rule = "france_2003"'], "no period"),
        (['next_verification_rule = "fr_2003"'], "did you mean|expected a .toml file"),
        (
            ['next_verification_rule = "x.toml"', "next_verification = 1999-01-31"],
            "given together with next_verification",
        ),
    ],
)
def test_other_rules_are_refused_in_one_line(keys, expected, tmp_path):
    with pytest.raises(InputError) as refused:
        tankcal.load(write_job(tmp_path, keys, x=rule()))
    [line] = str(refused.value).splitlines()
    assert re.search(expected, line)


@pytest.mark.parametrize(
    ("day", "years", "expected"),
    [
        (date(2024, 2, 29), 1, date(2025, 2, 28)),
        (date(2024, 2, 29), 4, date(2028, 2, 29)),
        (date(2023, 8, 31), 0.5, date(2024, 2, 29)),
        (date(2023, 12, 15), 10, date(2033, 12, 15)),
        (date(2023, 6, 30), 0.5, date(2023, 12, 30)),
    ],
)
def test_years_end_on_the_same_day_of_the_month_or_its_last(day, years, expected):
    assert _add_years(day, years) == expected


# ---- plate


def test_unknown_entries_of_a_plate_are_refused():
    log = Log()
    assert parse_rule("x.toml", rule(["tank_id", "tank_di"]).encode(), log) is None
    [problem] = log.problems
    assert "tank_di" in str(problem)
    assert "tank_id" in str(problem)


@pytest.mark.slow
@pytest.mark.parametrize("verified", [True, False])
def test_certificate_draws_the_plate_of_a_rule_that_was_read(verified, tmp_path):
    keys = [
        'next_verification_rule = "x.toml"',
        'authorised_by = "Ana Souza"',
        'authorised_role = "Head"',
    ]
    job = write_job(tmp_path, keys, ['rule = "x.toml"'], x=rule(PLATE, verified), seals=SEALS)
    assert main(["run", str(job), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    notebook = json.loads((tmp_path / "out" / "report.ipynb").read_text(encoding="utf-8"))
    papers = {
        paper: json.dumps([cell for cell in notebook["cells"]
                           if paper in cell["metadata"].get("tags", ())], ensure_ascii=False)
        for paper in ("certificate", "working-papers")
    }  # fmt: skip
    drawn = "Drawing of the identification plate. Laboratory: "
    assert (drawn in papers["certificate"]) == verified
    assert (drawn in papers["working-papers"]) != verified
    assert "RECONSTRUCTION-1 | 95" in papers["certificate" if verified else "working-papers"]
    assert "Number or mark" in papers["certificate"]
    xml = (tmp_path / "out" / "certificate.xml").read_text(encoding="utf-8")
    assert "cover of the dip hatch; INM 004512; datum plate; 1995-07-01" in xml
    assert ("until 30 December 1997, as required by Rule X (7.1)" in xml) == verified
    assert main(["verify", str(tmp_path / "out"), "--quiet"]) == 0
