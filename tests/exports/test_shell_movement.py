"""HyTD: the movement of a gauge that hangs on the shell of tank S-1, and the line nearest to it."""

import numpy as np
import pytest
from page_figures import agree, figures_of

from tankcal.products.exports.exporting import gauge_correction, shortening_m

S1 = tuple(
    zip(
        (1.8, 1.8, 1.8, 1.5, 1.5),
        (0.009, 0.008, 0.007, 0.006, 0.006),
        (7.203189, 7.203171, 7.203422, 7.203563, 7.203165),
        strict=True,
    )
)


def test_shortening_of_s1():
    """Published, in mm (a sum over z: its first number is 0.0005 mm above the integral)."""
    found = 1000 * shortening_m([2, 4, 6, 8.4], S1, 850, 206e9)
    np.testing.assert_allclose(found, [0.020, 0.081, 0.190, 0.397], atol=6e-4)


def test_shortening_by_quadrature():
    """Second method: the hoop stress summed over thin rings, each nu sigma / E shorter."""
    z = (np.arange(84000) + 0.5) * 1e-4
    plate = np.repeat([one[1] for one in S1], [18000, 18000, 18000, 15000, 15000])
    radius = np.repeat([one[2] for one in S1], [18000, 18000, 18000, 15000, 15000])
    hoop = 850 * 9.80665 * np.maximum(7.3 - z, 0) * radius / plate
    assert shortening_m([7.3], S1, 850, 206e9) == pytest.approx(
        0.3 * hoop.sum() * 1e-4 / 206e9, rel=1e-7
    )


@pytest.mark.slow
def test_line_of_s1():
    """Published: L_0 = 2.46 m, D = 0.0618 mm/m, off by 0.030 mm."""
    found = gauge_correction(8.4, S1, 850, 206e9)
    assert found.start_m == pytest.approx(2.46, abs=0.01)
    assert round(1000 * found.factor, 4) == 0.0618
    printed = figures_of(
        "docs/studies/exports.md",
        "() kg/m3, has () m and () mm/m, with an error of at most () mm",
    )
    assert agree([850, found.start_m, 1000 * found.factor, 1000 * found.off_m], printed)
    assert round(1000 * found.off_m, 3) == 0.030


@pytest.mark.slow
def test_no_line_is_nearer():
    """Property: the stated distance is reached, and no neighbouring line has a smaller one."""
    found = gauge_correction(8.4, S1, 850, 206e9)
    level = np.linspace(0, 8.4, 2001)
    true = shortening_m(level, S1, 850, 206e9)

    def off(start, factor):
        return np.abs(np.maximum(level - start, 0) * factor - true).max()

    assert off(found.start_m, found.factor) == pytest.approx(found.off_m, rel=1e-3)
    for start in (-0.05, 0.05):
        for part in (-0.01, 0.01):
            assert off(found.start_m + start, found.factor * (1 + part)) > found.off_m
