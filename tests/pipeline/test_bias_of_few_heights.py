"""Error of the mean area from a few heights of a course: evidence for docs/studies/few-heights.md.

The sign depends on the kind of shell, so no mean is taken off; these tests fail where the
documented signs and sizes no longer follow.
"""

import generated_walls
import numpy as np
import pytest
from draws import draws
from generated_walls import job_of, make_wall, survey
from independent_shells import make_shell
from numpy.polynomial.legendre import leggauss
from page_figures import agree, figures_of, value_of
from test_coverage_of_walls import ROWS, judged

from tankcal.geometry.field.components import COMPONENTS, Heights
from tankcal.pipeline.tanks import body_of
from tankcal.pipeline.wall.finding import find_wall

HEIGHTS = {"middle": (0.5,), "quarters": (0.25, 0.75), "fifths": (0.2, 0.8), "joints": (0.05, 0.95)}
INDEPENDENT = ("settled", "flat-plates", "filled")
WITHOUT_BULGE = ("brick", "dents", "buckle")


ROWS_OF_PAGE = {
    "settled": (
        "docs/studies/few-heights.md",
        "(`tests/support/independent_shells.py`) | () (()) | () (()) | () (()) | () (()) |",
    ),
    "flat-plates": (
        "docs/studies/few-heights.md",
        "flat plates, joints drawn in | () (()) | () (()) | () (()) | () (()) |",
    ),
    "filled": (
        "docs/studies/few-heights.md",
        "bulge left by filling | () (()) | () (()) | () (()) | () (()) |",
    ),
    "brick": (
        "docs/studies/few-heights.md",
        "without its added bulge) | () (()) | () (()) | () (()) | () (()) |",
    ),
    "dents": (
        "docs/studies/few-heights.md",
        "dents, the same | () (()) | () (()) | () (()) | () (()) |",
    ),
    "buckle": (
        "docs/studies/few-heights.md",
        "buckles at mid course, the same | () (()) | () (()) | () (()) | () (()) |",
    ),
}


def excess_mm(shell):
    """{heights: mean radius there less that of the courses, in mm}, over all courses of a shell."""
    node, weight = leggauss(32)
    zeta = np.concatenate([(node - 1) / 2, (node + 1) / 2])  # two halves: dents have a kink
    sums = dict.fromkeys(HEIGHTS, 0.0)
    for course in range(shell.courses):
        mean = np.tile(weight, 2) @ shell.areas(course, zeta) / 4
        for name, parts in HEIGHTS.items():
            areas = shell.areas(course, 2 * np.array(parts) - 1)
            sums[name] += shell.radius_m * (np.mean(areas) / mean - 1) / 2 / shell.courses
    return {name: 1e3 * found for name, found in sums.items()}


def _excesses(family, count):
    found = []
    for seed in range(count):
        rng = np.random.default_rng([77, seed])
        if family in INDEPENDENT:
            shell = make_shell(rng, family)
        else:
            radius = np.exp(rng.uniform(*np.log([3, 20])))
            shell = make_wall(rng, family, radius_m=radius, courses=5, bulge=False)
        found.append(excess_mm(shell))
    return {name: np.array([one[name] for one in found]) for name in HEIGHTS}


@pytest.mark.study
def test_the_bias_at_few_heights_depends_on_the_kind_of_shell_study(figure):
    count, at = draws(6, 60), {}
    for family in (*INDEPENDENT, *WITHOUT_BULGE):
        at[family] = _excesses(family, count)
        for name, those in at[family].items():
            figure(f"excess at {name}, {family}, mm: mean, sd of shells, part above 0",
                   f"{those.mean():+.2f} {those.std():.2f} {np.mean(those > 0):.2f}")  # fmt: skip
    (full,) = map(
        int,
        figures_of(
            "docs/studies/few-heights.md",
            "(In brackets: standard deviation between () shells of a family",
        ),
    )
    for family, row in ROWS_OF_PAGE.items():
        stated = [*map(value_of, figures_of(*row))]
        for name, mean, sd in zip(HEIGHTS, stated[::2], stated[1::2], strict=True):
            those = at[family][name]
            error = max(sd, those.std()) * np.sqrt(1 / len(those) + 1 / full)
            assert abs(those.mean() - mean) < 3.3 * error + 0.005, (family, name)
    middle = {family: those["middle"] for family, those in at.items()}
    assert middle["flat-plates"].mean() > 0.2
    assert middle["brick"].mean() > 0.3
    assert middle["filled"].mean() > 0.1
    assert abs(middle["settled"].mean()) < 0.1
    assert middle["buckle"].mean() < 0
    for family, those in middle.items():  # all smaller than the prior mean, which is 1.58 mm
        assert those.mean() < 0.7 * _prior_mean_mm(), family


@pytest.mark.study
@pytest.mark.parametrize("family", INDEPENDENT)
def test_a_correction_by_the_prior_mean_is_too_large_study(tmp_path, monkeypatch, figure, family):
    """Surveys of one ring at mid course: corrected, the rms error is larger than before."""
    monkeypatch.setitem(generated_walls.RINGS, 1, ((0.5,),))
    found = []
    for seed in range(draws(4, 60)):
        rng = np.random.default_rng([99, seed])
        shell = make_shell(rng, family)
        points = int(rng.choice([12, 24, 36]))
        measured = survey(rng, shell, rings=1, points=points, noise_m=1e-3)
        job = job_of(shell, measured, tmp_path / "job")
        body = body_of(job, find_wall(job, lambda text: None))
        off = judged(shell, body, family, 1).error[ROWS - 1]
        found.append([off, off - 2e-3 * _prior_mean_mm() / shell.radius_m])
    mean, rms = 1e6 * np.mean(found, axis=0), 1e6 * np.sqrt(np.mean(np.square(found), axis=0))
    for name, place in (("uncorrected", 0), ("corrected by the prior mean", 1)):
        figure(f"one ring at mid course, {family}, {name}: mean, rms, ppm",
               f"{mean[place]:+.0f} {rms[place]:.0f}")  # fmt: skip
    assert rms[1] > rms[0]
    assert abs(mean[1]) > abs(mean[0])


def _prior_mean_mm():
    """Mean of the common bulge at mid course before a survey, if it were always outwards, in mm."""
    bulge = next(one for one in COMPONENTS if one.name == "common bulge")
    amplitude = bulge.median_m * np.exp(bulge.log_sd**2 / 8)  # of a log-normal variance
    return 1e3 * amplitude * bulge.height_columns(Heights(np.zeros(1), np.full(1, 0.5)))[0, 0]


def test_the_prior_mean_of_the_bulge_is_stated():
    printed = figures_of(
        "docs/studies/few-heights.md",
        "A correction by the prior mean of the common bulge would be () mm",
    )
    assert agree([_prior_mean_mm()], printed)


def test_a_bulge_of_one_millimetre_has_its_closed_form():
    """1 - zeta^2 has the mean 2/3: its excess is 1/3 at the middle and 1/12 at the quarters."""
    shell = make_wall(np.random.default_rng(1), "coil", radius_m=8.0, courses=2, bulge=False)
    shell.terms = [[(np.ones_like, lambda s: 1e-3 * (1 - s**2))] for _ in range(2)]
    shell.grams = {}
    found = excess_mm(shell)
    assert found["middle"] == pytest.approx(1 / 3, rel=1e-3)
    assert found["quarters"] == pytest.approx(1 / 12, rel=2e-3)
    assert found["joints"] == pytest.approx(0.19 - 2 / 3, rel=1e-3)
