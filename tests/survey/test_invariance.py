"""What must not matter does not: where the frame lies, how it is turned, order and names.

Property. And what must matter is told: mirrored axes.
"""

from dataclasses import replace

import numpy as np
import pytest
from surveyed import by_instruments, by_photographs, known

from tankcal.errors import SolutionError
from tankcal.survey import adjust_survey
from tankcal.survey.measurements import AdjustmentSettings, NominalTank

UTM = np.array([512345.678, 7512345.678, 812.345])
MAKERS = {"photographs": by_photographs, "instruments": by_instruments}


@pytest.fixture(scope="module", params=MAKERS)
def surveyed(request):
    """Measurements and their Adjustment."""
    measurements, _ = MAKERS[request.param](seed=3)
    return measurements, adjust_survey(measurements)


def with_control(measurements, change):
    """The measurements with control at change(xyz)."""
    control = measurements.control
    return replace(measurements, control=replace(control, xyz_m=change(control.xyz_m)))


def compared(one, other, back):
    """Largest change (m) of a coordinate, relative change of covariances, of two Adjustments.

    back  rotation (3, 3) and shift (3,): xyz of one = rotation (xyz of other - shift)
    """
    rotation, shift = back
    place = [other.names.index(name) for name in one.names]
    away = (other.xyz_m[place] - shift) @ rotation.T - one.xyz_m
    covariance = rotation @ other.covariance_m2[place] @ rotation.T - one.covariance_m2
    return np.abs(away).max(), np.abs(covariance).max() / np.abs(one.covariance_m2).max()


def told(figure, what, differences):
    """Show the figure and hand it on."""
    figure(what, f"{differences[0]:.1e} m, covariance {differences[1]:.1e}")
    return differences


@pytest.mark.slow
def test_coordinates_as_large_as_utm(surveyed, figure):
    measurements, before = surveyed
    far = with_control(measurements, lambda xyz: xyz + UTM)
    if measurements.targets is not None:
        targets = measurements.targets
        far = replace(far, targets=replace(targets, z_m=targets.z_m + UTM[2]))
        far = replace(far, nominal=replace(far.nominal, bottom_z_m=UTM[2]))
    away, covariance = told(
        figure, "moved by UTM coordinates", compared(before, adjust_survey(far), (np.eye(3), UTM))
    )
    assert away < 1e-6
    assert covariance < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [37.0, 180.0])
def test_a_frame_turned_about_the_vertical(surveyed, degrees, figure):
    measurements, before = surveyed
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    after = adjust_survey(with_control(measurements, lambda xyz: xyz @ turn.T))
    away, covariance = told(
        figure, f"turned by {degrees:.0f} deg", compared(before, after, (turn.T, np.zeros(3)))
    )
    assert away < 1e-6
    assert covariance < 1e-5


def shuffled(measurements, rng):
    """The measurements with the rows of every table in another order."""

    def mixed(table):
        if table is None:
            return None
        n = len(table.rows)
        order = rng.permutation(n)
        parts = {}
        for name, value in vars(table).items():
            if isinstance(value, np.ndarray) and len(value) == n:
                parts[name] = value[order]
            elif isinstance(value, tuple) and len(value) == n and name != "rows":
                parts[name] = tuple(value[i] for i in order)
        return replace(table, **parts)

    tables = ("image_points", "control", "check", "targets")
    return replace(
        measurements,
        **{name: mixed(getattr(measurements, name)) for name in tables},
        readings=tuple(mixed(one) for one in measurements.readings),
        photos=tuple(measurements.photos[i] for i in rng.permutation(len(measurements.photos))),
        setups=tuple(measurements.setups[i] for i in rng.permutation(len(measurements.setups))),
    )


@pytest.mark.slow
def test_the_order_of_rows(surveyed, figure):
    measurements, before = surveyed
    after = adjust_survey(shuffled(measurements, np.random.default_rng(0)))
    away, covariance = told(
        figure, "rows in another order", compared(before, after, (np.eye(3), np.zeros(3)))
    )
    assert away < 1e-7
    assert covariance < 1e-6
    assert after.sigma0 == pytest.approx(before.sigma0, rel=1e-7)
    removed = [{(one.kind, one.ids) for one in found.removed} for found in (before, after)]
    assert removed[0] == removed[1]


@pytest.mark.slow(after=1)
def test_the_names_of_points(surveyed):
    measurements, before = surveyed
    names = {name: f"{len(before.names) - i:03d}x" for i, name in enumerate(before.names)}

    def named(table):
        if table is None:
            return None
        parts = {}
        for field in ("point", "start", "end", "origin"):
            if hasattr(table, field):
                parts[field] = tuple(names.get(one, one) for one in getattr(table, field))
        return replace(table, **parts)

    after = adjust_survey(
        replace(
            measurements,
            control=named(measurements.control),
            targets=named(measurements.targets),
            image_points=named(measurements.image_points),
            readings=tuple(named(one) for one in measurements.readings),
            setups=tuple(replace(one, station=names[one.station]) for one in measurements.setups),
        )
    )
    place = [after.names.index(names[name]) for name in before.names]
    assert np.abs(after.xyz_m[place] - before.xyz_m).max() < 1e-7


@pytest.mark.slow
def test_the_scale_of_a_survey_without_lengths(figure):
    """Photographs and control alone: control twice as large, everything is twice as large."""
    measurements, _ = by_photographs(seed=3)
    only = replace(measurements, readings=(), instruments=())
    control, targets = only.control, only.targets
    large = replace(
        only,
        control=replace(control, xyz_m=2 * control.xyz_m, sd_m=2 * control.sd_m),
        targets=replace(targets, z_m=2 * targets.z_m),
        nominal=NominalTank(2 * only.nominal.radius_m, 2 * only.nominal.height_m, 0.0),
    )
    before, after = adjust_survey(only), adjust_survey(large)
    place = [after.names.index(name) for name in before.names]
    away = np.abs(after.xyz_m[place] / 2 - before.xyz_m).max()
    figure("a survey of twice the size", f"{away:.1e} m")
    assert away < 1e-6
    ratio = after.covariance_m2[place] / 4 - before.covariance_m2
    assert np.abs(ratio).max() < 1e-5 * np.abs(before.covariance_m2).max()
    assert after.sigma0 == pytest.approx(before.sigma0, rel=1e-6)


def all_around(name):
    """Measurements with control that does not lie in one vertical plane, and the Truth."""
    measurements, truth = MAKERS[name](seed=3)
    if name == "photographs":
        number = [0, 5, 14, 22, 27, 33, 40, 47]
        control = known([f"P{i}" for i in number], truth.xyz_m[number], 0.002)
        measurements = replace(measurements, control=control)
    return replace(measurements, settings=AdjustmentSettings(snooping=False))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param("photographs", marks=pytest.mark.study), "instruments"]
)
def test_mirrored_axes_are_reported(name):
    """x east and y north swapped in the control: no answer, or one with a warning that says so."""
    measurements = all_around(name)
    before = adjust_survey(measurements)
    try:
        after = adjust_survey(with_control(measurements, lambda xyz: xyz[:, [1, 0, 2]]))
    except SolutionError as error:
        words = str(error)
    else:
        assert after.sigma0 > 10 * before.sigma0
        words = " ".join(map(str, after.warnings))
    assert any(word in words for word in ("swapped", "mirrored", "left-handed"))
