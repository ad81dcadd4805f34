"""What the command line names becomes jobs: folders, workbooks, patterns, lists; their names."""

import pytest
from batch_jobs import write_jobs
from job_builder import write_workbook

from tankcal.errors import InputError
from tankcal.products.batch.finding import find_jobs
from tankcal.products.batch.outcomes import Options, parse_steps, refuse_incomplete

RUN = Options()


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Two jobs, a workbook that is one, one that is none, and results, in folders."""
    folder = tmp_path_factory.mktemp("site")
    write_jobs(folder / "north", 2)
    (folder / "south").mkdir()
    write_workbook(folder / "south" / "T-9.xlsx")
    (folder / "south" / "~$T-9.xlsx").write_bytes(b"lock")
    for name in ("north/T-0/results", "kept/A-1-results", "kept/B-2/results"):
        (folder / name).mkdir(parents=True)
        (folder / name / "record.json").write_text("{}")
    (folder / "kept" / "B-2" / "inspection").mkdir()
    (folder / "kept" / "B-2" / "inspection" / "inspection.json").write_text("{}")
    (folder / "empty").mkdir()
    return folder


def names(arguments, options=RUN, **more):
    return [job.name for job in find_jobs([*map(str, arguments)], options, **more)]


def codes(arguments, options=RUN):
    with pytest.raises(InputError) as raised:
        find_jobs([*map(str, arguments)], options)
    return [one.expected.code for one in raised.value.problems]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ([""], ["T-0", "T-1", "T-9"]),
        (["north"], ["T-0", "T-1"]),
        (["north/T-1/job.toml"], ["T-1"]),
        (["south/T-9.xlsx"], ["T-9"]),
        (["north/*"], ["T-0", "T-1"]),
        (["*/T-[19]*"], ["T-1", "T-9"]),
        (["north/T-1", "north", "north/T-*"], ["T-0", "T-1"]),  # each once
        (["nowhere"], ["nowhere"]),  # told when it is read
    ],
)
def test_jobs_of_arguments(site, arguments, expected):
    assert names([site / one for one in arguments]) == expected


@pytest.mark.parametrize(
    ("do", "argument", "expected"),
    [
        ("report", "kept", ["A-1", "B-2", "B-2-inspection"]),
        ("report", "north/T-0", ["T-0"]),
        ("report", "kept/B-2/results", ["B-2"]),
        ("inspect", "north", ["T-0", "T-1"]),
        ("export", "", ["A-1", "B-2", "B-2-inspection", "T-0"]),
    ],
)
def test_results_of_arguments(site, do, argument, expected):
    assert names([site / argument], Options(steps=(do,))) == expected


def test_a_folder_is_not_looked_for_in_the_batch_itself(site):
    assert names([site], out=str(site / "north")) == ["T-9"]


@pytest.mark.parametrize(
    ("arguments", "options", "code"),
    [
        (["empty"], RUN, "batch_no_jobs"),
        (["empty"], Options(steps=("report",)), "batch_no_records"),
        (["none*"], RUN, "batch_no_match"),
    ],
)
def test_arguments_that_name_nothing(site, arguments, options, code):
    assert codes([site / one for one in arguments], options) == [code]


def test_a_plain_list(site):
    (site / "jobs.txt").write_text("# the north\nnorth/T-1\n\n south \nmissing\nempty\n")
    assert names([f"@{site / 'jobs.txt'}"]) == ["T-1", "T-9", "empty", "missing"]


@pytest.mark.parametrize("mark", [",", ";", "\t", '" ,"'])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_list_with_columns(site, mark, end):
    rows = [("name", "job", "profile"), ("First", "north/T-0", "csv"), ("", "north/T-1", "")]
    quote = '"' if '"' in mark else ""
    lines = ["# the north", *(quote + mark.join(one) + quote for one in rows), "", " "]
    (site / "jobs.csv").write_text(end.join(lines), newline="")
    found = find_jobs([str(site / "jobs.csv")], Options(profile="jd-edwards"))
    assert [(one.name, one.options.profile) for one in found] == [
        ("First", "csv"),
        ("T-1", "jd-edwards"),
    ]


def test_a_former_table_of_a_list_lies_beside_it(site):
    (site / "former.csv").write_text("job,former,compare_by\nkept/B-2,old.csv,house.toml\n")
    (site / "house.toml").write_text("")
    job = find_jobs([str(site / "former.csv")], Options(steps=("compare",)))[0].options
    assert job.former == str(site / "old.csv")
    assert job.compare_by == str(site / "house.toml")


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", ["batch_empty_list"]),
        (b"name,former\n", ["batch_headings"]),
        (b"job,colour\nT,red\n", ["batch_headings"]),
        (b"job,job\nT,T\n", ["batch_headings"]),
        (b"job,name\n,first\nT,a,b\n", ["batch_no_job_cell", "batch_long_row"]),
        (b'job\n"T\n', ["batch_no_csv"]),
        (b"job\n\xff\n", ["no_utf8"]),
        (b"job\0\n", ["zero_byte"]),
    ],
)
def test_lists_that_cannot_be_read(tmp_path, content, expected):
    (tmp_path / "jobs.csv").write_bytes(content)
    assert codes([f"@{tmp_path / 'jobs.csv'}"]) == expected


def test_a_list_that_is_not_there(tmp_path):
    assert codes([f"@{tmp_path / 'jobs.txt'}"]) == ["file_not_found"]


# ---- names


def two_of_a_name(tmp_path):
    for place in ("a", "b"):
        write_jobs(tmp_path / place, 1)
    return sorted(str(tmp_path / place / "T-0") for place in ("a", "b"))


def test_two_jobs_of_a_name_do_not_collide(tmp_path):
    two_of_a_name(tmp_path)
    first, second = names([tmp_path])
    assert first != second
    assert {first[:4], second[:4]} == {"T-0~"}
    assert names([tmp_path / "b", tmp_path / "a"]) == [first, second]  # whatever the order


def test_a_job_keeps_the_name_that_the_folder_has_for_it(tmp_path):
    first, second = two_of_a_name(tmp_path)
    assert names([first], known={first: "T-0"}) == ["T-0"]
    assert names([second], known={first: "T-0"})[0].startswith("T-0~")  # of the other one
    both = names([tmp_path], known={first: "T-0"})
    assert both[0] == "T-0"
    assert both[1].startswith("T-0~")


def test_names_that_a_list_gives_twice(tmp_path):
    two_of_a_name(tmp_path)
    (tmp_path / "jobs.csv").write_text("job,name\na/T-0,x y\nb/T-0,X/Y\n")
    assert len({one.casefold() for one in names([tmp_path / "jobs.csv"])}) == 2


# ---- steps


def test_steps_stand_in_their_order():
    assert parse_steps("inspect,run ,") == ("run", "inspect")
    for text in ("", "walk", "run,walk"):
        with pytest.raises(InputError):
            parse_steps(text)


def test_what_steps_need(site):
    options = Options(steps=("compare", "export"))
    with pytest.raises(InputError) as raised:
        refuse_incomplete(options, find_jobs([str(site / "kept")], options))
    assert [one.file for one in raised.value.problems] == ["--former", "--profile"]
