"""Long tables of a record beside record.json: the same record, and told where it is not there."""

import gzip
import json
import os
import shutil

import numpy as np
import pytest
from kept_records import kept_files
from paper_cells import paper_blocks
from test_adjustment_outputs import write_station

import tankcal
from tankcal.cli import main
from tankcal.errors import InputError, sheet_named
from tankcal.pipeline.chain import adjust_job
from tankcal.record import (
    columns,
    load,
    long_tables,
    migrated,
    read,
    record_of_adjustment,
    save,
)
from tankcal.record.columns import ArrayColumns, ArrayRows, Texts, column_of, values_of, whole
from tankcal.record.recomputation import compare_records
from tankcal.report import outputs
from tankcal.report.attachments import sha256
from tankcal.report.verification import verify

FILE = long_tables.FILE


@pytest.fixture
def few_rows(monkeypatch):
    """Tables of more than ten rows are long."""
    monkeypatch.setattr(columns, "MOST_ROWS", 10)


@pytest.fixture(scope="module")
def short():
    """A record of a tank and of its photographs, all of it lists and dicts."""
    (path,) = (one for one in kept_files(1) if one.name == "photographed.json.gz")
    return migrated(json.loads(gzip.decompress(path.read_bytes())), "record.json")


@pytest.fixture
def split(short, few_rows, tmp_path):
    """The folder of the same record, its long tables beside it."""
    save(short, tmp_path / "record.json")
    return tmp_path


# ---- columns


@pytest.mark.parametrize(
    "values",
    [
        [1.5, -0.0, 1e308, None],
        [None, None],
        [3, 0, None, -7],
        [True, False],
        ["a", None, "", "a", "é\0\n"],
        [sheet_named("directions"), "control.csv"],
        [["A", "B"], ["A"], [], ["B", "A", "C"]],
        [[True, False, True]],
        [[1.0, None], None, [2.0, 3.0]],
        [None, [[1.0, 2.0], [None, 4.0]]],
    ],
)
def test_a_column_gives_its_values_back(values):
    """Property; Python tells 0.0 from -0.0, True from 1 by their texts."""
    assert repr(values_of(column_of(values))) == repr(values)


def test_a_number_that_is_not_finite_is_null():
    assert values_of(np.array([np.inf, 1.0, np.nan])) == [None, 1.0, None]


def test_values_that_are_not_alike_are_no_column():
    with pytest.raises(TypeError, match="float, str"):
        column_of([1.0, "x"])


def test_rows_are_those_of_a_list():
    """Second method: a list of dicts."""
    listed = [{"name": name, "x": x} for name, x in zip("abc", (1.0, None, 3.0), strict=True)]
    rows = ArrayRows(ArrayColumns.of_rows(listed))
    assert rows == listed
    assert (rows[0], rows[-1], rows[1:]) == (listed[0], listed[-1], listed[1:])
    assert rows.columns | {"x": ["p", "q", "r"]} == {"name": [*"abc"], "x": ["p", "q", "r"]}
    with pytest.raises(IndexError):
        rows[3]


# ---- there and back


def test_a_split_record_is_the_same(split, short):
    """Second way: the record that was one file."""
    found = load(split / "record.json")
    assert json.dumps(whole(found)) == json.dumps(short)
    names = [one.point for one in read(split / "record.json").points]
    assert names == [row["point"] for row in short["points"]]
    kept = json.loads((split / "record.json").read_bytes())
    assert kept["points"] is kept["adjustment"]["points"] is kept["adjustment"]["residuals"] is None
    said = kept["long_tables"]
    content = (split / FILE).read_bytes()
    assert (said["sha256"], said["bytes"]) == (sha256(content), len(content))
    assert said["rows"]["points"] == len(short["points"])


def test_a_loaded_record_is_saved_with_the_same_bytes(split, tmp_path_factory):
    folder = tmp_path_factory.mktemp("again")
    save(load(split / "record.json"), folder / "record.json")
    for name in ("record.json", FILE):
        assert (folder / name).read_bytes() == (split / name).read_bytes()


def test_a_short_record_is_one_file(short, tmp_path):
    save(short, tmp_path / "record.json")
    assert [one.name for one in tmp_path.iterdir()] == ["record.json"]


# ---- a file that is missing, altered, or another one


def test_what_needs_no_long_table_needs_no_file(split, short):
    (split / FILE).unlink()
    found = load(split / "record.json")
    assert found["capacity"] == short["capacity"]
    assert len(found["points"]) == len(short["points"])
    with pytest.raises(InputError, match=rf"{FILE}: cannot be read .*expected it beside record.js"):
        list(found["points"])


@pytest.mark.slow
def test_an_export_needs_no_file(split, tmp_path_factory):
    """Second way: the file beside it."""
    out = tmp_path_factory.mktemp("exports")
    asked = ["export", str(split), "--profile", "csv", "--out"]
    assert main([*asked, str(out / "with.csv")]) == 0
    (split / FILE).unlink()
    assert main([*asked, str(out / "without.csv")]) == 0
    assert (out / "without.csv").read_bytes() == (out / "with.csv").read_bytes()
    bare = read(split / "record.json", tables=False)
    assert bare.points is bare.adjustment.points is bare.adjustment.residuals is None


def replaced_by_a_pipe(path):
    (path / FILE).unlink()
    os.mkfifo(path / FILE)


def spoilt(path, **arrays):
    """Put arrays into the file beside a record, which names it again."""
    with np.load(path / FILE) as held:
        np.savez_compressed(path / FILE, **{**held, **arrays})
    record = json.loads((path / "record.json").read_bytes())
    record["long_tables"]["sha256"] = sha256((path / FILE).read_bytes())
    (path / "record.json").write_text(json.dumps(record), encoding="utf-8")


@pytest.mark.slow(after=6)
@pytest.mark.parametrize(
    ("spoil", "line"),
    [
        (lambda path: (path / FILE).unlink(), f"{FILE}: cannot be read (No such file"),
        (replaced_by_a_pipe, f"{FILE}: cannot be read (Invalid argument)"),
        (lambda path: (path / FILE).write_bytes(b"x"), f"{FILE}: was altered: its SHA-256 is "),
        (lambda path: spoilt(path, **{"points.x_m": np.zeros(3)}), f"{FILE}: does not hold the "),
        (lambda path: spoilt(path, **{"points.x_m": np.array(["x"] * 48)}), f"{FILE}: does not "),
        (lambda path: spoilt(path, **{"points.point": np.arange(99)}), f"{FILE}: does not hold "),
        (
            lambda path: spoilt(path, **{"points.x_m": np.zeros(48, np.longdouble)}),
            f"{FILE}: does not hold ",
        ),
    ],
)
def test_another_file_is_told_in_one_line(split, tmp_path_factory, capsys, spoil, line):
    spoil(split)
    out = tmp_path_factory.mktemp("papers") / "out"
    assert main(["report", str(split / "record.json"), "--out", str(out), "--quiet"]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith(f"tankcal: {line}")
    assert not out.exists()


def test_a_record_that_names_no_file_is_told_in_one_line(split):
    record = json.loads((split / "record.json").read_bytes())
    del record["long_tables"]
    (split / "record.json").write_text(json.dumps(record), encoding="utf-8")
    with pytest.raises(InputError, match=r"record\.json: without points, adjustment.points, "):
        load(split / "record.json")


@pytest.mark.parametrize("name", ["", ".", "x.npz", "x" * 5000, "record.json"])
def test_a_record_that_names_another_file_is_told_in_one_line(split, name):
    record = json.loads((split / "record.json").read_bytes())
    record["long_tables"]["file"] = name
    (split / "record.json").write_text(json.dumps(record), encoding="utf-8")
    with pytest.raises(InputError, match=r"record\.json: without points, adjustment.points, "):
        load(split / "record.json")


@pytest.mark.parametrize(
    ("place", "null"),
    [("points.point", -1), ("adjustment.residuals.file", -1)]
    + [("adjustment.residuals.repeats", columns.NO_INTEGER)],
)
def test_null_is_no_value_where_a_short_record_has_none(split, place, null):
    with np.load(split / FILE) as held:
        column = held[place]
    spoilt(split, **{place: np.where(np.arange(len(column)) == 3, null, column)})
    with pytest.raises(InputError, match=rf"{FILE}: does not hold .*{place}"):
        list(load(split / "record.json")["points"])


# ---- a survey as it is run


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    """A job, its adjustment, and its results in one file and in two."""
    folder = tmp_path_factory.mktemp("survey")
    job = tankcal.load(write_station(folder / "job"), only="adjustment")
    adjustment = adjust_job(job)
    outputs.write_adjustment(job, adjustment, folder / "one")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(columns, "MOST_ROWS", 10)
        outputs.write_adjustment(job, adjustment, folder / "two")
    return job, adjustment, folder


@pytest.mark.slow
def test_papers_of_a_split_record_are_the_same(survey, few_rows):
    """Second way: the record that is one file."""
    *_, folder = survey
    one, two = folder / "one", folder / "two"
    names = {path.name for path in two.iterdir()}
    assert names == {path.name for path in one.iterdir()} | {FILE}
    for path in one.glob("*.csv"):
        assert path.read_bytes() == (two / path.name).read_bytes()
    found, expected = (paper_blocks(folder / name / "record.json") for name in ("two", "one"))
    for document in (*found[:1], *expected[:1]):
        document.pop("attachments")
        document.pop("footer")
        document.pop("record_sha256")
    assert found == expected


@pytest.mark.slow
def test_a_split_record_is_verified(survey, few_rows, tmp_path):
    *_, folder = survey
    out = shutil.copytree(folder / "two", tmp_path / "two")
    found = verify(out, folder / "job")
    assert (found.problems, found.notes) == ([], [])
    assert found.recomputed.agrees
    assert found.recomputed.different == 0
    assert {FILE, "residuals.csv"} <= set(found.compared)
    paper = shutil.copyfile(out / "working-papers.pdf", tmp_path / "alone.pdf")
    alone = verify(paper, folder / "job")
    assert (alone.problems, alone.recomputed.numbers) == ([], found.recomputed.numbers)
    (out / FILE).write_bytes((out / FILE).read_bytes()[:-1])
    told = {(one.file, one.expected.code) for one in verify(out).problems}
    assert told == {
        (FILE, "record_tables_altered"),
        ("working-papers.pdf", "verify_differs_inside"),
    }


@pytest.mark.slow
def test_long_tables_are_compared_number_by_number(survey, few_rows, monkeypatch):
    """Second method: the same records as lists."""
    job, adjustment, _ = survey
    long = record_of_adjustment(job, adjustment)
    listed = whole(long)
    moved = whole(long)
    moved["points"][3] = moved["points"][3] | {"x_m": moved["points"][3]["x_m"] + 0.001}
    residuals = moved["adjustment"]["residuals"]
    residuals["kind"] = ["sight", *residuals["kind"][1:]]
    assert isinstance(long["points"], ArrayRows)
    for one in (long, listed):
        same = compare_records(one, long)
        assert (same.agrees, same.different, same.largest) == (True, 0, None)
    found = compare_records(long, moved)
    monkeypatch.setattr(columns, "MOST_ROWS", 10_000)
    expected = compare_records(listed, moved)
    assert found == expected
    assert [one.place for one in found.beyond] == ["points[3].x_m"]
    assert [one[0] for one in found.otherwise] == ["adjustment.residuals.kind[0]"]


@pytest.mark.parametrize(
    ("was", "now"),
    [
        ([None, 2, 3, 4], [None, 2, 3, 5]),
        ([None, None, None, None], [None, None, "a", None]),
        ([None, None, None, None], [None, None, [1.0, 2.0], None]),
        ([1.0, 2.0, None, 4.0], [1.0, 2.0, 3.0, 4.1]),
        (None, [1, 2, 3, 4]),
        (["a", None, "b", "c"], None),
    ],
)
def test_columns_that_are_not_alike_are_told_as_those_of_lists(was, now, monkeypatch):
    """Second method: the same tables as lists; nulls are no numbers, nor a column an error."""
    made = {"tankcal": "1", "versions": {}}
    of = [{"x": [1.0] * 4} | ({} if one is None else {"y": one}) for one in (was, now)]
    one, two = (made | {"adjustment": {"residuals": table}} for table in of)
    expected = compare_records(one, two)
    monkeypatch.setattr(columns, "MOST_ROWS", 3)
    found = compare_records(one, two)
    assert not found.agrees
    assert (found.largest, found.beyond) == (expected.largest, expected.beyond)
    assert {told[0] for told in found.otherwise} <= {told[0] for told in expected.otherwise}
    if was is not None and now is not None:
        assert found.numbers == expected.numbers


def test_texts_of_a_file_are_looked_at():
    with pytest.raises(ValueError, match="texts"):
        long_tables._make_texts(np.array([0, 2]), ["a", "b"])
    assert long_tables._make_texts(np.array([1, -1]), ["a", "b"]).tolist() == ["b", None]
    assert isinstance(Texts.of([]), Texts)
