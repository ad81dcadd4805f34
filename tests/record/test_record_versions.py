"""Records of every released version are read; no key comes or goes unless the version says so."""

import gzip
import json
import re

import pytest
from kept_records import KEPT, kept_files, layout_made, records_with_every_key
from paper_cells import paper_blocks
from schemas import keys_of_schema
from uncertain_job import as_before

from tankcal import report
from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.record import FORMAT, VERSION, load, migrated, version_of
from tankcal.record.making import Record
from tankcal.record.plain_data import to_plain
from tankcal.record.schema import checked, from_plain
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
        assert checked(plain, RECORD.schema(), "record.json") == ([], [])


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
    assert checked(read, RECORD.schema(), "record.json") == ([], [])


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [path if path.name in QUICK else pytest.param(path, marks=pytest.mark.study) for path in ALL],
    ids=lambda path: f"{path.parent.name}-{path.name}",
)
def test_everything_is_made_of_a_kept_record(path, tmp_path, monkeypatch):
    """`tankcal report`: tables, workbook and all cells of the papers; the pages are not set."""
    blocks = []
    monkeypatch.setattr(report, "build", lambda source, *_: blocks.extend(paper_blocks(source)))
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
