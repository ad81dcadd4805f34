"""Texts that know what they say: in the terminal's English, in the record, in another language."""

import ast
import copy
import json
import pickle
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from job_builder import write_job
from messages_told import lines

import tankcal
from tankcal.errors import Problem, problem_of
from tankcal.job.rule_files import shipped_names, shipped_rule
from tankcal.messages import (
    as_plain,
    fields_of,
    join_with_and,
    list_some,
    message,
    printable,
    printable_lines,
)
from tankcal.record import record_of
from tankcal.record.schema import to_plain
from tankcal.text.shipped import DEFAULT, LANGUAGES
from tankcal.text.words import MESSAGES, load_words, message_sentence, translate_record

SOURCE = Path(tankcal.__file__).parent
OTHERS = [one for one in LANGUAGES if one != DEFAULT]
WORDS = {
    "language": {"marks": {"decimal": ",", "group": ".", "least": 4}},
    "inputs": {"tilt": "Inclinação"},
    "page": {"number": "Certificado n.º"},
    "labels": {"method": "Método"},
    "observed": {"image coordinate": "Coordenadas de imagem"},
    "observations": {"azimuth": "azimute", "slope_distances": "distância inclinada"},
    "warnings": {
        "known": "conhecido com {sd_mm:.1f} mm, {count} de {all:.3g}",
        "and_more": "{names} e mais {more}",
        "of": "de {names}",
        "off": "desvio de {off_ppm:+.0f} ppm",
        "undeclared": "não declarado: {inputs}",
        "group": "{group}, {kind}, {name}",
        "gone": "{nothing:.1f}",
        "lacking": "falta: {entries}",
    },
    "formulas": {"horizontal_lengths": "comprimentos vezes {scale:.8f}"},
}


def made():
    """{code: calls of `message` in the source}."""
    found = defaultdict(list)
    for path in SOURCE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if path.name == "messages.py" or "from tankcal.messages import" in text:
            for node in ast.walk(ast.parse(text)):
                if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "message":
                    found[node.args[0].value].append(node)
    return found


def values_of(call):
    """Names of the values that a call of `message` hands over."""
    template = call.args[1]
    if isinstance(template, ast.Constant):
        return fields_of(template.value)
    return {keyword.arg for keyword in call.keywords}


def in_portuguese(text):
    plainly = to_plain(as_plain(text))
    return message_sentence(WORDS, str(text), plainly["code"], plainly["values"])


# ---- in every language


@pytest.mark.slow
def test_each_code_is_made_in_one_place():
    places = made()
    assert len(places) > 150
    assert [code for code, calls in places.items() if len(calls) > 1] == []


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("language", OTHERS)
def test_language_has_every_message_with_its_values(language):
    words, places = load_words(language), made()
    said = {code: text for group in MESSAGES for code, text in words[group].items()}
    assert sum(len(words[group]) for group in MESSAGES) == len(said)
    assert set(said) == set(places)
    differing = [code for code, text in said.items() if fields_of(text) != values_of(*places[code])]
    assert differing == []


@pytest.mark.parametrize("language", OTHERS)
def test_language_has_texts_of_every_shipped_rule(language):
    texts = load_words(language)["rule_texts"]
    assert set(texts) == set(shipped_names())
    assert all(set(one) - {"clauses"} == {"name", "source", "remark"} for one in texts.values())
    for name, one in texts.items():
        rule = shipped_rule(name)
        limits = (*rule.deviation, *rule.reference_height, *rule.periods)
        assert set(one.get("clauses", ())) <= {limit.clause for limit in limits}


# ---- one message


@pytest.mark.parametrize(
    ("text", "english", "portuguese"),
    [
        (
            message("known", "to {sd_mm:.1f} mm, {count} of {all:.3g}", sd_mm=14.06, count=1234,
                    all=0.5),
            "to 14.1 mm, 1234 of 0.5",
            "conhecido com 14,1 mm, 1.234 de 0,5",
        ),
        (
            message("of", "of {names}", names=list_some(["a", "b", "c"], 2)),
            "of a, b and 1 more",
            "de a, b e mais 1",
        ),
        (message("of", "of {names}", names=list_some(["a", "b"], 2)), "of a, b", "de a, b"),
        (
            message("of", "of {names}", names=[message("off", "{off_ppm:+.0f} ppm", off_ppm=12.0)]),
            "of +12 ppm",
            "de desvio de +12 ppm",
        ),
        (
            message("undeclared", "not declared: {inputs}", inputs=["tilt", "scale"]),
            "not declared: tilt, scale",
            "não declarado: Inclinação; scale",
        ),
        (
            message("group", "{group} {kind} {name}", group="image coordinate", kind="azimuth",
                    name="azimuth"),
            "image coordinate azimuth azimuth",
            "coordenadas de imagem, azimute, azimuth",
        ),
        (
            message("group", "{group} {kind} {name}", group="t", kind="slope distance", name="1"),
            "t slope distance 1",
            "t, distância inclinada, 1",
        ),
        (
            message("lacking", "not given: {entries}", entries=["number", "method", "customer"]),
            "not given: number, method, customer",
            "falta: Certificado n.º; Método; customer",
        ),
        (message("gone", "{nothing:.1f}", nothing=float("nan")), "nan", "–"),
        (message("of", "of {names}", names="{names!r}"), "of {names!r}", "de {names!r}"),
        (message("unheard_of", "as it {verb}", verb="is"), "as it is", "as it is"),
        ("a plain text", "a plain text", "a plain text"),
    ],
)  # fmt: skip
def test_a_message_in_both_languages(text, english, portuguese):
    assert str(text) == english
    assert in_portuguese(text) == portuguese


def test_parts_in_a_row():
    assert join_with_and(["a"]) == "a"
    assert join_with_and(["a", "b", "c"]) == "a, b and c"


def test_copy_of_message_keeps_code_and_values():
    text = message("of", "of {names}", names=["a"])
    for other in (copy.deepcopy(text), pickle.loads(pickle.dumps(text))):
        assert (other, other.code, other.values) == ("of a", "of", {"names": ["a"]})


# ---- through the record


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    settings = {"tank.nominal_volume_m3": 10.0, "survey.shell_temperature_c": 31.5}
    folder = write_job(tmp_path_factory.mktemp("job") / "job", settings=settings)
    return tankcal.run(tankcal.load(folder))


def test_every_warning_of_the_record_has_its_code(result):
    record = to_plain(record_of(result))
    assert lines(result.warnings)
    assert [one["text"] for one in record["warnings"]] == [one.expected for one in result.warnings]
    assert all(one["code"] for one in record["warnings"])
    assert {"not_nominal", "undeclared", "certificate_incomplete"} <= {
        one["code"] for one in record["warnings"]
    }


def test_record_is_written_in_language_of_its_reader(result):
    record = record_of(result)
    told = translate_record(WORDS, record)
    (undeclared,) = (one for one in told["warnings"] if one["code"] == "undeclared")
    assert undeclared["text"].startswith("não declarado: ")
    (thermal,) = (one for one in told["corrections"] if one["code"] == "temperature")
    (scale,) = (one["formula_values"]["scale"] for one in record["corrections"]
                if one["code"] == "temperature")  # fmt: skip
    assert thermal["formula"] == f"comprimentos vezes {scale:.8f}".replace(".", ",")
    english = translate_record(load_words(DEFAULT), record)
    assert english | {"warnings": record["warnings"]} == record
    (undeclared,) = (one for one in english["warnings"] if one["code"] == "undeclared")
    assert "Tilt of the axis" in undeclared["text"]
    assert "tilt" not in undeclared["text"]


def test_a_record_without_codes_keeps_its_texts(result):
    record = record_of(result)
    old = record | {
        "warnings": [{"file": "a", "row": None, "column": None, "text": "as it was"}],
        "corrections": [{"code": "plate", "formula": "r - t"}],
        "adjustment": {"datum": {"words": ""}, "aside": ["point P1 is not measured"]},
    }
    told = translate_record(WORDS, old)
    assert told["warnings"] == old["warnings"]
    assert told["corrections"] == old["corrections"]
    assert told["adjustment"] == old["adjustment"]


def test_only_shipped_rules_are_translated(result):
    words = WORDS | {"rule_texts": {"oiml_r71": {"remark": "Não lido"}}}
    rule = {"code": "passed", "rule": {"name": "OIML R 71", "remark": "Not read"}}
    record = record_of(result) | {"rule": rule}
    assert translate_record(words, record)["rule"] == rule
    record["job"] = {"table": {"rule": "oiml_r71"}}
    told = translate_record(words, record)["rule"]
    assert told["rule"] == {"name": "OIML R 71", "remark": "Não lido"}


def test_a_text_of_an_array_is_quoted_as_any_other():
    """numpy's own texts, and a Message in quotes."""
    names = np.array(["A-1", "B"])
    assert message("of", "course {name!r}", name=names[0]) == "course 'A-1'"
    assert message("of", "{of!r}", of=message("known", "known")) == "'known'"
    assert message("of", "{count!r}", count=2) == "2"


def test_a_problem_is_plain_whatever_its_numbers_are():
    """JSON holds no numbers of numpy, and none that are not finite."""
    text = message("few", "{count} of {most}: {part:.1f}, {row}", count=np.int64(3), most=(1, 2),
                   part=float("nan"), row=np.array([1.5, 2.5]))  # fmt: skip
    plain = problem_of(Problem("courses.csv", text, np.int64(2), "course"))
    again = json.loads(json.dumps(plain, allow_nan=False))
    assert again["row"] == 2
    assert again["values"] == {"count": 3, "most": [1, 2], "part": None, "row": [1.5, 2.5]}


OBEYED = ["\x1b[2K", "\r", "\x07", "\x9b2K", "\u202e", "\u2028", "\ud800", "\x85"]


@pytest.mark.parametrize("mark", OBEYED)
def test_what_a_terminal_obeys_is_spelt_out(mark):
    text = message("problem", "{place}: {text}", place=[f"a{mark}b"], text=f"found {mark}")
    assert mark not in text
    assert mark not in printable(mark)
    assert mark not in printable_lines(mark)
    assert mark not in Problem(f"a{mark}", "is wrong").text


def test_other_characters_are_printed_as_they_are():
    assert printable("ção ñ 10¼ m³ 表 −") == "ção ñ 10¼ m³ 表 −"
    assert printable("a\tb\nc") == "a\\tb\\nc"
    assert printable_lines("a\tb\nc") == "a\tb\nc"
