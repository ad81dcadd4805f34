"""What a wall tells of offsets and poses that nothing else binds, and what that leaves uncertain.

Truth: exact geometry of a wall hit from outside; errors propagated through the estimate itself,
written out; differences in place of derivatives.
"""

import numpy as np
import pytest
from jacobians import assert_derivative
from test_hit_wall import HEIGHT, LEVELS, PLATE, SLOPE, arc_parts, line_parts, run, strapped

from tankcal.geometry.circles import circle_by_points, fit_circle
from tankcal.pipeline.wall.shape import wall_shape_of
from tankcal.record.survey import sections_of

SETUPS, SEED = 6, 4


def book(seed=SEED):
    """Parts of a strapped tank hit from six set-ups round it that share nothing, offset unknown."""
    parts = strapped(arc_parts(SETUPS, seed=seed, wide=1.5))
    del parts.registers["instruments"]["TS"]["u_offset_mm"]
    parts.settings["checks.diameter_is"] = "inside"
    return parts


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """Result of that book."""
    return run(tmp_path_factory.mktemp("sound"), book())


def test_a_circle_by_its_points():
    rng = np.random.default_rng(1)
    turn = rng.uniform(0, 2 * np.pi, 7)
    xy = 6.5 * np.column_stack([np.sin(turn), np.cos(turn)]) + rng.normal(0, 1e-9, (7, 2))
    root = rng.normal(size=(14, 14))
    covariance = 1e-6 * (root @ root.T)

    def values(flat):
        found = fit_circle(flat.reshape(-1, 2), covariance)
        return np.array([found.x_m, found.y_m, found.radius_m])

    by = circle_by_points(fit_circle(xy, covariance), xy, covariance)
    assert_derivative(values, xy.ravel(), by, tolerance=1e-6)


def propagated(wall):
    """(3m, 3m) covariance of points after what was told is off them: of all errors by themselves.

    Of (I - D G B) e - D G f, e the errors of the points and f what else the readings have.
    """
    field, by, own = wall.field, wall.radii_by_points, wall.covariance_m2.dense()
    moved = wall.estimated_unknowns.moved_m @ wall.estimated_unknowns.by_readings
    kept = np.eye(by.shape[1]) - moved @ by
    other = field.covariance_m2 - by @ (by @ own).T
    return kept @ own @ kept.T + moved @ other @ moved.T


@pytest.mark.slow
@pytest.mark.parametrize("parts", [line_parts, book])
def test_points_have_the_covariance_of_all_errors(tmp_path, parts):
    """Second method: errors propagated through the estimate, with and without a free offset."""
    wall = run(tmp_path, parts()).wall
    count = len(wall.accepted)
    found, whole = wall.spread_of(np.eye(3 * count), np.arange(count)), propagated(wall)
    np.testing.assert_allclose(found, whole, atol=1e-6 * np.abs(whole).max())
    own = found.reshape(count, 3, count, 3)[range(count), :, range(count)]
    np.testing.assert_allclose(wall.point_covariances_m2(), own, atol=1e-12 * np.abs(own).max())
    for section in wall.sections:
        assert section.circle.cofactor_m2[2, 2] > 0


@pytest.mark.slow
def test_a_sound_book_from_outside(sound):
    """Truth: the wall's mean radius, 6.5 m and 1 mm a metre of height, and its plate."""
    for one in sections_of(sound):
        truth = 6.5 + 0.001 * one.height_m + PLATE
        assert abs(one.radius_m - truth) < 1.96 * one.radius_sd_m
        inside = np.pi * ((truth**2) + 0.006**2 / 2)
        assert abs(one.area_m2 - inside) < 1.96 * one.area_sd_m2
    alarms = {"inside_unlike_drawing", "side_doubtful", "offset_strange", "wall_unlike_nominal"}
    assert not alarms & {one.expected.code for one in sound.warnings}


@pytest.mark.slow
def test_what_was_told_is_off_the_hits(sound):
    """Property: the wall that they show moves none of them any more."""
    assert sound.wall.estimated_unknowns.largest_m < 1e-5
    assert set(sound.sighting.estimated_m) == {"TS"}


@pytest.mark.slow
@pytest.mark.parametrize("parts", [line_parts, book])
def test_set_ups_that_share_nothing_tell_the_plumb(tmp_path, parts):
    """Truth: the lean of the wall; each set-up sees all its levels by one vertical."""
    result = run(tmp_path, parts())
    shape = wall_shape_of(result.job, result.wall)
    centred = [one for one in shape.levels if one.ring >= 0]
    lean = np.array((0.0018, -0.0009) if parts is line_parts else SLOPE)
    apart = lean * (centred[-1].height_m - centred[0].height_m)
    assert len(centred) == (3 if parts is line_parts else len(LEVELS))
    assert centred[-1].height_m < HEIGHT
    away = shape.axis.value_m[:2] - apart
    assert np.all(np.abs(away) < 1.96 * shape.axis.u_m[:2])
    assert np.all(shape.axis.u_m < (3e-3 if parts is line_parts else 1e-3))
