"""The tables of a tank over the years: what is known of them comes out again, within U."""

from dataclasses import replace
from datetime import date

import numpy as np
import pytest
from histories import COMMON_U, dated_table, drawn_tables, inspections, radii_of_year
from page_figures import agree, figures_of
from tables_of_s1 import HEIGHTS, PLATES, former_s1

from tankcal.errors import InputError
from tankcal.products.recalibration.comparison import compare
from tankcal.products.recalibration.history import DatedTable, history_of
from tankcal.record.recalibration import HISTORY, HistoryFile
from tankcal.record.schema import from_plain, to_plain

K = 1.959963984540054
COURSES = HEIGHTS, PLATES


def radii_in(found, certificate):
    return np.array([one.radius_m for one in found.radii if one.certificate == certificate])


@pytest.mark.slow
def test_known_radii_of_every_year_come_out():
    """Closed form: no table has an error, so the radii are those that it was made of."""
    found = history_of([dated_table(number) for number in (5, 0, 2)], courses=COURSES)
    for certificate, number in enumerate((0, 2, 5), 1):
        np.testing.assert_allclose(
            radii_in(found, certificate), radii_of_year(number), rtol=0, atol=2e-6
        )
    change = [one.d_m for one in found.changes[0].radii]
    np.testing.assert_allclose(change, radii_of_year(2) - radii_of_year(0), rtol=0, atol=2e-6)


@pytest.mark.slow
def test_a_table_on_another_basis_gives_its_radii():
    """Closed form: 15 degrees, no head and another zero in the oldest one (tables_of_s1)."""
    old = former_s1(np.round(np.arange(0.10, 8.405, 0.05), 3), common=None, date="1999-05-20")
    found = history_of(
        [DatedTable(old, "0", date(1999, 5, 20)), dated_table(0)], courses=COURSES
    )  # fmt: skip
    (near_um,) = figures_of(
        "docs/studies/compare.md", "without head and with another zero, agree to () µm"
    )
    np.testing.assert_allclose(
        radii_in(found, 1), radii_of_year(0) - 0.0005, rtol=0, atol=1e-6 * float(near_um)
    )
    assert found.changes[0].zero_m == pytest.approx(0.002, abs=1e-9)
    assert found.changes[0].zero_source == "reference_heights"
    assert [one.code for one in found.warnings] == ["history_reference_height"]


@pytest.mark.slow
def test_drawn_tables_lie_within_their_U(figure):
    """Simulation: 40 tables with errors drawn by their u; radii and volumes within U in 95 %."""
    tables = drawn_tables(40)
    found = history_of(tables, courses=COURSES)
    off = [
        (one.radius_m - radii_of_year(one.certificate - 1)[one.course - 1]) / one.U_m
        for one in found.radii
        if one.course == 3
    ]
    inside = np.mean(np.abs(off) <= 1)
    figure("history, radii within U of 40 tables", float(inside))
    count, percent = figures_of(
        "docs/studies/compare.md",
        "For () tables with errors drawn from their stated u, () % of the radii are within U",
    )
    assert int(count) == len(tables)
    assert agree([100 * inside], [percent])
    assert 0.85 <= inside <= 1.0
    # u of a radius is half the relative u of the volume, common to all rows
    U = [one.U_m for one in found.radii if one.course == 3]
    np.testing.assert_allclose(U, K * COMMON_U / 2 * radii_of_year(0)[2], rtol=2e-3)


@pytest.mark.slow
def test_successive_changes_are_those_of_compare():
    """Second way: `tankcal compare` of the same two tables."""
    tables = drawn_tables(4)
    found = history_of(tables, courses=COURSES)
    assert [(one.former, one.new) for one in found.changes] == [(1, 2), (2, 3), (3, 4)]
    for one in found.changes:
        alone = compare(
            *(tables[number - 1].table for number in (one.former, one.new)), courses=COURSES
        )
        assert one.worst_E_n == alone.correlation.worst_E_n
        assert one.top_d_m3 == alone.rows.d_m3[-1]
        assert (one.verdict, one.zero_m) == (alone.verdict, alone.zero.height_m)
        assert [radius.d_m for radius in one.radii] == [course.d_m for course in alone.courses]
        for radius, course in zip(one.radii, alone.courses, strict=True):
            assert radius.E_n == pytest.approx(course.w / K, rel=1e-12)
            assert radius.U_m == pytest.approx(K * course.u_m, rel=1e-12)
            parts = course.u_former_m, course.u_new_m, course.u_rounding_m
            assert course.u_m == pytest.approx(np.linalg.norm(parts), rel=1e-9)


@pytest.mark.slow
def test_the_order_of_the_files_does_not_matter():
    tables = drawn_tables(4)
    assert history_of(tables) == history_of(tables[::-1])
    days = [one.date for one in history_of(tables).certificates]
    assert days == sorted(days)


def test_a_certificate_ends_where_the_next_begins():
    found = history_of(drawn_tables(3))
    assert [one.superseded for one in found.certificates] == ["2001-05-31", "2002-05-31", None]
    assert [round(one.years, 2) for one in found.changes] == [1.0, 1.0]


def test_one_table_has_nothing_to_compare_with():
    found = history_of([dated_table(3)])
    assert found.changes == []
    assert [one.d_m3 for one in found.volumes] == [0.0] * 5


def test_a_history_goes_into_its_dataclass_and_back():
    saved = to_plain(history_of(drawn_tables(3), inspections()))
    assert HISTORY.migrated(saved, "history.json") == saved
    assert to_plain(from_plain(HistoryFile, saved)) == saved
    assert [one["date"] for one in saved["inspections"]] == ["2003-02-01", "2006-02-01", None]


def test_dips_that_are_asked_for():
    found = history_of(drawn_tables(2), dips_m=[7.5, 2.51])
    assert found.dips_m == [2.5, 7.5]
    with pytest.raises(InputError) as told:
        history_of(drawn_tables(2), dips_m=[0.0, 5.0, 9.0])
    assert [one.expected.code for one in told.value.problems] == ["history_dip_outside"] * 2


def test_tables_that_cannot_be_of_one_tank_are_all_told():
    tables = drawn_tables(4)
    for place in (1, 2):
        table = replace(tables[place].table, volume_m3=(1 + place) * tables[place].table.volume_m3)
        tables[place] = replace(tables[place], table=table)
    with pytest.raises(InputError) as told:
        history_of(tables)
    codes = [one.expected.code for one in told.value.problems]
    assert set(codes) == {"compare_other_tank"}
    assert {one.file for one in told.value.problems} >= {"2003.csv", "2002.csv"}


def test_days_zeros_and_sizes_that_differ_are_told():
    one, two, three = drawn_tables(3)
    two = replace(two, day=one.day)
    three = replace(three, table=replace(three.table, reference_height_m=9.2))
    codes = [warning.code for warning in history_of([one, two, three]).warnings]
    assert codes[:2] == ["history_same_day", "history_reference_height"]
