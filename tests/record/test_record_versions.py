"""Records of every released version are read; no key comes or goes unless the version says so."""

import gzip
import json
import re

import pytest
from kept_records import KEPT, kept_files, layout_made, records_with_every_key
from paper_cells import paper_blocks
from schemas import keys_of_schema
from uncertain_job import as_before

from tankcal.cli import main
from tankcal.errors import CellError, InputError
from tankcal.record import FORMAT, VERSION, load, migrated, version_of
from tankcal.record.making import Record
from tankcal.record.schema import MOST_PROBLEMS, check_data, from_plain, to_plain
from tankcal.record.versions import RECORD
from tankcal.report import outputs

ALL = kept_files()
QUICK = ("film.json.gz", "uncertain.json.gz", "photographed.json.gz")  # between them, every part
WHAT_TO_DO = f"""The keys of the record are not those of version {VERSION} any more.
Is tests/records/{VERSION}/keys.txt not there, it is still being made. Then:
1. make schemas writes its schema and docs/saved-keys.md anew;
2. tankcal/record/versions.py: the last step says what an older record gets for each new key.
Is it there, the version has been released: count VERSION up, begin a new step, and do the same."""


@pytest.fixture(scope="module")
def made(records_of_kinds, tmp_path_factory):
    """{kind: record} as the program makes them now."""
    return records_with_every_key(tmp_path_factory.mktemp("records"), records_of_kinds)


def kept(path):
    return json.loads(gzip.decompress(path.read_bytes()))


@pytest.mark.slow
def test_no_key_comes_or_goes_without_the_version(made):
    """A key that may be left out asks for no version of its own."""
    found, schema = set(layout_made(made)), RECORD.schema()
    came = sorted(found - keys_of_schema(schema, optional=True))
    went = sorted(keys_of_schema(schema) - found)
    assert (came, went) == ([], []), WHAT_TO_DO


@pytest.mark.slow
def test_a_record_has_every_key_of_its_version(made):
    for record in made.values():
        assert record["format"] == FORMAT
        plain = json.loads(json.dumps(record))
        assert check_data(plain, RECORD.schema(), "record.json") == ([], [])


@pytest.mark.slow
def test_a_record_goes_into_its_dataclass_and_back(made):
    """Second way: every key has its field, and the types of the fields are those of the values."""
    for record in made.values():
        plain = json.loads(json.dumps(record))
        assert to_plain(from_plain(Record, plain)) == plain


def test_every_version_has_kept_records_with_all_keys():
    """A list of keys that was released stays as it is: the kept records say the same."""
    listed = {int(path.parent.name): path for path in KEPT.glob("*/keys.txt")}
    assert set(listed) >= set(range(1, VERSION))
    for version, path in listed.items():
        records = {one: kept(one) for one in kept_files(version)}
        assert layout_made(records) == path.read_text(encoding="utf-8").split(), version


@pytest.mark.parametrize("path", ALL, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_a_kept_record_is_read_as_one_of_this_version(path):
    record = kept(path)
    before = json.dumps(record)
    assert version_of(record) == int(path.parent.name)
    read = migrated(record, "record.json")
    assert json.dumps(record) == before
    assert read["format"] == FORMAT
    assert check_data(read, RECORD.schema(), "record.json") == ([], [])


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [path if path.name in QUICK else pytest.param(path, marks=pytest.mark.study) for path in ALL],
    ids=lambda path: f"{path.parent.name}-{path.name}",
)
def test_everything_is_made_of_a_kept_record(path, tmp_path, monkeypatch):
    """`tankcal report`: tables, workbook and all cells of the papers; the pages are not set."""
    blocks = []
    monkeypatch.setattr(outputs, "build", lambda source, *_: blocks.extend(paper_blocks(source)))
    source = tmp_path / "record.json"
    source.write_bytes(gzip.decompress(path.read_bytes()))
    assert main(["report", str(source), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    assert (tmp_path / "out" / "record.json").read_bytes() == source.read_bytes()
    assert {one.suffix for one in (tmp_path / "out").iterdir()} >= {".csv", ".xlsx"}
    assert len(blocks) > 20


def test_a_draft_of_version_1_is_read(tmp_path):
    """It had neither intervals nor Monte Carlo: those of the law of propagation counted."""
    (path,) = (one for one in kept_files(1) if one.name == "uncertain.json.gz")
    old = as_before(kept(path))
    read = migrated(old, "record.json")["capacity"]
    assert set(read["interval"]) == {"gum"}
    assert read["stated_U_m3"] == old["capacity"]["U_m3"]
    ends = zip(read["low_m3"], read["high_m3"], read["volume_m3"], read["U_m3"], strict=True)
    assert all(low == volume - U and high == volume + U for low, high, volume, U in ends)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda record: record.pop("capacity"), "tankcal-record/1 without capacity,"),
        (lambda record: record["capacity"].pop("k"), "tankcal-record/1 without capacity.k,"),
        (lambda record: record["budget"][0].pop("u"), r"without budget\[\]\.u,"),
        (
            lambda record: record["job"].update(table=7),
            "tankcal-record/1 without job.table.coverage",
        ),
        (lambda record: record.update(sections=7), "tankcal-record/1 without sections,"),
        (
            lambda record: record.update(format="tankcal-record/99"),
            "found format .tankcal-record/99.",
        ),
        (lambda record: record.update(format=2), "found format 2, expected"),
        (lambda record: record.update(format="tankcal-record/²"), "found format"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line(spoil, words, tmp_path, capsys):
    record = kept(kept_files(1)[-1])
    spoil(record)
    path = tmp_path / "record.json"
    path.write_text(json.dumps(record), encoding="utf-8")
    with pytest.raises(InputError) as told:
        load(path)
    assert len(told.value.problems) == 1
    assert re.search(words, str(told.value)), str(told.value)
    assert main(["report", str(path), "--out", str(tmp_path / "out")]) == 2
    (line,) = [one for one in capsys.readouterr().err.splitlines() if "record.json" in one]
    assert "Error" not in line
    assert not (tmp_path / "out").exists()


def test_a_folder_of_results_is_kept_when_its_record_is_refused(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "record.json").write_text('{"format": "tankcal-record/99"}', encoding="utf-8")
    with pytest.raises(InputError, match="tankcal-record/99"):
        outputs.rebuild(out, out)
    assert [one.name for one in out.iterdir()] == ["record.json"]


def numbers_in(value, schema, root, path=()):
    """The path of each number in data, and whether null may stand for it by the schema."""
    schema = schema["anyOf"][0] if "anyOf" in schema else schema
    while "$ref" in schema:
        schema = root["$defs"][schema["$ref"].rpartition("/")[2]]
    if isinstance(value, dict):
        known, other = schema.get("properties", {}), schema.get("additionalProperties", {})
        for name, item in value.items():
            yield from numbers_in(item, known.get(name, other), root, (*path, name))
    elif isinstance(value, list):
        for number, item in enumerate(value[:2]):
            yield from numbers_in(item, schema.get("items", {}), root, (*path, number))
    elif type(value) in (int, float) and "type" in schema:
        yield path, "null" in schema["type"]


def spoilt(record, paths):
    """A copy of the record with null at each path, and what problems call them."""
    record, names = json.loads(json.dumps(record)), []
    for *above, last in paths:
        place = record
        for step in above:
            place = place[step]
        place[last] = None
        steps = (f"[{step}]" if isinstance(step, int) else f".{step}" for step in (*above, last))
        names.append("".join(steps).removeprefix("."))
    return record, names


@pytest.mark.slow
def test_null_in_place_of_a_number_is_one_line_with_its_key():
    """Every number that no record is without, the first two of each list; the others may be."""
    seen, schema = set(), RECORD.schema()
    for path in (one for one in ALL if one.name in QUICK):
        record = migrated(kept(path), "record.json")
        found = {}
        for place, nullable in numbers_in(record, schema, schema):
            key = tuple(step for step in place if not isinstance(step, int))
            if not nullable and key not in seen:
                found.setdefault((key, place[-1]), place)
        seen |= {key for key, _ in found}
        for places in batched(found.values(), MOST_PROBLEMS):
            other, names = spoilt(record, places)
            with pytest.raises(InputError) as told:
                migrated(other, "record.json")
            lines = [str(one).partition(": found null, expected a ") for one in told.value.problems]
            assert sorted(line[0] for line in lines) == sorted(f"record.json, {n}" for n in names)
            assert all(line[1] for line in lines)
    places = {f"{of}.{axis}_m" for of in ("points", "adjustment.photos") for axis in "xyz"}
    assert {*places, "sections.outline.radius_m"} <= {".".join(key) for key in seen}


def batched(values, size):
    values = list(values)
    return (values[start : start + size] for start in range(0, len(values), size))


def test_the_command_names_a_null_coordinate(tmp_path, capsys):
    (path,) = (one for one in ALL if one.name == "photographed.json.gz")
    other, _ = spoilt(kept(path), [("points", 1, "z_m")])
    (tmp_path / "record.json").write_text(json.dumps(other), encoding="utf-8")
    assert main(["report", str(tmp_path), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    expected = "tankcal: record.json, points[1].z_m: found null, expected a number\n"
    assert capsys.readouterr().err == expected
    assert not (tmp_path / "out").exists()


def test_a_cell_that_cannot_work_with_a_record_is_the_records_fault(tmp_path, monkeypatch):
    """Null where only some tanks may have it: no schema tells, the cell that needs it does."""

    def stopped(*_):
        raise CellError("the report stopped in cell 10: TypeError")

    (tmp_path / "record.json").write_text(json.dumps(kept(ALL[-1])), encoding="utf-8")
    monkeypatch.setattr(outputs, "_write", stopped)
    with pytest.raises(InputError, match=r"record\.json: .*content of a record .*cell 10"):
        outputs.rebuild(tmp_path, tmp_path / "out")
