"""The walls that studies are drawn from are what they say, and their true volumes are true."""

import numpy as np
import pytest
from generated_walls import FAMILIES, FULL_TURN, LEAN, GeneratedWall, job_of, make_wall, survey

RIGHT = 1e-7  # 0.1 ppm

SIZES = pytest.mark.parametrize("radius_m", [3.0, 12.0, 40.0])
EVERY = pytest.mark.parametrize("family", FAMILIES)


def a_wall(family, radius_m):
    return make_wall(np.random.default_rng(0), family, radius_m=radius_m, courses=5)


@pytest.mark.slow
@EVERY
@SIZES
def test_areas_are_those_of_the_radii(family, radius_m):
    """Second method: half the square of the radius itself, at azimuths of another density."""
    wall, count = a_wall(family, radius_m), 150_001
    azimuth = FULL_TURN * np.arange(count) / count
    for course, zeta in ((0, -0.97), (2, 0.1), (4, 0.8)):
        radii = wall.radius_at(np.full(count, course), np.full(count, zeta), azimuth)
        area = wall.areas(course, np.array([zeta]))[0]
        assert area == pytest.approx(FULL_TURN * np.mean(radii**2) / 2, rel=RIGHT)


@pytest.mark.slow(after=6)
@EVERY
@SIZES
def test_volumes_are_those_of_the_areas(family, radius_m):
    """Second method: midpoints of 2 mm and less, up to each tenth of the height."""
    wall, count = a_wall(family, radius_m), 2000
    zeta = (2 * np.arange(count) + 1) / count - 1
    slices = np.concatenate([wall.areas(course, zeta) for course in range(wall.courses)])
    below = np.cumsum(slices)[999::1000] * wall.course_m / count
    heights = wall.height_m * np.arange(1, 11) / 10
    assert wall.volume_below(heights) == pytest.approx(below, rel=RIGHT)


def test_the_volume_of_a_barrel():
    """Closed form: pi times the integral of (R + b - b zeta^2)^2."""
    wall, bulge = GeneratedWall(7.5, 1, 2.0), 0.006
    wall.add(0, np.ones_like, lambda s: bulge * (1 - s**2))
    full = np.pi * 2 * ((7.5 + bulge) ** 2 - 2 / 3 * bulge * (7.5 + bulge) + bulge**2 / 5)
    assert wall.volume_below([2.0]) == pytest.approx(full, rel=1e-13)


def rises(wall):
    """(courses,) mean radius of the middle over that of the ends, m."""
    ends = np.array([wall.areas(course, np.array([-1.0, 0, 1.0])) for course in range(5)])
    low, middle, high = np.sqrt(ends / np.pi).T
    return middle - (low + high) / 2


@pytest.mark.slow(after=2)
@EVERY
def test_courses_bulge_outward_unless_told_not_to(family):
    """1 to 8 mm in the mean of the courses, which the scatter of a fifth moves by 9 %."""
    for seed in range(5):
        plain, bulging = (
            make_wall(np.random.default_rng(seed), family, radius_m=9.0, courses=5, bulge=bulge)
            for bulge in (False, True)
        )
        own = rises(bulging) - rises(plain)
        assert 0.7e-3 < own.mean() < 8e-3 * (1 + 3 * 0.09)


@pytest.mark.parametrize("layout", ["even", "free", "gap"])
def test_a_survey_is_of_the_wall(layout):
    wall, rng = a_wall("dents", 8.0), np.random.default_rng(1)
    measured = survey(rng, wall, rings=3, points=24, noise_m=0.0, layout=layout)
    places = measured.course, measured.zeta, measured.azimuth_rad
    assert len(measured.zeta) == 5 * 3 * 24
    assert measured.radius_m == pytest.approx(wall.radius_at(*places), abs=0)
    ring = np.sort(measured.azimuth_rad[:24])
    widest = np.degrees(np.diff([*ring, ring[0] + FULL_TURN]).max())
    assert (widest > 20) == (layout != "even")


def test_a_job_has_the_points_of_the_survey(tmp_path):
    wall, rng = a_wall("chord", 8.0), np.random.default_rng(1)
    measured = survey(rng, wall, rings=2, points=24, noise_m=0.002)
    job = job_of(wall, measured, tmp_path)
    x, y, z = job.points.xyz_m.T
    radii = np.hypot(x - LEAN[0] * z, y - LEAN[1] * z)
    assert radii == pytest.approx(measured.radius_m, rel=1e-12)
    upright = sum(one.height_m for one in job.courses) / np.hypot(1, np.hypot(*LEAN))
    assert upright == pytest.approx(wall.height_m, rel=1e-12)
    assert np.all(job.points.sd_m == 0.002)
    assert job_of(wall, measured, tmp_path, given=False).points.sd_m is None
