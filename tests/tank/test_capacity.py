"""The capacity table: rows, deliveries, degrees of freedom, zones that are not for use."""

from dataclasses import replace

import numpy as np
import pytest

from tankcal.errors import HeightError
from tankcal.tank.capacity import Capacity, Quantity
from tankcal.uncertainty import Source

HEIGHTS = np.linspace(0, 9.5, 11)


def table(**sources):
    """A cylinder of 130 m2 with the given columns of standard uncertainty (m3 at full height)."""
    part = HEIGHTS / 9.5
    return Capacity(
        HEIGHTS,
        130 * HEIGHTS,
        np.full(11, 130.0),
        tuple(Source(kind, np.outer(part, u), dof) for kind, (u, dof) in sources.items()),
        0.95,
    )


def test_columns_of_the_factor_add_in_squares():
    found = table(points=([3.0, 4.0], np.inf), scale=([12.0], np.inf))
    assert found.u_m3[-1] == pytest.approx(13.0)  # closed form
    assert found.factor_m3.shape == (11, 3)
    assert found.U_m3[-1] == pytest.approx(1.959964 * 13, rel=1e-6)


def test_few_degrees_of_freedom_enlarge_k():
    found = table(points=([1.0], 5.0))
    assert found.k[-1] == pytest.approx(2.571, abs=5e-4)  # published: t table, 5 dof, 95 %
    assert found.dof[-1] == pytest.approx(5.0)


def test_source_of_many_columns_counts_its_dof_once():
    """Ten columns from one noise estimate of 9 dof are 9 dof, not 90 (GUM G.4.1)."""
    found = table(points=(np.ones(10), 9.0))
    assert found.dof[-1] == pytest.approx(9.0)


def test_a_table_without_uncertainty_has_none():
    found = table()
    assert np.all(found.u_m3 == 0)
    assert np.all(np.isinf(found.dof))


def test_delivery_cancels_common_errors():
    shared = Capacity(
        HEIGHTS,
        130 * HEIGHTS,
        np.full(11, 130.0),
        (Source("datum", np.full((11, 1), 0.5)),),
        0.95,
    )
    assert shared.delivery(2.0, 7.0).u_m3 == pytest.approx(0.0, abs=1e-15)
    assert shared.delivery(2.0, 7.0).value_m3 == pytest.approx(650.0)
    assert table(scale=([1.9], np.inf)).delivery(2.0, 7.0).u_m3 == pytest.approx(1.0)


def test_rows_at_once_are_as_each_dip_by_itself():
    """Second method: the single reading, of sources with many columns, one, and none at a row."""
    rng = np.random.default_rng(1)
    many = Source("points", rng.normal(size=(11, 7)), 4.0)
    one = Source("scale", (HEIGHTS / 9.5 - 1)[:, None], 2.5)
    found = replace(table(), sources=(many, one, Source("datum", np.ones((11, 1)))))
    each = [found.at(height) for height in HEIGHTS]
    for name in ("u_m3", "dof", "k", "U_m3"):
        expected = [getattr(quantity, name) for quantity in each]
        assert getattr(found, name) == pytest.approx(expected, rel=1e-13), name
    assert np.sum(found.factor_m3**2, axis=1) == pytest.approx(found.u_m3**2, rel=1e-13)


def test_between_rows_the_table_is_read_linearly():
    found = table(points=([1.0], np.inf)).at(1.3)
    assert found.value_m3 == pytest.approx(169.0)
    assert found.u_m3 == pytest.approx(1.3 / 9.5)


@pytest.mark.parametrize("height", [-0.001, 9.5001, float("nan"), float("inf")])
def test_heights_outside_are_errors(height):
    with pytest.raises(HeightError, match="outside the capacity table"):
        table().at(height)


def test_the_top_may_be_typed_as_it_is_read():
    """A leaning shell ends at 9.49995 m; a dip is read to the millimetre."""
    found = replace(table(), height_m=np.append(HEIGHTS[:-1], 9.49995))
    assert found.at(9.5).value_m3 == found.volume_m3[-1]
    with pytest.raises(HeightError):
        found.at(9.501)


def test_critical_zone_of_roof_is_flagged_without_edges():
    found = replace(table(), critical_m=(1.9, 3.8))
    assert found.for_use([0.0, 1.9, 2.0, 3.7, 3.8]).tolist() == [True, True, False, False, True]
    assert not found.at(2.5).for_use
    assert found.at(5.0).for_use
    assert not found.delivery(3.0, 7.0).for_use
    assert found.delivery(0.5, 7.0).for_use
    assert table().at(2.5).for_use


def test_ends_of_a_quantity():
    """value -+ U, or the ends that a simulation gave."""
    by_gum = Quantity(10.0, 0.1, 50.0, 2.0, 0.2)
    simulated = replace(by_gum, ends_m3=(9.7, 10.4))
    assert (by_gum.low_m3, by_gum.high_m3) == (9.8, 10.2)
    assert (simulated.low_m3, simulated.high_m3) == (9.7, 10.4)


def test_a_table_shows_its_rows_and_its_top():
    assert repr(table()).startswith("<Capacity of 11 rows to 9.5 m: 1235")
