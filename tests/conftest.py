"""Fixtures shared by the tests: where data lies, and the shipped example computed once."""

import fcntl
import gc
import os
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path
from zlib import crc32

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: two workers share two cores

import pytest
from hypothesis import settings

import tankcal
from tankcal.cli import main
from tankcal.pipeline.chain import adjust_job
from tankcal.record import record_of, record_of_adjustment, save
from tankcal.terminal import speak

ROOT = Path(__file__).resolve().parent.parent
EXAMPLE = ROOT / "examples" / "silva-1995"
PHOTOS = EXAMPLE.parent / "silva-1995-photos"

# the same examples on every machine, however slow; new ones by: pytest --hypothesis-profile search
settings.register_profile("house", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None, print_blob=True)
settings.load_profile("house")


@pytest.fixture(autouse=True)
def reset_language(monkeypatch):
    """Run each test in English, whatever the environment and the tests before it chose."""
    for name in ("LC_ALL", "LC_MESSAGES", "LANG"):
        monkeypatch.delenv(name, raising=False)
    yield
    speak("en")


@pytest.fixture(scope="session")
def shared():
    """The folder of data that is read in place; tests skip where it is absent."""
    folder = Path(os.environ.get("TANKCAL_DATA", ROOT.parent / "shared"))
    if not folder.is_dir():
        pytest.skip("no shared data here: set TANKCAL_DATA to its folder")
    return folder


@pytest.fixture(scope="session")
def made_once(tmp_path_factory):
    """made_once(name, make): a folder that make(folder) filled; nobody changes it.

    Of the workers of a run the first one makes it, the others wait for it.
    """
    base = tmp_path_factory.getbasetemp()
    base = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def folder_of(name, make):
        folder = base / name
        with open(base / f"{name}.lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not folder.exists():
                making = base / f"{name}.making"
                shutil.rmtree(making, ignore_errors=True)
                making.mkdir()
                make(making)
                making.rename(folder)
        return folder

    return folder_of


@pytest.fixture(scope="session")
def example_result():
    """The shipped example, computed."""
    return tankcal.run(tankcal.load(EXAMPLE))


@pytest.fixture(scope="session")
def example_record(made_once):
    """Path of the record.json of the shipped example."""

    def make(folder):
        save(record_of(tankcal.run(tankcal.load(EXAMPLE))), folder / "record.json")

    return made_once("example", make) / "record.json"


@pytest.fixture(scope="session")
def short_result():
    """The same with rows 0.25 m apart: 39, not 951, for files whose length is not looked at."""
    job = tankcal.load(EXAMPLE)
    return tankcal.run(replace(job, table=replace(job.table, step_m=0.25)))


@pytest.fixture(scope="session")
def short_record(made_once, request):
    """Path of its record.json."""

    def make(folder):
        save(record_of(request.getfixturevalue("short_result")), folder / "record.json")

    return made_once("short", make) / "record.json"


@pytest.fixture(scope="session")
def example_run(made_once):
    """The shipped example with the results that the command line wrote beside it."""

    def make(folder):
        shutil.copytree(EXAMPLE, folder / "job")
        assert main(["run", str(folder / "job"), "--quiet"]) == 0

    return made_once("run", make) / "job"


@pytest.fixture(scope="session")
def adjusted_record(made_once):
    """Path of the record.json of the shipped photographs, only adjusted."""

    def make(folder):
        job = tankcal.load(PHOTOS, only="adjustment")
        save(record_of_adjustment(job, adjust_job(job)), folder / "record.json")

    return made_once("adjusted", make) / "record.json"


@pytest.fixture(scope="session")
def records_of_kinds(made_once):
    """{kind: record} that together fill every sheet of the workbook; nobody changes them."""
    from workbook_records import read_records, write_records_of_every_kind

    return read_records(made_once("kinds", write_records_of_every_kind))


@pytest.fixture
def figure(record_property):
    """Call figure("what", value) to show a measured figure in the summary of the test run."""
    return lambda what, value: record_property("figure", f"{what}: {value}")


def pytest_addoption(parser):
    parser.addoption("--part", metavar="K/N", help="part K of N of the slow tests and studies")


def pytest_configure(config):
    """The quick tests never wait for a compiler; the others do where there is enough to compute."""
    gc.disable()  # until all is collected
    quick = "not slow" in config.option.markexpr
    os.environ.setdefault("TANKCAL_COMPILED", "0" if quick else "patient")


def pytest_collection_finish():
    """What was collected stays: looking through it for garbage again and again takes a fifth."""
    gc.freeze()
    gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """A test that asks for one of its module's `SLOW_FIXTURES` is slow as well.

    Of a test that is `slow(after=n)`, the first n cases are not: `make test` runs them. Slow tests
    and studies of another `--part` are left out.
    """
    seen = Counter()
    for item in items:
        if getattr(item.module, "SLOW_FIXTURES", frozenset()).intersection(item.fixturenames):
            item.add_marker("slow")
        mark = next((one for one in item.own_markers if one.name == "slow"), None)
        if mark is not None and mark.kwargs:
            case = (item.path, item.originalname)
            seen[case] += 1
            if seen[case] <= mark.kwargs["after"]:
                item.own_markers.remove(mark)
    if config.option.part:
        part, of = map(int, config.option.part.split("/"))
        kept, others = [], []
        for item in items:
            is_long = item.get_closest_marker("slow") or item.get_closest_marker("study")
            number = crc32(f"{item.path.name}::{item.originalname}".encode()) % of
            (others if is_long and number != part % of else kept).append(item)
        config.hook.pytest_deselected(items=others)
        items[:] = kept


def pytest_terminal_summary(terminalreporter):
    """Print the figures that tests measured: what they guard is a number, not only a verdict."""
    lines = [
        f"  {text}"
        for outcome in ("passed", "failed")
        for report in terminalreporter.stats.get(outcome, [])
        for name, text in report.user_properties
        if name == "figure"
    ]
    if lines:
        terminalreporter.section("figures measured")
        terminalreporter.write_line("\n".join(sorted(lines)))
