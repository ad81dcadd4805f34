"""Dataclasses to JSON and back, the JSON schema that follows from them, and what it refuses."""

import copy
import gzip
import json
import re
from dataclasses import dataclass

import numpy as np
import pytest
from kept_records import kept_files
from kept_results import kept_files as kept_results
from kept_results import read
from schemas import DOCS, SAVED, documented, keys_of_schema, schema_text

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.messages import Message, message
from tankcal.record import load, migrated
from tankcal.record.making import Record
from tankcal.record.schema import (
    MOST_PROBLEMS,
    Finite,
    check_data,
    fill_from,
    from_plain,
    json_schema,
    key,
    to_plain,
)

STALE = "make schemas writes schemas and docs anew"
HOSTILE = (
    None, True, -1, 0.5, 1e308, float("inf"), 10**400, "", "x", [], {}, [[]], [None], [7], {"a": 1},
    "\u202e", [[[[[[1]]]]]], {"code": {}}, "9" * 5000,
)  # fmt: skip


@dataclass(frozen=True)
class Part:
    """A part of a thing."""

    name: str = key("what it is called")
    size_mm: float = key("its size", of="size_m", times=1e3)


@dataclass(frozen=True)
class Thing:
    """Something of each type."""

    source: str = key("a key that is no name of Python", named="from")
    count: int = key("a whole number")
    volume_m3: list[Finite] = key("numbers that are never null")
    matrix: np.ndarray = key("an array")
    pair: tuple[float, float] = key("two numbers")
    said: Message = key("a text with its code")
    parts: list[Part] = key("objects")
    sd: float = key("null: not known")
    note: str | None = key("null: there is none")
    extra: str | None = key("left out when there is none", optional=True)


def thing(**changed):
    said = message("a_test", "{count} of them", count=3)
    parts = [fill_from(Part, type("Source", (), {"name": "a", "size_m": 0.002}))]
    values = dict(
        source="x", count=3, volume_m3=[1.0, 2.0], matrix=np.eye(2), pair=(1.0, 2.0), said=said,
        parts=parts, sd=np.nan, note=None, extra=None,
    )  # fmt: skip
    return Thing(**(values | changed))


def kept(name):
    (path,) = (one for one in kept_files(1) if one.name == name)
    return json.loads(gzip.decompress(path.read_bytes()))


# ---- there and back


def test_a_dataclass_as_plain_data():
    assert to_plain(thing()) == {
        "from": "x",
        "count": 3,
        "volume_m3": [1.0, 2.0],
        "matrix": [[1.0, 0.0], [0.0, 1.0]],
        "pair": [1.0, 2.0],
        "said": "3 of them",
        "parts": [{"name": "a", "size_mm": 2.0}],
        "sd": None,
        "note": None,
        "said_code": "a_test",
        "said_values": {"count": 3},
    }


def test_a_dataclass_comes_back():
    back = from_plain(Thing, to_plain(thing()))
    assert np.isnan(back.sd)
    assert (back.note, back.extra) == (None, None)
    assert back.pair == (1.0, 2.0)
    assert back.parts == [Part("a", 2.0)]
    assert back.matrix == pytest.approx(np.eye(2))
    assert (back.said, back.said.code, back.said.values) == ("3 of them", "a_test", {"count": 3})
    assert to_plain(from_plain(Thing, to_plain(thing(extra="y")))) == to_plain(thing(extra="y"))


# ---- what is wrong, with the path of the key


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"volume_m3": [1.0, "x"]}, "t.json, volume_m3[1]: found 'x', expected a number"),
        ({"volume_m3": [None, 1.0]}, "t.json, volume_m3[0]: found null, expected a number"),
        ({"count": 2.5}, "t.json, count: found 2.5, expected a whole number"),
        ({"count": True}, "t.json, count: found true, expected a whole number"),
        ({"sd": [1]}, "t.json, sd: found list, expected a number"),
        ({"sd": float("inf")}, "t.json, sd: found inf, expected a number smaller than 1e+100"),
        ({"sd": -1e308}, "t.json, sd: found -1e+308, expected a number smaller than 1e+100"),
        ({"sd": float("nan")}, "t.json, sd: found nan, expected a number"),
        ({"pair": [1.0]}, "t.json, pair: found 1 values, expected 2"),
        ({"note": 7}, "t.json, note: found 7, expected a text"),
        ({"parts": [{"name": "a"}]}, "t.json, parts[].size_mm: missing"),
        ({"parts": [{"name": None, "size_mm": 1}]}, "t.json, parts[0].name: found null, expected"),
        ({"parts": 7}, "t.json, parts: missing"),
    ],
)
def test_each_problem_is_one_line_with_its_path(change, line):
    with pytest.raises(InputError) as told:
        from_plain(Thing, to_plain(thing()) | change, "t.json")
    (problem,) = told.value.problems
    assert str(problem).startswith(line)


def test_a_number_that_no_float_holds_is_refused():
    with pytest.raises(InputError, match=r"volume_m3\[0\]: found 1000.*, expected a number"):
        from_plain(Thing, to_plain(thing()) | {"volume_m3": [10**400]})


def test_first_of_many_problems_are_reported():
    plain = to_plain(thing()) | {"volume_m3": ["x"] * 99}
    _, found = check_data(plain, json_schema(Thing), "t")
    assert len(found) == MOST_PROBLEMS + 1
    assert "further values" in str(found[-1])


def test_all_wrong_values_of_record_are_reported(tmp_path, capsys):
    record = kept("film.json.gz")
    record["adjustment"]["sigma0"] = "high"
    record["points"][2]["x_m"] = {"a": 1}
    path = tmp_path / "record.json"
    path.write_text(json.dumps(record), encoding="utf-8")
    assert main(["report", str(path), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    assert capsys.readouterr().err.splitlines() == [
        "tankcal: record.json, points[2].x_m: found dict, expected a number",
        "tankcal: record.json, adjustment.sigma0: found 'high', expected a number",
    ]


def places(value, path=()):
    """Paths of everything in plain data; of a list its first row."""
    yield path
    if isinstance(value, dict | list):
        pairs = value.items() if isinstance(value, dict) else list(enumerate(value))[:1]
        for one, item in pairs:
            yield from places(item, (*path, one))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "every"),
    [
        ("furnished.json.gz", 5),
        pytest.param("furnished.json.gz", 1, marks=pytest.mark.study),
        pytest.param("film.json.gz", 1, marks=pytest.mark.study),
    ],
)
def test_spoilt_record_is_read_or_refused_in_words(name, every):
    """Property: any value of a record replaced by any other; nothing but InputError comes out."""
    record, rng = kept(name), np.random.default_rng(len(name))
    refused = 0
    for path in list(places(record))[1::every]:
        spoilt = copy.copy(record)
        parent = spoilt
        for one in path[:-1]:
            parent[one] = copy.copy(parent[one])
            parent = parent[one]
        parent[path[-1]] = HOSTILE[rng.integers(len(HOSTILE))]
        told = problems_of(spoilt)
        assert all(str(one).startswith("record.json") for one in told), path
        assert sum(len(str(one)) for one in told) < 10_000
        refused += bool(told)
    assert refused > 100 / every


def problems_of(record):
    """What is wrong with a record; () when it is read. Anything but InputError is raised."""
    try:
        migrated(record, "record.json")
    except InputError as error:
        return error.problems
    return ()


@pytest.mark.parametrize("cut", [0, 1, 100, 5000, -2])
def test_a_record_cut_short_is_refused_in_one_line(cut, tmp_path):
    text = json.dumps(kept("film.json.gz"))
    (tmp_path / "record.json").write_text(text[:cut], encoding="utf-8")
    with pytest.raises(InputError, match=r"record\.json: cannot be read as a record") as told:
        load(tmp_path / "record.json")
    assert len(told.value.problems) == 1


# ---- the schemas that are shipped


def validator_of(schema):
    """The validator of another program, loaded by the worker that needs it: it takes a second."""
    from jsonschema import Draft202012Validator

    return Draft202012Validator(schema)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("saved_format", "kind", "cls"), SAVED, ids=lambda one: getattr(one, "__name__", None)
)
def test_a_schema_is_that_of_its_dataclass(saved_format, kind, cls):
    path = saved_format.schema_file(kind)
    assert path.read_text(encoding="utf-8") == schema_text(saved_format, kind, cls), STALE
    type(validator_of(saved_format.schema(kind))).check_schema(saved_format.schema(kind))


@pytest.mark.slow
@pytest.mark.parametrize("path", kept_files(), ids=lambda path: f"{path.parent.name}-{path.name}")
def test_another_program_finds_a_record_valid(path):
    """Other program: jsonschema, by the schema that is shipped."""
    (saved_format, kind, _) = next(one for one in SAVED if one[2] is Record)
    record = saved_format.migrated(json.loads(gzip.decompress(path.read_bytes())), path.name)
    validator_of(saved_format.schema(kind)).validate(record)


@pytest.mark.slow(after=5)
@pytest.mark.parametrize("row", kept_results(), ids=lambda row: str(row[2])[-30:])
def test_another_program_finds_a_result_valid(row):
    """Other program: jsonschema, by the schema that is shipped."""
    saved_format, _, path = row
    found = saved_format.migrated(read(path), path.name)
    validator_of(saved_format.schema(found.get("kind"))).validate(found)


def test_json_schema_refuses_the_same_records():
    """Other program: each single change of a value to one of another type."""
    schema = json_schema(Thing)
    judge = validator_of(schema)
    plain = to_plain(thing())
    assert judge.is_valid(plain)
    for one in plain:
        for value in (None, True, 2.5, "x", [], {}, [["x"]]):
            spoilt = plain | {one: value}
            assert judge.is_valid(spoilt) == _is_accepted(spoilt), (one, value)


def _is_accepted(plain):
    try:
        from_plain(Thing, plain)
    except InputError:
        return False
    return True


def test_the_list_of_keys_in_the_docs_is_that_of_the_dataclasses():
    assert DOCS.read_text(encoding="utf-8") == documented(), STALE


def test_record_description_names_every_key():
    text = DOCS.with_name("record-format.md").read_text(encoding="utf-8")
    told = set(re.findall(r"[A-Za-z_][A-Za-z0-9_]*", text))
    keys = {one.rpartition(".")[2] for one in keys_of_schema(json_schema(Record))} - {"*"}
    assert sorted(keys - told) == []
