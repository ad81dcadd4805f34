"""One unknown point and three known ones: whatever was measured, the point or what is missing.

Property: the values are exact, so a place is right to the micrometre, or it is wrong. Whether the
readings determine it is decided by the rank of their derivatives at the truth, and whether another
place fits them as well by a search of its own (one_point.py).
"""

from dataclasses import replace

import numpy as np
import pytest
from draws import draws
from one_point import (
    DIRECTIONS,
    IN_PLAN,
    IN_SPACE,
    TRUTH,
    axes_of,
    combined,
    determined,
    elsewhere,
    measured,
)
from surveyed import known

from tankcal.errors import InputError, SolutionError
from tankcal.survey import adjust_survey

BY_NAME = {str(shot): shot for shot in [*IN_PLAN, *DIRECTIONS, *IN_SPACE]}


def shots_of(text):
    """The shots that a text names."""
    return [BY_NAME[name] for name in text.split(" + ")]


def off_m(adjustment, shots):
    """How far P is from the truth, on the axes that the shots speak of."""
    return np.abs(adjustment.xyz_m[adjustment.names.index("P")] - TRUTH)[axes_of(shots)].max()


def adjusted(shots, **options):
    """The Adjustment, or None, and what was said instead."""
    try:
        return adjust_survey(measured(shots, **options)), ""
    except (SolutionError, InputError) as error:
        return None, str(error)


def assert_sound(shots, **options):
    """The point where it is determined by one place, a refusal in words where it is not."""
    adjustment, refusal = adjusted(shots, **options)
    if adjustment is None:
        assert "P" in refusal
        assert not determined(shots) or len(elsewhere(shots)), f"{shots}: {refusal}"
        return "refused"
    if "P" not in adjustment.names:
        assert not determined(shots)
        assert any("P" in one for one in adjustment.aside)
        return "refused"
    assert determined(shots), f"{shots}: nothing determines P"
    assert off_m(adjustment, shots) < 1e-5, f"{shots}: {adjustment.xyz_m}"
    assert not len(elsewhere(shots)), f"{shots}: one of several places was taken"
    return "found"


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    "text",
    [
        "azimuths A-P + horizontal_angles P<A,B",
        "azimuths P-B + horizontal_angles P<A,B",
        "horizontal_angles P<A,B + horizontal_angles B<C,P",
        "horizontal distances A-P + azimuths B-P + horizontal_angles P<B,C",
        "azimuths A-P + azimuths P-A + horizontal_angles P<A,B",
        "azimuths C-P + directions P<A,B",
        "distances A-P + azimuths A-P + height_differences B-P",
        "distances A-P + zenith_angles A-P + azimuths B-P + horizontal_angles P<C,A",
        "distances A-P + distances B-P + zenith_angles P-C + height_differences A-P",
        "horizontal distances B-P + distances A-P + distances B-P + distances C-P",
        "distances A-P + distances B-P + distances C-P + azimuths A-P",
    ],
)
def test_mixtures_that_fix_a_point(text):
    """Each of these once ended in a refusal, or in a traceback."""
    assert assert_sound(shots_of(text)) == "found"


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("horizontal distances A-P", "too few observations: 1 for 2"),
        ("azimuths A-P + azimuths P-A", "free to move"),
        ("horizontal distances A-P + horizontal distances B-P", "may be at"),
        ("horizontal distances B-P + azimuths A-P + horizontal_angles A<B,P", "may be at"),
        ("distances A-P + zenith_angles A-P + azimuths B-P", "may be at"),
        ("azimuths B-P + azimuths P-B + horizontal_angles B<C,P", "free to move"),
        ("distances A-P + distances B-P + distances C-P", "may be at"),
    ],
)
def test_undetermined_points_are_refused(text, told):
    """A line of sight there and back is one line; two circles cut at two places."""
    shots = shots_of(text)
    assert assert_sound(shots) == "refused"
    with pytest.raises((SolutionError, InputError), match=told):
        adjust_survey(measured(shots))


def test_both_places_are_named_and_an_approximation_decides():
    shots = shots_of("horizontal distances A-P + horizontal distances B-P")
    with pytest.raises(SolutionError) as error:
        adjust_survey(measured(shots, explain=True))
    assert f"({TRUTH[0]:.2f}, {TRUTH[1]:.2f}" in str(error.value)
    job = measured(shots)
    names = (*job.control.point, "P")
    sds = np.vstack([job.control.sd_m, np.full((1, 3), np.nan)])
    about = known(names, np.vstack([job.control.xyz_m, TRUTH + [3.0, -2.0, 0.0]]), sds)
    assert off_m(adjust_survey(replace(job, control=about)), shots) < 1e-5


PLAN_STEP, SPACE_STEP = draws(41, 13), draws(139, 43)  # of the studies


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("count", [1, 2, 3])
def test_some_of_all_combinations(count):
    """Every so many of all combinations; the studies below run more of them."""
    shots = [one for one in combined(IN_PLAN, 3) if len(one) == count]
    for one in shots[:: {1: 7, 2: 23, 3: 67}[count]]:
        assert_sound(one)


@pytest.mark.study
@pytest.mark.parametrize("first", [*IN_PLAN, *DIRECTIONS], ids=str)
def test_every_combination_in_plan(first):
    """One to four readings in plan, weighted and fixed known points, causes looked for.

    One in PLAN_STEP of 7546 sets: with a step of 1 all of them, which takes hours.
    """
    pool = [*IN_PLAN, *DIRECTIONS]
    rest = pool[pool.index(first) + 1 :]
    for i, others in enumerate([(), *combined(rest, 3)][::PLAN_STEP]):
        assert_sound([first, *others], sd=0.001 * (i % 2))


@pytest.mark.study
@pytest.mark.parametrize("first", [*IN_PLAN, *IN_SPACE], ids=str)
def test_every_combination_in_space(first):
    """One to four readings in space and in plan, directions left out; one in SPACE_STEP sets."""
    pool = [*IN_PLAN, *IN_SPACE]
    rest = pool[pool.index(first) + 1 :]
    for others in [(), *combined(rest, 3)][::SPACE_STEP]:
        shots = [first, *others]
        if any(one in IN_SPACE for one in shots):
            assert_sound(shots)
