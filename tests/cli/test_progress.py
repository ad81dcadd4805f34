"""What a long step shows on a terminal."""

import io
import sys

import pytest

from tankcal.terminal import Progress, describe_progress


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        ((3, 10, 3, 1.0), "3/10"),  # too early to judge
        ((3, 10, 3, 30.0), "3/10, about 70 s left"),
        ((10, 10, 10, 30.0), "10/10"),
        ((0, 10, 0, 30.0), "0/10"),
        ((25e6, 100e6, 20e6, 10.0), "25.0/100.0 million, 2.0 million/s, about 38 s left"),
        ((5e7, 1e9, 5e7, 25.0), "50.0/1000.0 million, 2.0 million/s, about 8 min left"),
    ],
)
def test_rate_and_time_left(given, shown):  # by hand
    assert describe_progress(*given) == shown


@pytest.mark.parametrize(("columns", "lines"), [("100", 1), ("50", 2)])
def test_a_line_is_written_over_and_never_wraps(monkeypatch, columns, lines):
    terminal = io.StringIO()
    terminal.isatty = lambda: True
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("COLUMNS", columns)
    show = Progress(False)
    for done in (10**6, 2 * 10**6, 10**7):
        show.part("summing up the points of the scans", done, 10**7)
    show.end()
    rows = [row.rsplit("\r", 1)[-1] for row in terminal.getvalue().split("\n")[:-1]]
    assert len(rows) == lines
    assert "10.0/10.0 million" in rows[-1]
    assert max(map(len, rows)) < int(columns) + len("\x1b[K")
