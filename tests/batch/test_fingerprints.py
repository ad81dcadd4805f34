"""A step's key changes with all that bears on it, and with nothing else."""

from dataclasses import replace

import pytest
from batch_jobs import write_jobs
from job_builder import write_workbook

import tankcal
from tankcal.products.batch.finding import BatchJob
from tankcal.products.batch.journal import compute_keys, digest_inputs
from tankcal.products.batch.outcomes import Options

ALL = Options(steps=("run", "compare", "inspect"))


@pytest.fixture
def job(tmp_path):
    folder = write_jobs(tmp_path, 1) / "T-0"
    return BatchJob("T-0", "T-0", str(folder), ALL)


def changed(job, before, **more):
    return {step for step, key in compute_keys(job, **more).items() if key != before[step]}


@pytest.mark.parametrize(
    ("file", "expected"),
    [
        ("points.csv", {"run", "compare", "inspect"}),
        ("settlement.csv", {"run", "compare", "inspect"}),
        ("scans/a.las", {"run", "compare", "inspect"}),
        ("photo.JPG", set()),
        ("~$job.xlsx", set()),
        (".hidden", set()),
        ("results/record.json", set()),
        ("results/capacity.csv", {"run", "compare", "inspect"}),  # no results: there is no record
    ],
)
def test_a_file_of_the_job(job, tmp_path, file, expected):
    before = compute_keys(job)
    path = tmp_path / "T-0" / file
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(b"other")
    assert changed(job, before) == expected


def test_the_time_of_a_file_does_not_count(job, tmp_path):
    before = compute_keys(job)
    path = tmp_path / "T-0" / "points.csv"
    path.write_bytes(path.read_bytes())
    assert changed(job, before) == set()


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"papers": False}, {"run"}),
        ({"language": "es"}, {"compare", "inspect"}),
        ({"inspect_by": "api_650"}, {"inspect"}),
        ({"compare_by": "other"}, {"compare"}),
    ],
)
def test_options(job, changes, expected):
    before = compute_keys(job)
    assert changed(replace(job, options=replace(ALL, **changes)), before) == expected


def test_rule_and_letterhead_count_by_their_content(job, tmp_path):
    path = tmp_path / "house.toml"
    path.write_text("a = 1")
    of_rule = replace(job, options=replace(ALL, inspect_by=str(path)))
    before = compute_keys(of_rule)
    path.write_text("a = 22")
    assert changed(of_rule, before) == {"inspect"}
    headed = replace(job, options=replace(ALL, letterhead=str(path)))
    before = compute_keys(headed)
    path.write_text("a = 333")
    assert changed(headed, before) == {"run", "compare", "inspect"}


def test_the_former_table(job, tmp_path):
    table, declared = tmp_path / "old.csv", tmp_path / "old.toml"
    table.write_text("a")
    declared.write_text('[former]\nfile = "old.csv"\n')
    for path in (table, declared):
        table.write_text("a")
        before = compute_keys(job, path)
        table.write_text("bb")
        assert changed(job, before, former=path) == {"compare"}


def test_the_version(job, monkeypatch):
    before = compute_keys(job)
    monkeypatch.setattr(tankcal, "__version__", "99")
    assert changed(job, before) == {"run", "compare", "inspect"}


def test_a_workbook_with_what_it_names(tmp_path):
    book = tmp_path / "T-1.xlsx"
    write_workbook(book, settings={"tank.note": "see tank.stl"})
    write_workbook(tmp_path / "T-2.xlsx")
    for name in ("tank.stl", "other.stl", "settlement.csv"):
        (tmp_path / name).write_text("x")
    assert [name for name, _ in digest_inputs(book)] == ["T-1.xlsx", "settlement.csv", "tank.stl"]
    assert digest_inputs(tmp_path / "none.xlsx") == []
