"""The breakpoints of docs/house.md, by which a reading is followed to a row of the table.

Kind of truth: the calls of a run.
"""

import re
import sys

import pytest
from conftest import ROOT

import tankcal


@pytest.mark.slow
def test_a_run_passes_the_breakpoints_in_their_order():
    page = (ROOT / "docs" / "house.md").read_text(encoding="utf-8")
    table = page.partition("| breakpoint |")[2].partition("\n\n")[0]
    named = re.findall(r"^\| `(\S+\.py)` `(\w+)` \|", table, re.MULTILINE)
    assert len(named) == 7
    job, passed = tankcal.load(ROOT / "examples" / "silva-1995-photos"), []

    def note(frame, event, argument):
        code = frame.f_code
        place = (code.co_filename.removeprefix(f"{ROOT}/"), code.co_name)
        if event == "call" and place in named and place not in passed:
            passed.append(place)

    sys.setprofile(note)
    try:
        tankcal.run(job)
    finally:
        sys.setprofile(None)
    assert passed == named
