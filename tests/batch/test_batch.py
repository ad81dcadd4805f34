"""A batch in this process: what is done, skipped, refused; what the summary says of it.

Truth: the same jobs by `tankcal run`; what is done again is counted in the journal.
"""

import csv
import errno
import json
import os
import shutil
import subprocess
import sys

import pytest
from batch_jobs import bytes_of, jobs_in, journal_of, spoil, write_jobs
from conftest import EXAMPLE

from tankcal.cli import main
from tankcal.products.batch import journal, running, steps
from tankcal.products.batch.outcomes import Options
from tankcal.products.batch.running import find_changes

pytestmark = pytest.mark.slow  # seconds of runs and papers


@pytest.fixture(scope="module")
def two_done(tmp_path_factory):
    """A folder with two jobs and the batch of them, which tests copy."""
    folder = tmp_path_factory.mktemp("two")
    write_jobs(folder / "site", 2)
    assert main(batch_of(folder)) == 0
    return folder


@pytest.fixture
def two(two_done, tmp_path):
    """The same where its jobs lie, its folder copied: a job is known by its path."""
    shutil.copytree(two_done / "out", tmp_path / "out")
    before = {one: one.read_bytes() for one in (two_done / "site").rglob("*") if one.is_file()}
    yield two_done / "site", tmp_path / "out"
    for path, content in before.items():
        path.write_bytes(content)


def batch_of(folder, *more, site=None):
    return ["batch", str(site or folder / "site"), "--out", str(folder / "out"), "--workers", "0",
            "--no-papers", "--quiet", *more]  # fmt: skip


def again(two, *more):
    site, out = two
    return main(batch_of(out.parent, *more, site=site))


def summary(out):
    return {row["name"]: row for row in json.loads((out / "summary.json").read_text())["rows"]}


def errors(capsys):
    return capsys.readouterr().err.splitlines()


# ---- what is done


def test_results_are_those_of_tankcal_run(two, tmp_path):
    site, out = two
    assert main(["run", str(site / "T-1"), "--out", str(tmp_path / "alone"), "--no-papers",
                 "--quiet"]) == 0  # fmt: skip
    for path in (tmp_path / "alone").iterdir():
        assert path.read_bytes() == (out / "jobs" / "T-1" / "results" / path.name).read_bytes()


def test_the_summary_has_the_numbers_of_the_records(two):
    _, out = two
    for name, row in summary(out).items():
        record = json.loads((out / "jobs" / name / "results" / "record.json").read_text())
        table = record["capacity"]
        assert row["volume_m3"] == table["volume_m3"][-1]
        assert row["U_m3"] == table["stated_U_m3"][-1]
        assert row["warning_count"] == len(record["warnings"])
        assert (row["status"], row["tank"], row["changes"]) == ("done", name, None)
        assert (out / row["papers"][0]).is_file()
    rows = list(csv.DictReader((out / "summary.csv").open(encoding="utf-8")))
    assert [row["name"] for row in rows] == ["T-0", "T-1"]


def test_nothing_is_done_twice(two):
    assert again(two) == 0
    assert jobs_in(two[1], "begun") == ["T-0", "T-1"]
    assert [row["changes"] for row in summary(two[1]).values()] == [[], []]


def test_a_changed_job_is_done_again_and_told(two):
    site, out = two
    before = summary(out)["T-1"]["volume_m3"]
    path = site / "T-1" / "job.toml"
    path.write_text(path.read_text().replace("step_m = 0.5", "step_m = 0.25\nlanguage = 'es'"))
    points = site / "T-1" / "courses.csv"
    points.write_text(points.read_text().replace("8.0", "9.0"))
    assert again(two) == 0
    assert jobs_in(out, "begun") == ["T-0", "T-1", "T-1"]
    rows = summary(out)
    (change,) = rows["T-1"]["changes"]
    assert change["by_m3"] == pytest.approx(rows["T-1"]["volume_m3"] - before, abs=1e-9)
    assert change["by_m3"] < -0.1
    assert rows["T-0"]["changes"] == []


def test_results_that_were_taken_away_are_made_again(two):
    _, out = two
    before = bytes_of(out / "jobs")
    shutil.rmtree(out / "jobs" / "T-0" / "results")
    (out / "jobs" / "T-1" / "outcome.json").write_text("{")
    assert again(two) == 0
    assert jobs_in(out, "begun") == ["T-0", "T-1", "T-0", "T-1"]
    assert bytes_of(out / "jobs") == before


def test_a_step_more_does_the_others_not_again(two):
    assert again(two, "--do", "run,export", "--profile", "csv") == 0
    lines = journal_of(two[1], "ended")
    assert [set(one["cpu_s"]) >= {"export"} for one in lines[2:]] == [True, True]
    assert not any("compute" in one["cpu_s"] for one in lines[2:])
    assert (two[1] / "jobs" / "T-0" / "export" / "T-0-csv.csv").is_file()


def test_jobs_that_are_gone_are_named(two, capsys):
    site, out = two
    assert main(batch_of(out.parent, site=site / "T-0")) == 0
    assert json.loads((out / "summary.json").read_text())["gone"] == ["T-1"]
    assert "T-1" in (out / "summary.html").read_text()


@pytest.mark.parametrize("language", ["en", "pt-BR", "es"])
def test_summary_in_each_language(two, language):
    assert again(two, "--language", language) == 0
    page = (two[1] / "summary.html").read_text()
    assert f'<html lang="{language}">' in page
    assert {"en": "Status", "pt-BR": "Situação", "es": "Estado"}[language] in page
    assert 'href="jobs/T-0/results/capacity.csv"' in page


def test_one_object_for_programs(two, capsys):
    assert again(two, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["exit_status"], found["jobs"], found["settled_before"]) == (0, 2, 2)
    assert found["counts"] == {"done": 2}


# ---- what goes wrong


def test_bad_jobs_stop_no_good_ones(two, capsys):
    site, out = two
    spoil(site / "T-0")
    before = bytes_of(out / "jobs" / "T-0" / "results")
    assert again(two) == 2
    (line,) = errors(capsys)
    assert line.startswith("tankcal: T-0: job.toml, row ")
    rows = summary(out)
    assert rows["T-0"]["status"] == "refused"
    assert rows["T-0"]["changes"] == [{"code": "status", "old": "done", "new": "refused"},
                                      {"code": "height_m"}]  # fmt: skip
    assert rows["T-1"]["status"] == "done"
    assert bytes_of(out / "jobs" / "T-0" / "results") == before  # earlier results stay
    assert again(two) == 2  # told again, not read again
    assert errors(capsys) == [line]
    assert jobs_in(out, "begun") == ["T-0", "T-1", "T-0"]


def test_a_survey_without_sound_solution(tmp_path, capsys, monkeypatch):
    from tankcal.errors import SolutionError

    write_jobs(tmp_path / "site", 2)
    run = steps._STEP_FUNCTIONS["run"]

    def fail(task, clock):
        if task.job.name == "T-1":
            raise SolutionError("singular")
        return run(task, clock)

    monkeypatch.setitem(steps._STEP_FUNCTIONS, "run", fail)
    assert main(batch_of(tmp_path)) == 3
    assert errors(capsys) == ["tankcal: T-1: T-1: singular"]
    spoil(tmp_path / "site" / "T-0")
    assert main(batch_of(tmp_path)) == 2


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (ZeroDivisionError("division"), "batch_mistake"),
        (MemoryError(), "batch_no_memory"),
        (OSError(errno.EIO, "Input/output error", "disk"), "disk_error"),
    ],
)
def test_failures_are_tried_again(tmp_path, monkeypatch, capsys, error, code):
    write_jobs(tmp_path / "site", 2)

    def fail(task, clock):
        raise error

    with monkeypatch.context() as patched:
        patched.setitem(steps._STEP_FUNCTIONS, "run", fail)
        assert main(batch_of(tmp_path)) == 2
    assert len(errors(capsys)) == 2
    row = summary(tmp_path / "out")["T-0"]
    assert (row["status"], row["problems"][0]["code"]) == ("failed", code)
    assert main(batch_of(tmp_path)) == 0


def test_a_full_disk_stops_in_one_line(tmp_path, monkeypatch, capsys):
    write_jobs(tmp_path / "site", 3)
    run = steps._STEP_FUNCTIONS["run"]

    def fill(task, clock):
        if task.job.name == "T-1":
            raise OSError(errno.ENOSPC, "No space left on device", "record.json")
        return run(task, clock)

    with monkeypatch.context() as patched:
        patched.setitem(steps._STEP_FUNCTIONS, "run", fill)
        assert main(batch_of(tmp_path)) == 2
    (line,) = errors(capsys)
    assert "No space left on device" in line
    assert main(batch_of(tmp_path)) == 0
    assert jobs_in(tmp_path / "out", "begun") == ["T-0", "T-1", "T-1", "T-2"]


def test_input_that_cannot_be_read(two, monkeypatch, capsys):
    from tankcal.products.batch import journal

    digest = journal._digest

    def refuse(path):
        if "T-0" in str(path):
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return digest(path)

    monkeypatch.setattr(journal, "_digest", refuse)
    assert again(two) == 2
    (line,) = errors(capsys)
    assert "T-0" in line
    assert "Permission denied" in line


def test_input_that_changes_meanwhile_is_computed_again(tmp_path, monkeypatch, capsys):
    site = write_jobs(tmp_path / "site", 1)
    run = steps._STEP_FUNCTIONS["run"]

    def meddle(task, clock):
        written = run(task, clock)
        (site / "T-0" / "job.toml").open("a").write("# later\n")
        return written

    with monkeypatch.context() as patched:
        patched.setitem(steps._STEP_FUNCTIONS, "run", meddle)
        assert main(batch_of(tmp_path)) == 2
    assert "changed during" in errors(capsys)[0]
    assert main(batch_of(tmp_path)) == 0


def test_ctrl_c_says_how_to_go_on(tmp_path, monkeypatch, capsys):
    write_jobs(tmp_path / "site", 3)
    do = running.do_job

    def interrupted(task):
        if task.job.name == "T-1":
            raise KeyboardInterrupt
        return do(task)

    monkeypatch.setattr(sys, "argv", ["tankcal", *batch_of(tmp_path)])
    with monkeypatch.context() as patched:
        patched.setattr(running, "do_job", interrupted)
        assert main(batch_of(tmp_path)) == 130
    (line,) = errors(capsys)
    assert "tankcal batch " in line
    assert main(batch_of(tmp_path)) == 0
    assert jobs_in(tmp_path / "out", "begun") == ["T-0", "T-1", "T-2"]


def test_foreign_folders_are_refused(tmp_path, capsys):
    write_jobs(tmp_path / "site", 1)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "letter.txt").write_text("mine")
    assert main(batch_of(tmp_path)) == 2
    assert "letter.txt" in errors(capsys)[0]
    assert [one.name for one in (tmp_path / "out").iterdir()] == ["letter.txt"]


def test_two_batches_into_one_folder(two, capsys):
    with journal.open_folder(two[1]):
        assert again(two) == 2
    (line,) = errors(capsys)
    assert "another batch" in line
    assert again(two) == 0


@pytest.mark.slow
def test_a_lock_is_stale_after_kill_9(two):
    code = (
        "import sys, time; from tankcal.products.batch.journal import open_folder\n"
        "with open_folder(sys.argv[1]): print('locked', flush=True); time.sleep(60)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, str(two[1])], stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout.readline() == "locked\n"
        assert again(two) == 2
        child.kill()
    assert again(two) == 0


def test_what_an_ended_batch_left_is_taken_away(two):
    _, out = two
    jobs = out / "jobs"
    (jobs / "T-0" / ".tankcal-abc" / "made" / "results").mkdir(parents=True)
    (jobs / "T-0" / ".tankcal-abc" / "lock").touch()
    (jobs / "T-0" / ".outcome.json.1.tmp").write_text("{")
    aside = jobs / "T-1" / ".tankcal-abc" / "before"  # ended between two renamings
    aside.mkdir(parents=True)
    (aside.parent / "lock").touch()
    (jobs / "T-1" / "results").rename(aside / "results")
    assert again(two) == 0
    assert jobs_in(out, "begun") == ["T-0", "T-1"]
    assert not list(jobs.rglob(".*"))


@pytest.mark.parametrize(
    "arguments",
    [
        ["--do", "walk"],
        ["--do", "compare"],
        ["--do", "export"],
        ["--do", "export", "--profile", "none"],
        ["--do", "inspect", "--inspect-by", "none"],
        ["--do", "compare", "--former", "x", "--compare-by", "none"],
    ],
)
def test_options_that_no_job_could_be_done_with(two_done, tmp_path, capsys, arguments):
    out = tmp_path / "new"
    command = ["batch", str(two_done / "site"), str(two_done / "out"), "--out", str(out)]
    assert main([*command, "--workers", "0", "--quiet", *arguments]) == 2
    assert len(errors(capsys)) == 1
    assert not out.exists()


# ---- other steps


@pytest.mark.slow
def test_compare_and_inspect_by_what_was_computed(two_done, tmp_path):
    steps = ["--do", "run,compare,inspect", "--former", str(two_done / "out")]
    assert main(batch_of(tmp_path, *steps, site=two_done / "site" / "T-0")) == 0
    row = summary(tmp_path / "out")["T-0"]
    assert row["comparison_verdict"] == "keep"  # of a table with itself
    assert row["inspection_verdict"] is not None
    job = tmp_path / "out" / "jobs" / "T-0"
    assert json.loads((job / "inspection" / "inspection.json").read_text())["tank"]["id"] == "T-0"
    assert (job / "comparison" / "comparison.pdf").is_file()


def test_no_former_table_refuses_that_step_alone(two, tmp_path, capsys):
    (tmp_path / "former").mkdir()
    assert again(two, "--do", "run,compare", "--former", str(tmp_path / "former")) == 2
    assert len(errors(capsys)) == 2
    assert summary(two[1])["T-0"]["volume_m3"] > 0


@pytest.mark.slow
def test_papers_again_in_another_language(two_done, tmp_path):
    steps, site = ["--do", "report", "--language", "pt-BR"], two_done / "out" / "jobs" / "T-0"
    assert main(batch_of(tmp_path, *steps, site=site)) == 0
    found = summary(tmp_path / "out")
    assert [*found] == ["T-0"]
    assert found["T-0"]["papers"] == ["jobs/T-0/report/certificate.pdf"]
    page = (tmp_path / "out" / "jobs" / "T-0" / "report" / "report.html").read_text()
    assert '<html lang="pt-BR">' in page


# ---- what changed


DONE = {"status": "done", "height_m": 9.5, "volume_m3": 100.0, "U_m3": 0.2, "rule_verdict": None}


@pytest.mark.parametrize(
    ("former", "codes"),
    [
        (None, ["first"]),
        (DONE, []),
        (DONE | {"status": "refused"}, ["status"]),
        (DONE | {"rule_verdict": "failed"}, ["rule_verdict"]),
        (DONE | {"height_m": 9.0, "volume_m3": 90.0}, ["height_m", "volume_m3"]),
        ({}, ["status", "height_m"]),
    ],
)
def test_changes(former, codes):
    assert [one["code"] for one in find_changes(DONE, former)] == codes


def test_the_example_is_a_batch_of_one(tmp_path, capsys):
    command = ["batch", str(EXAMPLE), "--out", str(tmp_path), "--no-papers", "--quiet"]
    assert main(command) == 0
    assert summary(tmp_path)["silva-1995"]["tank"] == "SILVA-1995"


# ---- what somebody else wrote into what a batch keeps


def of_run(**more):
    return lambda kept: kept["steps"]["run"].update(more)


@pytest.mark.parametrize(
    "spoil_it",
    [
        of_run(values=[1]),
        of_run(values={"volume_m3": "many"}),
        of_run(values={"volume_m3": 1.0, "U_m3": [1]}),
        of_run(values={"volume_m3": float("nan")}),
        of_run(values={"rule_verdict": "odd"}),
        of_run(values={"global_test": "yes"}),
        of_run(status="odd"),
        of_run(status=[]),
        of_run(files="record.json"),
        of_run(problems=5),
        of_run(warning_count=None),
        of_run(status="refused", problems=[{"file": 1}], problem_count=1),
        of_run(warnings=[{"file": "a", "text": "t", "code": "x", "values": 5}], warning_count=1),
        lambda kept: kept.update(source=[1]),
        lambda kept: kept.update(name=5),
        lambda kept: kept.update(steps=[]),
    ],
)
def test_an_outcome_that_is_not_whole_counts_as_none(two, spoil_it, capsys):
    _, out = two
    path = out / "jobs" / "T-0" / "outcome.json"
    before = path.read_bytes()
    kept = json.loads(before)
    spoil_it(kept)
    path.write_text(json.dumps(kept))
    assert again(two) == 0
    assert errors(capsys) == []
    assert path.read_bytes() == before
    assert jobs_in(out, "begun") == ["T-0", "T-1", "T-0"]
    assert [row["changes"] for row in summary(out).values()] == [[], []]


@pytest.mark.parametrize(
    "more",
    [{"name": 5}, {"volume_m3": "x"}, {"U_m3": "x", "volume_m3": 3}, {"status": [1]},
     {"volume_m3": float("nan")}, {"rule_verdict": "odd"}],
)  # fmt: skip
def test_a_summary_that_is_not_whole_tells_no_changes(two, more, capsys):
    _, out = two
    kept = json.loads((out / "summary.json").read_text())
    kept["rows"][0].update(more)
    (out / "summary.json").write_text(json.dumps(kept))
    assert again(two) == 0
    assert errors(capsys) == []
    assert [row["changes"] for row in summary(out).values()] == [None, None]


def test_a_problem_with_numbers_of_numpy_is_kept(tmp_path, capsys):
    """Courses without points are counted by numpy, which JSON does not hold."""
    site = write_jobs(tmp_path / "site", 2)
    path = site / "T-0" / "points.csv"
    path.write_text("".join(path.read_text("utf-8").splitlines(True)[:3]), "utf-8")
    assert main(batch_of(tmp_path)) == 2
    (line,) = errors(capsys)
    assert line.startswith("tankcal: T-0: courses.csv, row 2, course: ")
    assert {name: row["status"] for name, row in summary(tmp_path / "out").items()} == {
        "T-0": "refused", "T-1": "done"
    }  # fmt: skip


@pytest.mark.parametrize("place", ["jobs/T-0", "jobs/T-0/outcome.json"])
def test_something_in_the_way_fails_that_job_alone(tmp_path, place, capsys):
    write_jobs(tmp_path / "site", 2)
    way = tmp_path / "out" / place
    if way.suffix:
        way.mkdir(parents=True)
    else:
        way.parent.mkdir(parents=True)
        way.write_text("something else")
    assert main(batch_of(tmp_path)) == 2
    (line,) = errors(capsys)
    assert line.startswith(f"tankcal: T-0: {place}: is not a file or folder of a batch (")
    rows = summary(tmp_path / "out")
    assert {name: row["status"] for name, row in rows.items()} == {"T-0": "failed", "T-1": "done"}


def test_a_job_that_cannot_be_read_is_told_once(two, monkeypatch):
    """The progress goes on with what it said before, not with the trouble of that job."""
    site, out = two
    real, parts, ended = running.compute_keys, [], []

    def compute_keys(job, former):
        if job.name == "T-0":
            raise PermissionError(errno.EACCES, "Permission denied", "points.csv")
        return real(job, former)

    monkeypatch.setattr(running, "compute_keys", compute_keys)
    callbacks = running.Callbacks(
        part=lambda text, *_: parts.append(text.code), ended=lambda *told: ended.append(told)
    )
    batch = running.run_batch(
        [str(site)], Options(papers=False), out, workers=0, callbacks=callbacks
    )
    assert parts == ["batch_comparing", "batch_comparing"]
    ((name, status, problems, _),) = ended
    assert (name, status, problems[0]["code"]) == ("T-0", "failed", "batch_input_unreadable")
    assert batch.counts == {"failed": 1, "done": 1}


def test_a_folder_whose_name_is_no_utf8(tmp_path):
    site = tmp_path / os.fsdecode(b"site-\xff")
    write_jobs(site, 1)
    batch = ["batch", str(site), "--workers", "0", "--no-papers", "--quiet"]
    assert main([*batch, "--out", str(tmp_path / "out")]) == 0
    rows = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["rows"]
    assert rows[0]["source"].endswith("site-?/T-0")
    assert "site-?" in (tmp_path / "out" / "summary.csv").read_text(encoding="utf-8")
