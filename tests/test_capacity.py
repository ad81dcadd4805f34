"""The capacity table: rows, deliveries, declared inputs and degrees of freedom."""

from dataclasses import replace

import numpy as np
import pytest
from jacobians import assert_derivative
from shapes import azimuths, ring, section_of

from tankcal.capacity import Capacity, Propagation, table_heights
from tankcal.errors import HeightError
from tankcal.uncertainty import Source
from tankcal.volumes import ShellVolume, course_shape

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


def test_one_source_of_many_columns_has_its_degrees_of_freedom_once():
    """Ten columns from one noise estimate of 9 dof are 9 dof, not 90 (GUM G.4.1)."""
    found = table(points=(np.ones(10), 9.0))
    assert found.dof[-1] == pytest.approx(9.0)


def test_a_table_without_uncertainty_has_none():
    found = table()
    assert np.all(found.u_m3 == 0)
    assert np.all(np.isinf(found.dof))


def test_a_delivery_cancels_what_both_dips_share():
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


def test_below_the_bottom_there_is_nothing_and_no_uncertainty():
    sources = propagation().sources(np.array([-0.02, 0.0, 1.0]))
    datum = next(source for source in sources if source.kind == "datum")
    assert datum.columns_m3[0, 0] == 0.0
    assert datum.columns_m3[2, 0] > 100


@pytest.mark.parametrize(
    ("step", "top", "rows", "last"),
    [
        (0.01, 9.5, 951, 9.5),
        (0.01, 9.4999, 951, 9.4999),
        (0.3, 1.0, 5, 1.0),
        (0.001, 12.0, 12001, 12),
    ],
)
def test_rows_go_to_the_very_top(step, top, rows, last):
    heights = table_heights(step, top)
    assert len(heights) == rows
    assert heights[-1] == pytest.approx(last, abs=1e-9)
    assert heights[-1] <= top
    assert np.all(np.diff(heights) > 0)
    assert np.allclose(heights[:-1], np.arange(rows - 1) * step)


class Declared:
    u, u_as_read, unit, note = 1.0, 1.0, "x", ""
    type, distribution, dof = "B", "normal", np.inf

    def __init__(self, name):
        self.name = name


def propagation(inset=0.008, temperature=12.0, expansion=1.1e-5, stretch=1.0):
    outline = section_of(ring(6.5 * stretch, azimuths(24))).outline
    scale = 1 + expansion * temperature
    course = course_shape(0, 9.5, [4.0], [outline], inset_m=inset, scale=scale)
    return Propagation(
        ShellVolume((course,)),
        np.zeros((1, 0)),
        np.inf,
        np.zeros((1, 0)),
        tuple(Declared(name) for name in ("scale", "datum")),
        scale,
        expansion,
    )


@pytest.mark.parametrize(
    ("name", "vary", "at", "step"),
    [
        ("plate_thickness", lambda x: propagation(inset=x), 0.008, 1e-5),
        ("paint", lambda x: propagation(inset=x), 0.008, 1e-5),
        ("expansion", lambda x: propagation(expansion=x), 1.1e-5, 1e-7),
        ("shell_temperature", lambda x: propagation(temperature=12.0 - x), 0.0, 1e-2),
    ],
)
def test_derivatives_by_declared_inputs(name, vary, at, step):
    """Against differences of the volume itself."""
    levels = [0.5, 9.5]
    analytic = propagation().derivative(name, levels)[:, None]
    assert_derivative(
        lambda x: vary(x[0]).volume.volume_m3(levels), [at], analytic, step=step, tolerance=1e-5
    )


def test_derivatives_by_scale_and_datum_closed_form():
    found = propagation(inset=0.0)
    volume, area = found.volume.volume_m3([4.0])[0], found.volume.area_m2([4.0])[0]
    assert found.derivative("scale", [4.0])[0] == pytest.approx(2 * volume)
    assert found.derivative("datum", [4.0])[0] == pytest.approx(area)
    by_difference = (propagation(0.0, stretch=1 + 1e-6).volume.volume_m3([4.0])[0] - volume) / 1e-6
    assert found.derivative("scale", [4.0])[0] == pytest.approx(by_difference, rel=1e-5)


def test_every_declared_input_is_one_source():
    kinds = [source.kind for source in propagation().sources([1.0])]
    assert kinds == ["points", "scale", "datum"]
