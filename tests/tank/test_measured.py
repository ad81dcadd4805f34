"""A zone measured by liquid: the measured table within, the other parts above it."""

import numpy as np
import pytest
from jacobians import assert_derivative

from tankcal.errors import HeightError, SolutionError
from tankcal.tank.bottoms import shaped_bottom
from tankcal.tank.fittings import deadwood
from tankcal.tank.parts import Part
from tankcal.tank.volumes import PartAbove, measured_bottom

AREA = np.pi * 6.5**2
LEVELS = np.array([-0.15, -0.10, -0.05, 0.0, 0.05, 0.12, 0.20, 0.30])
U = np.array([0.0, 0.01, 0.02, 0.03, 0.03, 0.025, 0.05, 0.08])


class Cylinder(Part):
    """A shell of one radius, as a part (closed form)."""

    def volume_m3(self, levels_m):
        return AREA * np.maximum(levels_m, 0.0)

    def area_m2(self, levels_m):
        return AREA * (np.asarray(levels_m) >= 0)

    def derivatives(self, levels_m):
        return {"scale": 2 * self.volume_m3(levels_m), "datum": self.area_m2(levels_m)}

    def sources(self, levels_m):
        return deadwood(["wall"], [0.0], [9.5], [9.5 * AREA], [1.0]).sources(levels_m)


def cone_tank(levels):
    """Capacity of a cylinder on a cone 0.15 m deep, closed form."""
    cone = shaped_bottom("cone", AREA, -0.15)
    return cone.volume_m3(levels) + Cylinder().volume_m3(levels)


def measured(u=U):
    return measured_bottom(LEVELS, cone_tank(LEVELS), u)


def test_the_measured_volumes_are_the_table():
    assert measured().volume_m3(LEVELS) == pytest.approx(cone_tank(LEVELS), rel=1e-14, abs=1e-14)


def test_above_the_zone_the_shell_is_added():
    """V_measured + V_shell(h) - V_shell(highest), the truth here."""
    levels = np.array([0.30, 0.31, 2.0, 9.5])
    total = measured().volume_m3(levels) + PartAbove(Cylinder(), 0.30).volume_m3(levels)
    assert total == pytest.approx(cone_tank(levels), rel=1e-13)
    assert not np.any(PartAbove(Cylinder(), 0.30).volume_m3(LEVELS))


def test_above_the_zone_only_increments_are_uncertain():
    """Both parts of the shell's errors that the measured zone replaced cancel."""
    part = PartAbove(Cylinder(), 0.30)
    levels = np.array([0.1, 0.30, 0.5, 9.5])
    beyond = np.maximum(levels - 0.30, 0)
    assert part.derivatives(levels)["scale"] == pytest.approx(2 * AREA * beyond, abs=1e-12)
    assert part.derivatives(levels)["datum"] == pytest.approx(0.0, abs=1e-12)
    assert part.sources(levels)[0].columns_m3[:, 0] == pytest.approx(beyond / 9.5, abs=1e-14)
    assert part.area_m2(levels) == pytest.approx([0, AREA, AREA, AREA])


@pytest.mark.parametrize("lowest", [-0.15, 0.0])
def test_between_dips_smooth_is_truer_than_straight(lowest, figure):
    """A cone with eight dips over its depth and 0.25 m more, closed form as truth."""
    rise = 0.0 if lowest else 0.15
    bottom = shaped_bottom("cone", AREA, lowest or rise)
    dips, fine = np.linspace(lowest, 0.25, 8), np.linspace(lowest, 0.25, 2001)
    true = bottom.volume_m3(fine) + Cylinder().volume_m3(fine)
    volumes = bottom.volume_m3(dips) + Cylinder().volume_m3(dips)
    part = measured_bottom(dips, volumes)
    smooth = np.abs(part.volume_m3(fine) - true)
    straight = np.abs(np.interp(fine, dips, volumes) - true)
    u = np.abs(part.sources(fine)[1].columns_m3[:, 0])
    covered = np.mean(smooth <= 1.96 * u + 1e-9)
    figure(
        f"bottom by liquid, cone {'down' if lowest else 'up'}, eight dips: worst error",
        f"smooth {1e3 * smooth.max():.0f} L, straight {1e3 * straight.max():.0f} L, "
        f"covered {100 * covered:.0f} %",
    )
    assert smooth.max() < straight.max() / 2
    assert covered > 0.95


def test_the_table_never_falls():
    """Property: random rising volumes give a rising curve and no negative area."""
    rng = np.random.default_rng(3)
    fine = np.linspace(-0.15, 0.30, 999)
    for _ in range(50):
        volumes = np.cumsum(rng.exponential(1.0, 8) * (rng.random(8) > 0.3))
        part = measured_bottom(LEVELS, volumes)
        assert np.all(np.diff(part.volume_m3(fine)) >= -1e-12)
        assert np.all(part.area_m2(fine) >= -1e-12)


def test_the_area_is_the_derivative_by_the_level():
    part = measured()
    between = np.array([-0.2, -0.12, -0.01, 0.03, 0.11, 0.25, 0.4])
    area = part.area_m2(between)
    assert_derivative(
        lambda x: part.volume_m3(between + x[0]), [0.0], area[:, None], tolerance=1e-6
    )
    assert part.derivatives(between) == {}


def test_measured_dips_have_u_and_rows_above_the_last():
    errors, curve = measured().sources(np.append(LEVELS, [0.31, 9.0]))
    u = np.sqrt(np.sum(errors.columns_m3**2, axis=1))
    assert u == pytest.approx(np.append(U, [0.08, 0.08]), rel=1e-12)
    assert not np.any(curve.columns_m3[[0, 3, 7, 8, 9]])
    assert errors.columns_m3[-1] - errors.columns_m3[-2] == pytest.approx(0.0)


def test_delivery_in_liquid_zone_has_u_of_metered_volume():
    """Independent batches of sd 0.01, 0.02, ...: closed form, differences of their sums."""
    batches = np.array([0.01, 0.02, 0.01, 0.03, 0.02, 0.01, 0.02, 0.01])
    part = measured(np.sqrt(np.cumsum(batches**2)))
    columns = part.sources(LEVELS)[0].columns_m3
    between = np.sqrt(np.sum((columns[5] - columns[2]) ** 2))
    assert between == pytest.approx(np.sqrt(np.sum(batches[3:6] ** 2)), rel=1e-12)


def test_below_the_lowest_dip():
    assert measured().volume_m3([-0.3])[0] == 0  # empty there
    assert measured().lowest_m == -0.15
    heel = measured_bottom([0.0, 0.1, 0.2], [3.0, 15.0, 28.0])
    assert heel.volume_m3([0.0])[0] == 3.0
    assert heel.lowest_m == 0.0
    with pytest.raises(HeightError, match="below the lowest level measured"):
        heel.volume_m3([0.1, -0.01])


@pytest.mark.parametrize(
    ("levels", "volumes", "u", "words"),
    [
        ([0.0], [1.0], None, "1 volumes measured by liquid"),
        ([0.0, 0.1, 0.1], [1.0, 2.0, 3.0], None, "volume 3 measured"),
        ([0.0, 0.1, 0.2], [1.0, 2.0, 1.9], None, "volume 3 measured"),
        ([0.0, 0.1], [-1.0, 2.0], None, "volume 1 measured"),
        ([0.0, 0.1], [1.0, np.nan], None, "volume 2 measured"),
        ([0.0, 0.1], [1.0, 2.0], [0.0, -1.0], "volume 2 measured"),
    ],
)
def test_impossible_measured_volumes_are_refused(levels, volumes, u, words):
    with pytest.raises(SolutionError, match=words):
        measured_bottom(levels, volumes, u)
