"""The command line as a user meets it: help, exit status, one line a problem, results untouched."""

import contextlib
import json
import shutil
import subprocess
import sys

import pytest
from conftest import EXAMPLE
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from job_builder import write_job

import tankcal
from tankcal.cli import main


def test_help_shows_the_way_for_a_new_tank(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--help"])
    assert stop.value.code == 0
    text = capsys.readouterr().out
    for word in (
        "tankcal new",
        "tankcal run",
        "demo",
        "exit status",
        "job.xlsx",
        "--only adjustment",
    ):
        assert word in text


def test_help_loads_nothing_heavy():
    """The goal is 0.5 s (benchmarks); what would cost them is that numpy or pandas is imported."""
    code = (
        "import sys; from tankcal.cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'scipy', 'pandas', 'matplotlib', 'openpyxl', 'nbformat'}\n"
        "sys.exit(len(heavy & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], stdout=subprocess.DEVNULL).returncode == 0


HEAVY = {  # what a run without papers has no need of, and waits for when it is imported
    *("pandas", "scipy.stats", "scipy.optimize", "scipy.interpolate", "scipy.ndimage"),
    *("scipy.spatial", "scipy.fft", "numba"),
    *("matplotlib", "openpyxl", "xlsxwriter", "nbformat", "nbclient", "trimesh", "typst"),
}
SURVEYS = {  # of kinds that only some jobs have
    *(
        "tankcal.survey.adjustment",
        "tankcal.survey.network.adjustment",
        "tankcal.survey.observations",
    ),
    *(
        "tankcal.methods.strapping.wall",
        "tankcal.methods.hits.wall",
        "tankcal.pipeline.scanned_solids",
    ),
    *("tankcal.pipeline.liquid", "tankcal.methods.radii.wall", "tankcal.clouds.wall"),
    *("tankcal.tank.meshes", "tankcal.tank.ships", "tankcal.job.excel", "tankcal.job.measuring"),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("example", "needed"),
    [
        ("silva-1995", set()),
        ("strapping", {"tankcal.methods.strapping.wall"}),
        ("reference-line", {"tankcal.methods.strapping.wall"}),
    ],
)
def test_a_run_without_papers_loads_only_what_its_job_needs(example, needed, tmp_path):
    """Imports are most of the time that such a run takes."""
    code = (
        "import sys; from tankcal.cli import main\n"
        f"main(['run', {str(EXAMPLE.parent / example)!r}, '--out', {str(tmp_path / 'out')!r}, "
        "'--no-papers', '--quiet'])\n"
        f"print('loaded', *{HEAVY | SURVEYS!r} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(done.stdout.splitlines()[-1].split()) - {"loaded"} == needed


@pytest.mark.parametrize("job", ["nowhere", "nowhere.xlsx", "\0", "x" * 5000])
def test_a_job_that_is_not_there(job, capsys):
    assert main(["run", job]) == 2
    error = capsys.readouterr().err
    assert "Traceback" not in error
    assert "not found" in error or "name" in error


def test_all_problems_at_once_and_nothing_written(tmp_path, capsys):
    job = tmp_path / "job"
    write_job(job, settings={"table.step_m": 0, "tank.id": "../../x"})
    points = (job / "points.csv").read_text().splitlines()
    cells = points[4].split(",")
    points[4] = ",".join([cells[0], "nan", *cells[2:]])
    (job / "points.csv").write_text("\n".join(points) + "\n")
    before = sorted(path.name for path in job.iterdir())
    assert main(["run", str(job)]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if "expected" in line]
    assert any("points.csv, row 5" in line and "x_m" in line for line in lines)
    assert any("table.step_m" in line for line in lines)
    assert any("tank.id" in line for line in lines)
    assert sorted(path.name for path in job.iterdir()) == before


@pytest.fixture(scope="module")
def done(example_run, tmp_path_factory):
    """A job that was run once, with all its outputs."""
    return shutil.copytree(example_run, tmp_path_factory.mktemp("cli") / "job")


@pytest.mark.slow
def test_a_run_writes_everything(done, capsys):
    names = {path.name for path in (done / "results").iterdir()}
    assert names == {
        "record.json",
        "points.csv",
        "sections.csv",
        "capacity.csv",
        "capacity.xlsx",
        "certificate.xml",
        "report.ipynb",
        "certificate.pdf",
        "working-papers.pdf",
        "field-table.pdf",
        "report.pdf",
        "report.html",
        "SHA256SUMS",
    }
    assert not list(done.glob(".tankcal-*"))


def test_earlier_results_stay_when_the_input_breaks(done, capsys):
    before = (done / "results" / "record.json").read_bytes()
    good = (done / "courses.csv").read_text()
    try:
        (done / "courses.csv").write_text(good.replace("1.9", "1,9"))
        assert main(["run", str(done)]) == 2
    finally:
        (done / "courses.csv").write_text(good)
    assert (done / "results" / "record.json").read_bytes() == before


@pytest.mark.slow
def test_earlier_results_are_replaced_by_a_good_run(done, capsys):
    assert main(["run", str(done), "--quiet"]) == 0
    told = capsys.readouterr().out
    assert "results in" in told
    assert [path.name for path in done.glob("*results*")] == ["results"]
    assert f": {capacity_in(done / 'results')}" in told


def capacity_in(results):
    """The last row of the table as the terminal tells it: two digits of U (below 100 m3)."""
    capacity = json.loads((results / "record.json").read_text(encoding="utf-8"))["capacity"]
    height, volume, U, k = (capacity[key][-1] for key in ("height_m", "volume_m3", "U_m3", "k"))
    shown = f"{U:#.2g}".rstrip(".")
    volume = f"{volume:.{len(shown.partition('.')[2])}f}"
    return f"{volume} m3 at {height:.3f} m, U = {shown} m3 (k = {k:.2f})"


def test_a_folder_with_foreign_files_is_refused(done, tmp_path, capsys):
    (tmp_path / "thesis.docx").write_text("mine")
    assert main(["run", str(done), "--out", str(tmp_path), "--quiet"]) == 2
    assert "thesis.docx" in capsys.readouterr().err
    assert (tmp_path / "thesis.docx").read_text() == "mine"


@pytest.mark.slow
def test_a_failing_report_leaves_the_earlier_results(done, monkeypatch, capsys):
    from tankcal.errors import TankcalError

    def fail(*arguments):
        raise TankcalError("the report stopped")

    before = (done / "results" / "capacity.csv").read_bytes()
    monkeypatch.setattr("tankcal.report.outputs.build", fail)
    assert main(["run", str(done), "--quiet"]) == 1
    assert (done / "results" / "capacity.csv").read_bytes() == before
    assert not list(done.glob(".tankcal-*"))


def test_a_survey_without_a_wall_exits_with_3(tmp_path, capsys):
    write_job(tmp_path / "job", radius=lambda theta, z: 6.5 + 0.6 * (theta > 2) + 0.9 * (theta > 4))
    assert main(["run", str(tmp_path / "job")]) == 3
    assert "nominal" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("kind", "survey"),
    [("horizontal", "reference-line"), ("sphere", "reference-line"), ("mesh", "strapping")],
)
def test_new_refuses_a_survey_of_another_kind(tmp_path, kind, survey, capsys):
    folder = tmp_path / "mine"
    assert main(["new", str(folder), "--kind", kind, "--survey", survey]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not folder.exists()


def test_new_writes_a_job_and_refuses_a_full_folder(tmp_path, capsys):
    assert main(["new", str(tmp_path / "mine")]) == 0
    assert {"job.toml", "points.csv", "courses.csv"} <= {
        path.name for path in (tmp_path / "mine").iterdir()
    }
    assert main(["new", str(tmp_path / "mine")]) == 2
    assert main(["run", str(tmp_path / "mine")]) == 2
    assert "job.toml" in capsys.readouterr().err


coordinates = st.floats(-1e4, 1e4, allow_nan=False).map(lambda value: f"{value:.3f}")


@pytest.mark.slow
@settings(max_examples=40, suppress_health_check=list(HealthCheck))
@given(
    spoilt=st.lists(st.tuples(st.integers(1, 60), st.integers(1, 3), coordinates), max_size=40),
    heights=st.lists(st.sampled_from(["1.9", "0.1", "3.0", "9.5"]), min_size=2, max_size=2),
)
def test_whatever_the_numbers_are_a_job_computes_or_says_why(tmp_path_factory, spoilt, heights):
    """Property: the chain gives a table or raises one of our exceptions, never another."""
    job = tmp_path_factory.mktemp("spoilt") / "job"
    write_job(job, courses=2, height=3.8, points_per_ring=30, settings={"table.step_m": 0.5})
    lines = (job / "points.csv").read_text().splitlines()
    for row, column, value in spoilt:
        cells = lines[row].split(",")
        cells[column] = value
        lines[row] = ",".join(cells)
    (job / "points.csv").write_text("\n".join(lines) + "\n")
    courses = (job / "courses.csv").read_text().splitlines()
    for row, height in enumerate(heights, 1):
        cells = courses[row].split(",")
        courses[row] = ",".join([cells[0], height, *cells[2:]])
    (job / "courses.csv").write_text("\n".join(courses) + "\n")
    with contextlib.suppress(tankcal.InputError, tankcal.SolutionError):
        table = tankcal.run(tankcal.load(job)).capacity
        assert (table.volume_m3.diff().dropna() > 0).all()
        assert table.notna().all().all()


@pytest.mark.study
def test_a_link_is_followed(done, tmp_path, capsys):
    (tmp_path / "disk").mkdir()
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "disk")
    assert main(["run", str(done), "--out", str(link), "--quiet"]) == 0
    assert link.is_symlink()
    assert (tmp_path / "disk" / "record.json").is_file()


@pytest.mark.slow
def test_an_interruption_in_disguise_is_no_traceback(done, monkeypatch, capsys):
    """A library may turn Ctrl-C into an error of its own."""

    def interrupted(*arguments):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt:
            raise AssertionError from None

    monkeypatch.setattr("tankcal.report.outputs.build", interrupted)
    assert main(["run", str(done), "--quiet"]) == 130
    assert "stopped; earlier results are unchanged" in capsys.readouterr().err


def table(path, wrong=None):
    """A capacity table of a cylinder of 130 m2, with one wrong volume if wanted."""
    volumes = [f"{1.3 * k:.3f}" for k in range(101)]
    if wrong is not None:
        volumes[wrong] = "65.400"
    rows = [f"{k / 100:.2f},{volume}" for k, volume in enumerate(volumes)]
    path.write_text("height_m,volume_m3\n" + "\n".join(rows) + "\n")
    return str(path)


def test_lint_of_a_clean_table(tmp_path, capsys):
    arguments = ["--nominal-diameter", "12.87", "--nominal-height", "1"]
    assert main(["lint", table(tmp_path / "t.csv"), *arguments]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "t.csv: 101 rows, 0 to 1 m, step 0.01 m, total 130 m3",
        "no errors, no warnings",
    ]


def test_lint_tells_each_finding_in_one_line(tmp_path, capsys):
    file = table(tmp_path / "t.csv", wrong=50)
    assert main(["lint", file, "--nominal-volume", "145"]) == 2
    assert capsys.readouterr().out.splitlines() == [
        "t.csv: warning: total 130 m3, expected about 145 m3 (nominal)",
        "t.csv, row 52, volume_m3: error: found 65.400; expected about 65.000: 65.000? (one digit)",
        "t.csv: 101 rows, 0 to 1 m, step 0.01 m, total 130 m3",
        "1 error, 1 warning",
    ]


def test_lint_shows_the_first_findings_only(tmp_path, capsys):
    rows = "".join(f"{k},x\n" for k in range(60))
    (tmp_path / "t.csv").write_text("height_m,volume_m3\n" + rows)
    assert main(["lint", str(tmp_path / "t.csv")]) == 2
    lines = capsys.readouterr().out.splitlines()
    assert lines[50].startswith("and ")
    assert lines[50].endswith(" more findings; correct these first")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere.csv"], "not found"),
        (["\0"], "not found"),
        (["{table}", "--nominal-diameter", "12"], "expected both"),
        (["{table}", "--sheet", "x"], "no sheet 'x'"),
    ],
)
def test_lint_without_a_table(arguments, words, tmp_path, capsys):
    file = table(tmp_path / "t.csv")
    assert main(["lint", *(argument.format(table=file) for argument in arguments)]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert "Traceback" not in error


@pytest.mark.parametrize("number", ["0", "-1", "nan", "inf", "ten"])
def test_nominal_sizes_are_above_zero(number, tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["lint", table(tmp_path / "t.csv"), f"--nominal-volume={number}"])
    assert stop.value.code == 2
    assert "expected a number above 0" in capsys.readouterr().err


@pytest.mark.slow(after=8)
@pytest.mark.parametrize(
    ("command", "option"),
    [
        ("camera compare cameras.toml", "--threshold"),
        ("camera compare cameras.toml", "--seed"),
        ("camera compare cameras.toml", "--pixel-um"),
        ("camera parameters job", "--limit-um"),
        ("camera parameters job", "--alpha"),
        ("camera check d.csv", "--scale"),
        ("camera convert a.cam --to aicon", "--radius-mm"),
        ("camera convert a.cam --to aicon", "--size-px 100"),
        ("camera read a.png", "--bit-errors"),
        ("plan job", "--simulate"),
        ("plan job", "--blunders"),
        ("plan job", "--seed"),
        ("lint t.csv", "--nominal-height"),
    ],
)
def test_numbers_of_options_are_those_of_tables(command, option, capsys):
    """Digit groups and digits of other scripts, which Python's own conversion takes."""
    groups = "0.0_5" if option in ("--alpha", "--blunders") else "1_0"
    for text in (
        groups,
        groups.replace("_", "").translate({ord("0"): "\uff10", ord("1"): "\u0661"}),
    ):
        with pytest.raises(SystemExit) as stop:
            main([*command.split(), *option.split(), text])
        assert stop.value.code == 2
        told = capsys.readouterr().err
        assert option.split()[0] in told
        assert "number" in told


BARE_TANK = """\
[tank]
id = "L1"
kind = "horizontal"
[survey]
side = "inside"
date = 2024-05-31
[horizontal]
diameter_m = 2.4
length_m = 10
end_a = "flat"
end_b = "flat"
[table]
step_m = 0.1
reference_temperature_c = 20
[corrections]
temperature = false
"""


def test_tank_without_uncertainty_is_reported(tmp_path, capsys):
    (tmp_path / "job.toml").write_text(BARE_TANK, encoding="utf-8")
    assert main(["run", str(tmp_path), "--no-papers", "--quiet"]) == 0
    said = capsys.readouterr().out
    assert "45.239 m3 at 2.400 m, no uncertainty stated" in said
    assert "U = 0" not in said


@pytest.mark.slow
def test_implausible_inputs_are_told_before_the_time_is_spent_on_them(tmp_path, capsys):
    """And once more at the end, where nobody misses them."""
    write_job(tmp_path / "job", kind="sphere", settings={"sphere.diameter_m": 70.0})
    assert main(["run", str(tmp_path / "job"), "--no-papers"]) == 0
    said = capsys.readouterr().err.splitlines()
    about = [n for n, line in enumerate(said) if "sphere.diameter_m" in line]
    assert len(about) == 2
    assert "DOUBTFUL INPUT" in said[about[0] - 1]
    assert about[0] < said.index("tankcal: integrating volumes") < about[1] == len(said) - 1


@pytest.mark.slow
@pytest.mark.parametrize(("cluster", "told"), [("2", 1), ("local", 1), ("auto", 0), ("0", 0)])
def test_workers_without_clouds_are_told(cluster, told, tmp_path, capsys):
    words = ["run", str(EXAMPLE.parent / "total-station"), "--only", "adjustment", "--no-papers"]
    assert main([*words, "--cluster", cluster, "--out", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().err.count("--cluster: without effect") == told
