"""A slip in all readings of a kind is refused, or asked about, by its name; sound books are quiet.

Simulation: the tanks and crews of `crews`, whose readings are spoilt as a crew does by hand.
"""

import pytest
from test_slips_of_crews import book_of, computed

from tankcal.errors import InputError

IN_METRES = [
    ("strapping", "circumferences", "s_mm"),
    ("lines", "offsets", "s_mm"),
]


def problems_of(folder, book):
    with pytest.raises(InputError) as told:
        computed(folder, book)
    return [(one.expected.code, one.row, one.column) for one in told.value.problems]


@pytest.mark.parametrize(("kind", "table", "column"), IN_METRES)
def test_standard_deviations_in_metres_are_refused(tmp_path, kind, table, column):
    book = book_of(kind, 1002)
    for row in book.tables[table]:
        row[column] /= 1000
    assert problems_of(tmp_path, book) == [("sd_below_any_mm", 2, column)]


def test_standard_deviations_of_an_instrument_in_other_units_are_refused(tmp_path):
    book = book_of("hits", 1002)
    name = "ET-5"
    book.instruments[name] |= {"s_mm": 0.001, "s_arcsec": 0.001}
    codes = ["sd_below_any_mm", "sd_below_any_arcsec"]
    found = problems_of(tmp_path, book)
    assert [one[0] for one in found] == codes
    assert [one[2] for one in found] == [f"{name}.s_mm", f"{name}.s_arcsec"]


@pytest.mark.slow
def test_many_offsets_set_aside_are_one_question(tmp_path):
    """A twentieth of a millimetre where readings scatter by half a millimetre."""
    book = book_of("lines", 1002)
    for row in book.tables["offsets"]:
        row["s_mm"] = 0.05
    _, told = computed(tmp_path, book)
    assert "many_offsets_set_aside" in told
    assert "offset_set_aside" not in told
