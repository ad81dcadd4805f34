"""Library of rules: sources of every number, and no unread number on a certificate."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from example_certificates import ROOT, record_of_example

import tankcal
from tankcal.job.folder import read_toml
from tankcal.job.rule_files import MOST_QUOTED, parse_rule, shipped_names, shipped_rule
from tankcal.job.tables import Log
from tankcal.record.schema import to_plain
from tankcal.record.table import rule_of
from tankcal.report import certificate
from tankcal.report.paper import Paper
from tankcal.report.uncertainty import rule as chapter
from tankcal.tank.rules import judge, judge_uncertainty
from tankcal.text.shipped import LANGUAGES, shipped_folder
from tankcal.text.words import load_words

NUMBERS = ("limit_percent", "limit_m3", "limit_mm", "years", "minimum_height_m")


def sections_of(name):
    """(head, {section: values}) of a shipped rule, as written."""
    path = shipped_folder("job/rule_tables") / f"{name}.toml"
    settings, _ = read_toml(path.name, path.read_bytes(), Log())
    values = {
        section: {key: value.raw for key, value in keys.items()}
        for section, keys in settings.items()
    }
    return values.pop("rule"), {name: keys for name, keys in values.items() if "." in name}


@pytest.mark.parametrize("name", shipped_names())
def test_a_verified_number_states_who_read_it_where_and_when(name):
    head, sections = sections_of(name)
    assert sections
    for section, keys in sections.items():
        if keys.get("verified", head["verified"]):
            assert {"article", "read_by", "read_on"} <= set(keys), section
            assert {"title", "number", "date", "country"} <= set(head)
            cited = keys.get("quotation") or keys["clause"]
            assert len(cited.split()) <= MOST_QUOTED
            if "minimum_height_m" not in keys:
                (number,) = (keys[key] for key in NUMBERS if key in keys)
                shown = f"{number:g}".replace(".", ",")
                in_words = {6: "six", 10: "dix", 12: "douze"}.get(number, shown)
                assert re.search(rf"\b({shown}|{in_words})\b", cited)
        else:
            assert not {"quotation", "read_by", "read_on"} & set(keys), section


def numbers_of(rule):
    """Printed limits of a rule, with both decimal marks."""
    texts = set()
    for limit in (*rule.uncertainty, *rule.deviation):
        if limit.limit is not None:
            percent = f"{100 * limit.limit:.12g}"
            texts |= {f"{mark} %" for mark in (percent, percent.replace(".", ","))}
    return texts


@pytest.mark.slow
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(
    "name", [name for name in shipped_names() if shipped_rule(name).uncertainty]
)
def test_an_unread_number_is_never_on_a_certificate(name, language, judged_record):
    """The chapter and the statements of the certificate, for a record judged by each rule."""
    rule, record = shipped_rule(name), judged_record(name)
    paper = Paper(record, language=language)
    shown = [*chapter.blocks_of_verdict(paper), certificate.statements(paper)]
    text = repr([block.data for block in shown]).replace("\\xa0", " ").replace("\xa0", " ")
    named = {number for number in numbers_of(rule) if re.search(rf"(?<![\d.,]){number}", text)}
    if record["rule"]["verified"]:
        assert named
    else:
        assert not named
        assert rule.name not in text
        working = repr([block.data for block in chapter.blocks_of_unread(paper)])
        assert load_words(language)["texts"]["rule_unread"][:20] in working


@pytest.fixture(scope="module")
def judged_record():
    """Function that returns the record of an example, judged by a shipped rule."""
    result = tankcal.run(tankcal.load(ROOT / "strapping"), simulated=False)
    base = record_of_example("strapping")

    def judge_by(name):
        verdict = judge(shipped_rule(name), result.table, "vertical_fixed_roof")
        return base | {"rule": to_plain(rule_of(verdict))}

    return judge_by


# ---- keys of a rule


def read(text):
    log = Log()
    return parse_rule("own.toml", text.encode(), log), [problem.column for problem in log.problems]


LIMIT = """
[rule]
name = "House rule"
source = "contract 12"
[uncertainty.volumes]
of = "volumes"
limit_percent = 0.1
"""


def test_article_and_quotation_are_the_clause():
    rule, _ = read(f'{LIMIT}article = "7.1"\nquotation = "at most 0.1 %"')
    assert rule.uncertainty[0].clause == "7.1: at most 0.1 %"
    _, columns = read(f'{LIMIT}quotation = "{"word " * 26}"')
    assert columns == ["uncertainty.volumes.quotation"]


def test_a_limit_from_the_lower_limit_of_accurate_capacity_is_met_there():
    """U = 1 at every row: 0.1 % of V is met from V = 1000 on."""
    table = SimpleNamespace(
        height_m=np.arange(5.0), volume_m3=np.array([0.0, 500.0, 1000.0, 1500.0, 2000.0]),
        U_m3=np.ones(5), for_use=lambda heights: np.ones(5, dtype=bool),
    )  # fmt: skip
    plain, _ = read(LIMIT)
    accurate, _ = read(f'{LIMIT}from_level = "lower_accurate"')
    found = {name: judge_uncertainty(rule.uncertainty[0], table) for name, rule in
             (("plain", plain), ("accurate", accurate))}  # fmt: skip
    assert [(v.code, v.passed, v.from_m) for v in found.values()] == [
        ("holds_from", False, 2.0), ("holds_accurate", True, 2.0),
    ]  # fmt: skip


def test_a_table_in_use_has_the_limit_in_service():
    """Twice the limit of verification, as MessEV 22 (2) presumes for a table in use."""
    rule, _ = read(
        '[rule]\nname = "Twice"\nsource = "contract"\n[deviation.top]\nof = "capacity"\n'
        'limit_percent = 0.3\nguard = "none"\nin_service_factor = 2\n'
    )
    (limit,) = rule.deviation
    assert limit.limit == 0.003
    assert limit.in_service().limit == 0.006
    assert limit.in_service().limit_m3 is None
