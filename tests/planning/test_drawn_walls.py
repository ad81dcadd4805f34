"""What is read of a drawn wall: its hull, where rays meet it, its limbs, what it holds.

Truth: another program (Qhull), places on the outline itself, summation over fine outlines, the
round wall of no departure.
"""

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from wall_plan_folders import HITS, LINES, TANGENTS

from tankcal.planning import load_plan
from tankcal.planning.wall.nominal_readings import (
    EXACT,
    DrawnWall,
    Errors,
    RoundWall,
    add_network_errors,
    levels_of_readings,
    plates_of,
    set_readings,
)
from tankcal.survey.strapping import reduce_straps
from tankcal.survey.wall_hits import rays

PLANS = {"lines": LINES, "hits": HITS, "tangents": TANGENTS}


@pytest.fixture(scope="module", params=PLANS)
def plan(request):
    return load_plan(PLANS[request.param])


def drawn_on(plan, factor=1.0, seed=5):
    job = plan.job
    sizes = factor * plan.amplitudes.likely_m2
    return DrawnWall(job, sizes, levels_of_readings(job), np.random.default_rng(seed))


def outline_of(wall, course, level, *, inside=False, count=40_000):
    azimuth = 2 * np.pi * np.arange(count) / count
    radius = wall.radius_m(course, level, azimuth, inside=inside)
    return azimuth, np.column_stack([radius * np.sin(azimuth), radius * np.cos(azimuth)])


@pytest.mark.slow(after=2)
def test_a_wall_without_departures_is_the_round_one(plan):
    """Closed form; but for the hull, which the round one has as walls have it on average."""
    still, job = drawn_on(plan, 0.0), plan.job
    course, level = next(iter(levels_of_readings(job)))
    radius = still.nominal_m + plates_of(job)[course]
    assert still.girth_m(course, level) == pytest.approx(2 * np.pi * radius, rel=1e-9)
    azimuth, length = still.limb((radius * 2, 0.0), course, level, is_right=True)
    assert azimuth % (2 * np.pi) == pytest.approx(3 * np.pi / 2 + np.arcsin(0.5), abs=1e-5)
    assert length == pytest.approx(np.sqrt(3) * radius, abs=0.02)
    np.testing.assert_allclose(still.more_m3([0.5, 3.0]), 0.0, atol=1e-9)


@pytest.mark.slow
def test_girth_and_limbs_are_those_of_the_outline(plan):
    wall = drawn_on(plan)
    for course, level in sorted(levels_of_readings(plan.job))[::7]:
        azimuth, places = outline_of(wall, course, level)
        hull = ConvexHull(places).area
        assert wall.girth_m(course, level) == pytest.approx(hull, rel=2e-6)
        station = np.array([9.0, -11.0])
        way = places - station
        seen = np.unwrap(np.arctan2(*way.T)[np.argsort(azimuth)])
        for is_right, last in ((True, seen.max()), (False, seen.min())):
            found, length = wall.limb(station, course, level, is_right=is_right)
            off = (found - last + np.pi) % (2 * np.pi) - np.pi
            assert abs(off) * length < 2e-5


@pytest.mark.slow(after=1)
def test_what_a_drawn_wall_holds(plan):
    """Summation over fine outlines of many heights, over a quarter of a course; a whole one holds
    what the round one does but for squares, for no component has a mean over a course.
    """
    job, course = plan.job, plan.job.courses[1]
    zero, foot = job.datum.plate_level_m, plan.job.courses[0].height_m
    levels = foot - zero + (np.arange(60) + 0.5) / 60 * course.height_m
    sizes = 4 * plan.amplitudes.likely_m2
    asked = [(course.name, float(one)) for one in levels]
    wall = DrawnWall(job, sizes, asked, np.random.default_rng(6))
    azimuth = 2 * np.pi * np.arange(8000) / 8000
    areas = [
        np.pi * np.mean(wall.radius_m(*one, azimuth, inside=True) ** 2 - wall.nominal_m**2)
        for one in asked
    ]
    foot_m, quarter_m, top_m = wall.more_m3(foot - zero + course.height_m * np.array([0, 0.25, 1]))
    assert quarter_m - foot_m == pytest.approx(np.sum(areas[:15]) * course.height_m / 60, abs=3e-3)
    assert abs(quarter_m - foot_m) > 3e-2
    assert 0 < top_m - foot_m < 1e-2


@pytest.mark.slow(after=1)
def test_readings_come_back_to_the_wall(plan):
    """Without errors: circumferences are girths, hits lie on the wall, offsets are its radii."""
    wall, nominal = drawn_on(plan), plan.job.tank.nominal_diameter_m / 2
    job = set_readings(plan.job, wall)
    if job.strapping is not None:
        reduced = reduce_straps(job.strapping, job.survey.shell_temperature_c, 2 * nominal)
        for one in reduced:
            girth = wall.girth_m(one.strap.course, one.strap.level_m)
            assert one.circumference_m == pytest.approx(girth, abs=1e-9)
    if job.hits is not None:
        hits, known = job.hits, next(iter(job.hits.instruments.values()))
        station = hits.stations[next(iter(hits.setups.values())).station]
        distance = (hits.distance_m + known.correction_m) * (1 + known.correction)
        x, y, rise = (station + distance[:, None] * rays(hits.direction_rad, hits.zenith_rad)[0]).T
        height = next(iter(hits.setups.values())).height_m + rise - station[2]
        levels = dict(levels_read_at(plan.job))
        for place in range(0, len(hits), 9):
            level = min(levels[hits.course[place]], key=lambda one: abs(one - height[place]))
            told = wall.radius_m(hits.course[place], level, np.arctan2(x, y)[place], inside=True)
            assert np.hypot(x, y)[place] == pytest.approx(float(told), abs=1e-9)
    if job.lines is not None:
        first = [one for one in job.lines.offsets if one.line == "1" and one.face == 1]
        line = job.lines.lines["1"]
        away = [one.offset_m + float(wall.radius_m(one.course, one.level_m, line.azimuth_rad,
                inside=False)) for one in first]  # fmt: skip
        assert np.ptp(away) < 1e-12


def levels_read_at(job):
    """(course, its levels) of all that is read."""
    found = {}
    for course, level in levels_of_readings(job):
        found.setdefault(course, []).append(level)
    return found.items()


@pytest.mark.slow(after=1)
def test_errors_of_a_cause_are_shared_and_seeded(plan):
    """All readings of a wall are off by the scale of one instrument together; a seed repeats it."""
    errors = Errors(np.random.default_rng(1))
    assert errors.draw_cause("instrument_scale", "T") == errors.draw_cause("instrument_scale", "T")
    assert errors.draw_cause("instrument_scale", "T") != errors.draw_cause("instrument_scale", "U")
    job, wall = plan.job, RoundWall(plan.job, plan.amplitudes)
    one, same, other = (
        set_readings(job, wall, Errors(np.random.default_rng(seed))) for seed in (1, 1, 2)
    )
    for given in ("strapping", "lines", "hits", "tangents"):
        if getattr(job, given) is not None:
            first, again, third = (repr(getattr(found, given)) for found in (one, same, other))
            assert first == again
            assert first != third


@pytest.mark.slow
def test_readings_between_stations_are_off_by_their_sds():
    """Simulation: rms of the errors over their sds, the scale of the instrument among them."""
    given, found = load_plan(TANGENTS).job.measurements, []
    for seed in range(40):
        drawn = add_network_errors(given, Errors(np.random.default_rng(seed)))
        for before, after in zip(given.readings, drawn.readings, strict=True):
            found.append((after.value - before.value) / before.sd)
    assert np.sqrt(np.mean(np.concatenate(found) ** 2)) == pytest.approx(1.0, abs=0.05)
    same = add_network_errors(given, EXACT)
    for before, after in zip(given.readings, same.readings, strict=True):
        np.testing.assert_array_equal(before.value, after.value)
