"""Fixtures shared by the tests: where data lies, and the shipped example computed once."""

import os
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import settings

import tankcal
from tankcal.record import record_of, save

os.environ.setdefault("TANKCAL_COMPILED", "patient")  # a run of few tests waits for no compiler
ROOT = Path(__file__).resolve().parent.parent
EXAMPLE = ROOT / "examples" / "silva-1995"

# the same examples on every machine, however slow; new ones by: pytest --hypothesis-profile search
settings.register_profile("house", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None, print_blob=True)
settings.load_profile("house")


@pytest.fixture(scope="session")
def shared():
    """The folder of data that is read in place; tests skip where it is absent."""
    folder = Path(os.environ.get("TANKCAL_DATA", ROOT.parent / "shared"))
    if not folder.is_dir():
        pytest.skip("no shared data here: set TANKCAL_DATA to its folder")
    return folder


@pytest.fixture(scope="session")
def example_result():
    """The shipped example, computed."""
    return tankcal.run(tankcal.load(EXAMPLE))


@pytest.fixture(scope="session")
def example_record(example_result, tmp_path_factory):
    """Path of the record.json of the shipped example."""
    path = tmp_path_factory.mktemp("example") / "record.json"
    save(record_of(example_result), path)
    return path


@pytest.fixture(scope="session")
def records_of_kinds(tmp_path_factory):
    """{kind: record} that together fill every sheet of the workbook; nobody changes them."""
    from workbook_records import records_of_every_kind

    return records_of_every_kind(tmp_path_factory.mktemp("kinds"))


@pytest.fixture
def figure(record_property):
    """Call figure("what", value) to show a measured figure in the summary of the test run."""
    return lambda what, value: record_property("figure", f"{what}: {value}")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Of a test that is `slow(after=n)`, the first n cases are not: `make test` runs them."""
    seen = Counter()
    for item in items:
        mark = next((one for one in item.own_markers if one.name == "slow"), None)
        if mark is not None and mark.kwargs:
            case = (item.path, item.originalname)
            seen[case] += 1
            if seen[case] <= mark.kwargs["after"]:
                item.own_markers.remove(mark)


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
