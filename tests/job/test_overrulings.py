"""overrulings.csv: what it may say, in a folder and in a workbook, and what is refused."""

import pytest
from job_builder import hit_parts, job_parts, strapped_parts, write_book, write_folder

from tankcal.errors import InputError
from tankcal.job import load

HEADINGS = ["point", "table", "row", "decision", "reason", "by", "date"]


def with_rows(*rows, parts=None, headings=HEADINGS):
    parts = job_parts() if parts is None else parts
    parts.tables["overrulings"] = [headings, *rows]
    return parts


def names_of(parts):
    return [row[0] for row in parts.tables["points"][1:]]


def row(parts, number, **changes):
    given = [names_of(parts)[number], None, None, "keep", "dent", None, None]
    cells = dict(zip(HEADINGS, given, strict=True))
    return [(cells | changes)[name] for name in HEADINGS]


def problems_of(path):
    with pytest.raises(InputError) as caught:
        load(path)
    return caught.value.problems


@pytest.mark.parametrize("write", [write_folder, write_book])
def test_decisions_are_read(tmp_path, write):
    parts = job_parts()
    parts = with_rows(
        row(parts, 0, by="J. Silva", date="2024-06-01"),
        row(parts, 30, decision="leave_out"),
        parts=parts,
    )
    kept, left = load(write(tmp_path / "job.xlsx", parts)).overrulings
    assert (kept.point, kept.decision, kept.reason) == (names_of(parts)[0], "keep", "dent")
    assert (kept.by, kept.date, kept.is_kept) == ("J. Silva", "2024-06-01", True)
    assert (left.what, left.decision, left.by) == (names_of(parts)[30], "leave_out", "")
    assert (kept.row, left.row) == (2, 3)


def test_words_of_forms_in_other_languages(tmp_path):
    parts = job_parts()
    rows = [row(parts, 0, decision="manter"), row(parts, 30, decision="retirar")]
    found = load(write_folder(tmp_path / "job", with_rows(*rows, parts=parts))).overrulings
    assert [one.decision for one in found] == ["keep", "leave_out"]


def test_headings_alone_are_no_decision(tmp_path):
    assert load(write_folder(tmp_path / "job", with_rows())).overrulings == ()


@pytest.mark.parametrize(
    ("changes", "column", "code"),
    [
        ({"point": "P-9"}, "point", "overruled_unknown"),
        ({"point": None}, "point", "overruled_nothing"),
        ({"reason": None}, "reason", "blank_cell"),
        ({"reason": "   "}, "reason", "blank_cell"),
        ({"decision": None}, "decision", "blank_cell"),
        ({"decision": "delete"}, "decision", None),
        ({"table": "directions"}, "table", "overruled_both"),
        ({"row": 3}, "row", "overruled_both"),
        ({"point": None, "table": "directions"}, "row", "overruled_half"),
        ({"point": None, "row": 3}, "table", "overruled_half"),
        ({"point": None, "table": "points", "row": 3}, "table", None),
        ({"point": None, "table": "directions", "row": 3}, "table", "overruled_no_table"),
        ({"point": None, "table": "directions", "row": 3.5}, "row", "row_not_whole"),
        ({"point": None, "table": "directions", "row": 1}, "row", None),
        ({"date": "31/05/2024"}, "date", None),
    ],
)
def test_what_is_refused(tmp_path, changes, column, code):
    parts = job_parts()
    path = write_folder(tmp_path / "job", with_rows(row(parts, 0, **changes), parts=parts))
    (problem,) = problems_of(path)
    assert (problem.file, problem.row, problem.column) == ("overrulings.csv", 2, column)
    assert code in (None, "blank_cell") or problem.expected.code == code


def test_decided_twice(tmp_path):
    parts = job_parts()
    rows = [row(parts, 0), row(parts, 1), row(parts, 0, decision="leave_out")]
    (problem,) = problems_of(write_folder(tmp_path / "job", with_rows(*rows, parts=parts)))
    assert (problem.row, problem.column, problem.expected.code) == (4, "point", "overruled_twice")
    assert problem.expected.values["first_row"] == 2


def test_all_problems_come_in_one_run(tmp_path):
    parts = job_parts()
    rows = [row(parts, 0, point="X"), row(parts, 0, reason=None), row(parts, 1, decision="no")]
    found = problems_of(write_folder(tmp_path / "job", with_rows(*rows, parts=parts)))
    assert [(one.row, one.column) for one in found] == [
        (2, "point"),
        (3, "reason"),
        (4, "decision"),
    ]


def test_too_many(tmp_path):
    parts = job_parts(rings=2, points_per_ring=30)
    rows = [row(parts, number) for number in range(201)]
    (problem,) = problems_of(write_folder(tmp_path / "job", with_rows(*rows, parts=parts)))
    assert problem.expected.code == "overrulings_too_many"


@pytest.mark.parametrize("content", [None, "", "point;x_m\n", "point,x_m,x_m\nA,1,2\n"])
def test_points_that_cannot_be_read_are_told_and_no_decision_is(tmp_path, content):
    folder = write_folder(tmp_path / "job", with_rows(row(job_parts(rings=2), 3)))
    path = folder / "points.csv"
    path.unlink() if content is None else path.write_text(content)
    told = problems_of(folder)
    assert told
    assert {one.file for one in told} == {"points.csv"}


def test_straps_have_no_names(tmp_path):
    given = with_rows(["1-20", None, None, "keep", "right", None, None], parts=strapped_parts())
    (problem,) = problems_of(write_folder(tmp_path / "job", given))
    assert problem.expected.code == "overruled_nameless"


def test_not_for_a_mesh(tmp_path):
    parts = with_rows(row(job_parts(), 0), parts=job_parts(kind="mesh", mesh=b"solid"))
    (problem,) = problems_of(write_folder(tmp_path / "job", parts))
    assert problem.expected.code == "not_for_this_kind"


def test_hits_go_by_setup_and_row(tmp_path):
    rows = [
        {"setup": "I", "direction_deg": 15.0 * i, "zenith_deg": 80.0, "distance_m": 6.6}
        for i in range(24)
    ]
    good, bad = (
        write_folder(tmp_path / name, with_rows(one, parts=hit_parts(rows)))
        for name, one in (
            ("good", ["I 5", None, None, "keep", "right", None, None]),
            ("bad", ["I 99", None, None, "keep", "right", None, None]),
        )
    )
    assert "overruled_unknown" in [one.expected.code for one in problems_of(bad)]
    assert "overrulings.csv" not in files_at_fault(good)


def files_at_fault(path):
    """Of a job that may have mistakes elsewhere."""
    try:
        load(path)
    except InputError as error:
        return [one.file for one in error.problems]
    return []
