"""A house rule: its file, and how a job names it."""

import hashlib

import pytest
from job_builder import assert_same_job, job_parts, write_folder
from spoilt import FORMS, places, problems_of, settings_place, write
from survey_builder import survey_parts

from tankcal.errors import InputError
from tankcal.job import InputFile, load
from tankcal.job.rule_files import parse_rule, shipped_rule
from tankcal.job.tables import Log

OWN = """
[rule]
name = "House rule"
source = "contract 12"
verified = true

[uncertainty.step]
of = "deliveries"
limit_percent = 0.25
minimum_height_m = 1
clause = "3"

[deviation.plate]
of = "capacity"
limit_m3 = 2.5
side = "upper"
guard = "U"
tanks = ["horizontal", "sphere"]
verified = false
"""


def read(text):
    """The Rule of a text; InputError with every problem of it."""
    log = Log()
    rule = parse_rule("own.toml", text.encode(), log)
    log.stop_if_problems()
    return rule


def job_with(name, content=None):
    """Parts of a sound job that names a rule, with its file beside it."""
    parts = job_parts(settings={"table.rule": name})
    if content is not None:
        parts.beside[name] = content.encode()
    return parts


def test_a_house_rule_is_read():
    rule = read(OWN)
    assert (rule.name, rule.source, rule.remark) == ("House rule", "contract 12", "")
    assert rule.verified is False
    (step,) = rule.uncertainty
    assert (step.limit, step.minimum_height_m, step.relative_to) == (0.0025, 1, "itself")
    assert step.verified
    (plate,) = rule.deviation
    assert (plate.limit_m3, plate.limit, plate.side) == (2.5, None, "upper")
    assert plate.tanks == ("horizontal", "sphere")
    assert not plate.verified


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('name = "House rule"\n', "", "rule.name: missing; expected name of the rule"),
        ('source = "contract 12"\n', "", "rule.source: missing"),
        ('source = "contract 12"', 'source = ""', "rule.source: blank"),
        ("verified = true", 'verified = "perhaps"', "expected true or false"),
        ('of = "deliveries"', 'of = "delivery"', "(did you mean deliveries?)"),
        ('of = "deliveries"', 'of = "volumes"', "is for deliveries"),
        ("limit_percent = 0.25", "limit_percent = 0", "expected a number above 0, at most 100"),
        ("limit_percent = 0.25", 'limit_percent = "0,25"', "stored as a number"),
        ("limit_percent = 0.25", "limit_percent = nan", "not NaN or infinite"),
        ("limit_percent = 0.25", "limit = 0.25", "unknown key; expected of, limit_percent"),
        ("minimum_height_m = 1\n", "", "expected the least height of a delivery"),
        (
            "minimum_height_m = 1",
            'minimum_height_m = ""',
            "expected the least height of a delivery",
        ),
        ("limit_m3 = 2.5\n", "", "expected limit_percent or limit_m3"),
        ("limit_m3 = 2.5", 'limit_m3 = ""', "expected limit_percent or limit_m3"),
        ("limit_m3 = 2.5", "limit_m3 = 2.5\nlimit_percent = 1", "expected only one of them"),
        ('guard = "U"\n', "", "deviation.plate.guard: missing"),
        ('"sphere"', '"spheres"', "(did you mean sphere?)"),
        ("[uncertainty.step]", "[uncertainy.step]", "(did you mean uncertainty?)"),
        ("[uncertainty.step]", "[uncertainty.step.small]", "unknown section"),
        ("[uncertainty.step]", "[uncertainty]", "is in no limit"),
        ("[rule]", "name = 'x'\n[rule]", "is in no [section]"),
        ("[rule]", "[rule", "own.toml, row 2: cannot be read"),
        ("limit_m3 = 2.5", "limit_m3 = 2,5", "found 'limit_m3 = 2,5'; expected a decimal point"),
    ],
)
def test_wrong_rule_file_is_reported(old, new, told):
    assert OWN.count(old) >= 1
    with pytest.raises(InputError) as raised:
        read(OWN.replace(old, new, 1))
    assert told in str(raised.value)


def test_rule_file_reports_all_problems_with_rows():
    wrong = OWN.replace("0.25", "-1").replace('side = "upper"', 'side = "left"')
    wrong = wrong.replace('source = "contract 12"\n', "").replace("clause", "clauze")
    with pytest.raises(InputError) as raised:
        read(wrong)
    problems = raised.value.problems
    assert {problem.column for problem in problems} == {
        "rule.source",
        "uncertainty.step.limit_percent",
        "uncertainty.step.clauze",
        "deviation.plate.side",
    }
    rows = {problem.column: problem.row for problem in problems}
    lines = wrong.splitlines()
    assert lines[rows["deviation.plate.side"] - 1] == 'side = "left"'
    assert lines[rows["uncertainty.step.clauze"] - 1].startswith("clauze")


@pytest.mark.parametrize("text", ["", '[rule]\nname = "x"\nsource = "y"\n'])
def test_a_rule_without_a_limit_is_refused(text):
    with pytest.raises(InputError, match=r"no limits|missing"):
        read(text)


@pytest.mark.parametrize("form", FORMS)
def test_a_job_names_a_shipped_rule(tmp_path, form):
    job = load(write(tmp_path, job_with("oiml_r71"), form))
    assert job.rule == shipped_rule("oiml_r71")
    assert job.table.rule == "oiml_r71"
    assert "oiml_r71" not in {file.file for file in job.files}


@pytest.mark.parametrize("form", FORMS)
def test_house_rule_in_job_folder_is_hashed(tmp_path, form):
    job = load(write(tmp_path, job_with("house rule.toml", OWN), form))
    assert job.rule == read(OWN)
    digest = hashlib.sha256(OWN.encode()).hexdigest()
    assert job.files[-1] == InputFile("house rule.toml", digest, len(OWN.encode()))


def test_folder_and_workbook_give_the_same_rule(tmp_path):
    parts = job_with("house.toml", OWN)
    assert_same_job(*(load(write(tmp_path, parts, form)) for form in FORMS))


@pytest.mark.parametrize("form", FORMS)
def test_problems_of_a_house_rule_come_with_those_of_the_job(tmp_path, form):
    parts = job_with("house.toml", OWN.replace("0.25", "250").replace('guard = "U"\n', ""))
    parts.settings["tank.nominal_height_m"] = -9.5
    row = OWN.splitlines().index("limit_percent = 0.25") + 1
    assert sorted(places(problems_of(write(tmp_path, parts, form)))) == sorted(
        [
            settings_place(form, parts, "tank.nominal_height_m"),
            ("house.toml", row, "uncertainty.step.limit_percent"),
            (
                "house.toml",
                OWN.splitlines().index("[deviation.plate]") + 1,
                "deviation.plate.guard",
            ),
        ]
    )


@pytest.mark.parametrize("form", FORMS)
def test_the_layout_that_a_rule_requires_is_asked_for(tmp_path, form):
    text = OWN.replace("[uncertainty.step]", 'layout = ["centimetres"]\n\n[uncertainty.step]')
    parts = job_with("house.toml", text)
    for name in ("without", "with"):
        (tmp_path / name).mkdir()
    problems = problems_of(write(tmp_path / "without", parts, form))
    assert [problem.column for problem in problems] == ["table.heights_in"]
    assert problems[0].expected == "the rule House rule requires cm"
    parts.settings["table.heights_in"] = "cm"
    load(write(tmp_path / "with", parts, form))


def test_unknown_layouts_are_reported():
    text = OWN.replace("[uncertainty.step]", 'layout = ["centimetre"]\n\n[uncertainty.step]')
    with pytest.raises(InputError, match="did you mean centimetres"):
        read(text)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", ["job.toml", "house.toml"])
def test_a_rule_that_is_no_rule(tmp_path, form, name):
    parts = job_with(name, '[tank]\nid = "T-1"\n' if name == "house.toml" else None)
    found = problems_of(write(tmp_path, parts, form))
    if name == "job.toml" and form == "workbook":
        assert places(found) == [settings_place(form, parts, "table.rule")]
    else:
        assert (name, "rule.name") in {(one.file, one.column) for one in found}


def test_a_rule_that_is_a_folder(tmp_path):
    folder = write_folder(tmp_path / "job", job_with("house.toml"))
    (folder / "house.toml").mkdir()
    (problem,) = problems_of(folder)
    assert "expected a file" in problem.expected


def test_an_adjustment_alone_needs_no_rule(tmp_path):
    parts = survey_parts()
    parts.settings["table.rule"] = "atlantis"
    folder = write_folder(tmp_path / "job", parts)
    assert load(folder, only="adjustment").rule is None
    assert [problem.column for problem in problems_of(folder)] == ["table.rule"]
