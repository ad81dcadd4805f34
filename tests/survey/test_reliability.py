"""Tests and their power by simulation: false alarms, detectable blunders, components, snooping.

Truth: the probabilities of Baarda 1968 (alpha 0.1 %, power 80 %), Pope 1976 and Foerstner 1987.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.stats
from draws import draws
from networks import photographed
from test_network_study import NAMES, Kind, kinds, redrawn, redrawn_station

from tankcal.survey.network import Survey, snoop
from tankcal.survey.network.quality import components, estimate_variance_components
from tankcal.survey.network.reliability import tau_limit
from tankcal.survey.observations import Directions, Distances, VerticalAngles

pytestmark = pytest.mark.slow

CRITICAL = scipy.stats.norm.isf(0.0005)
EXPECTED = CRITICAL + scipy.stats.norm.ppf(0.80)  # of w at the minimal detectable bias: 4.132
SUSPECTS = {  # kind of survey and of observation, values of it
    "image coordinate": ("photographs", "image points", 2),
    "tape distance": ("photographs", 1, 1),
    "direction": ("total station", 0, 1),
    "zenith angle": ("total station", 1, 1),
    "slope distance": ("total station", 2, 1),
}


def with_bias(survey, source, row, element, bias):
    """The survey with one value falsified."""
    if source == "image points":
        xy = survey.image_points.value.copy()
        xy[row, element] += bias
        return replace(survey, image_points=replace(survey.image_points, value=xy))
    one = survey.observations[source]
    value = np.array(one.value)
    value[row] += bias
    observations = list(survey.observations)
    observations[source] = replace(one, value=value)
    return replace(survey, observations=tuple(observations))


def table_of(adjusted, source):
    """The residuals of one group."""
    return next(table for table in adjusted.residuals if table.source == source)


def w_of_blunders(what, blunders, seed=1):
    """(blunders,) |w| of values that are off by their minimal detectable bias."""
    name, source, elements = SUSPECTS[what]
    kind, rng = kinds(name), np.random.default_rng(seed)
    table = table_of(kind.adjusted(kind.drawn(rng)), source)
    controlled = np.argwhere(table.redundancy[:, :elements] > 0.1)
    found = []
    for number, element in controlled[rng.integers(len(controlled), size=blunders)]:
        bias = rng.choice([-1, 1]) * table.mdb[number, element]
        bad = with_bias(kind.drawn(rng), source, table.rows[number], element, bias)
        tested = table_of(kind.adjusted(bad), source)
        found.append(abs(tested.w[number, element]))
    return np.array(found)


@pytest.mark.study
@pytest.mark.parametrize("what", SUSPECTS)
def test_baarda_power_at_full_size(what, figure):
    """Closed form at the minimal detectable bias (0.1 %, 80 %): |w| is normal about 4.13, sd one.

    The part that is found is known to 1.8 % by 500 blunders, to 0.8 % by 2500 (2.5 standard errors
    of these, 2 %, was the band of the part); the mean and the sd of w say more: 2.5 of their
    standard errors are 0.08 and 0.056, and 0.08 is 2.2 % of what is found.
    """
    blunders = draws(250, 2500)
    w = w_of_blunders(what, blunders)
    found = np.mean(w > CRITICAL)
    figure(f"{blunders} blunders of the minimal detectable size, {what}: found", f"{found:.4f}")
    figure(f"mean of their |w| less 4.132, sd, {what}", f"{w.mean() - EXPECTED:.4f}, {w.std():.4f}")
    assert found == pytest.approx(0.80, abs=2.5 * np.sqrt(0.8 * 0.2 / blunders))
    assert w.mean() == pytest.approx(EXPECTED, abs=2.5 / np.sqrt(blunders))
    assert w.std(ddof=1) == pytest.approx(1.0, abs=2.5 / np.sqrt(2 * blunders))


@pytest.mark.parametrize("what", ["image coordinate", "slope distance", "direction"])
def test_baarda_power(what):
    found = np.mean(w_of_blunders(what, 50) > CRITICAL)
    assert found == pytest.approx(0.80, abs=0.18)


@dataclass(frozen=True)
class Alarms:
    """Shares of each survey (surveys,) beyond the limits of w and tau; of surveys, global test."""

    w: np.ndarray
    tau: np.ndarray
    low: float
    high: float

    @staticmethod
    def is_rate(shares, rate=0.001, sds=3.5):
        """Is the mean of shares the rate, within so many of its sds?

        Many values of a survey see the same error: only whole surveys are independent.
        """
        sd = max(np.std(shares), np.sqrt(rate / 100)) / np.sqrt(len(shares))
        return abs(np.mean(shares) - rate) < sds * sd


def alarms(name, surveys, factor=1.0, seed=2):
    """The Alarms of surveys without blunders.

    factor  all declared sds are true ones over this
    """
    kind, rng = kinds(name), np.random.default_rng(seed)
    sources = ["image points", *range(len(kind.exact.observations))]
    w, tau, low, high = [], [], 0, 0
    for _ in range(surveys):
        survey = kind.drawn(rng).with_sds(dict.fromkeys(sources, 1 / factor))
        if factor != 1:
            tools = tuple(replace(t, scale_sd=t.scale_sd / factor) for t in survey.instruments)
            survey = replace(survey, instruments=tools)
        found = kind.adjusted(survey)
        tables = found.residuals
        values = np.concatenate([np.abs(t.w[t.redundancy > 1e-3]).ravel() for t in tables])
        w.append(np.mean(values > CRITICAL))
        tau.append(np.mean(values / found.sigma0 > tau_limit(0.001, found.dof)))
        test = found.test()
        low += test.chi2 < test.low
        high += test.chi2 > test.high
    return Alarms(np.array(w), np.array(tau), low / surveys, high / surveys)


@pytest.mark.study
@pytest.mark.parametrize("name", NAMES)
def test_false_alarms_at_full_size(name, figure):
    """Closed form: 0.1 % of values, 2.5 % of surveys on each side of the global test.

    The latter's standard error is 0.7 % of 500 surveys, 0.5 % of 1000; the band is the same.
    """
    surveys = draws(250, 1000)
    found = alarms(name, surveys)
    w, tau = 1e3 * found.w.mean(), 1e3 * found.tau.mean()
    figure(
        f"{surveys} surveys without blunders, {name}",
        f"false alarms of w {w:.3f}, of tau {tau:.3f} per thousand; global test too low"
        f" {found.low:.3f}, too high {found.high:.3f}",
    )
    assert found.is_rate(found.w)
    assert found.is_rate(found.tau)
    assert found.low == pytest.approx(0.025, abs=0.015)
    assert found.high == pytest.approx(0.025, abs=0.015)


@pytest.mark.parametrize("name", NAMES)
def test_false_alarms(name):
    found = alarms(name, 50)
    assert found.is_rate(found.w)
    assert found.is_rate(found.tau)
    assert found.low < 0.12
    assert found.high < 0.12


@pytest.mark.parametrize("factor", [1 / 3, 3.0])
def test_tau_keeps_its_rate_when_all_sds_are_wrong(factor, figure):
    """Closed form (Pope 1976): a common factor does not change the rate of tau, but that of w."""
    found = alarms("total station", 50, factor)
    figure(
        f"sds declared too small {factor:.2f} times, per thousand",
        f"w {1e3 * found.w.mean():.1f}, tau {1e3 * found.tau.mean():.2f}",
    )
    assert found.is_rate(found.tau)
    if factor > 1:
        assert found.w.mean() > 0.1
        assert found.high == 1
    else:
        assert found.w.mean() == 0
        assert found.low == 1


def test_snooping_by_tau_needs_no_true_sds():
    """Property: with sds three times too small w removes a sound survey, tau hardly a value."""
    rng = np.random.default_rng(4)
    kind = open_field(rng)
    survey = kind.drawn(rng).with_sds({0: 1 / 3, 1: 1 / 3, 2: 1 / 3})
    by_w = snoop(survey, datum=kind.datum)
    by_tau = snoop(survey, datum=kind.datum, test="tau")
    assert len(by_w.removed) > 20
    assert len(by_tau.removed) <= 1


def variance_factors(name, surveys, seed=3):
    """{source: factors squared (surveys,)} and {source: redundancy}."""
    kind, rng = kinds(name), np.random.default_rng(seed)
    found, redundancy = {}, {}
    for _ in range(surveys):
        for one in components(kind.adjusted(kind.drawn(rng)).residuals):
            found.setdefault(one.source, []).append(one.factor**2)
            redundancy[one.source] = one.redundancy
    return found, redundancy


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "surveys", [pytest.param(draws(250, 1000), marks=pytest.mark.study), 50], ids=["many", "50"]
)
def test_variance_components_are_unbiased(name, surveys, figure):
    """Closed form: the expectation of v'Pv of a group is its redundancy."""
    found, redundancy = variance_factors(name, surveys)
    for source, squares in found.items():
        if len(squares) < surveys or redundancy[source] < 0.05:
            continue
        sd = np.std(squares) / np.sqrt(surveys)
        figure(
            f"{surveys} surveys, {name}, variance component of {source}",
            f"{np.mean(squares):.3f} +- {sd:.3f}",
        )
        assert abs(np.mean(squares) - 1) < 3.5 * sd


@pytest.mark.parametrize("surveys", [pytest.param(draws(60, 100), marks=pytest.mark.study), 5])
def test_balanced_sds_are_the_true_ones(surveys, figure):
    """Directions declared twice too good, distances three times too poor."""
    rng = np.random.default_rng(5)
    kind = open_field(rng)
    factors = []
    for _ in range(surveys):
        survey = kind.drawn(rng).with_sds({0: 0.5, 2: 3.0})
        total = estimate_variance_components(survey, kind.adjusted)[1]
        factors.append([total[0], total[1], total[2]])
    mean, sd = np.mean(factors, axis=0), np.std(factors, axis=0) / np.sqrt(surveys)
    figure(f"{surveys} surveys: factors of directions, zenith angles, distances", mean.round(3))
    assert np.all(np.abs(mean - [2, 1, 1 / 3]) < 4 * sd + 0.02)


def blundered(kind, rng, share=0.1, size=20.0):
    """A Survey with blunders of so many sds, and {source: rows} of them."""
    survey, rows = kind.drawn(rng), {}
    images = survey.image_points
    if images is not None:
        n = len(images.point)
        bad = rng.choice(n, round(share * n), replace=False)
        way = rng.uniform(0, 2 * np.pi, len(bad))
        xy = images.value.copy()
        xy[bad] += size * images.sd[bad] * np.column_stack([np.cos(way), np.sin(way)])
        rows["image points"] = set(bad.tolist())
        return replace(survey, image_points=replace(images, value=xy)), rows
    observations = []
    for source, one in enumerate(survey.observations):
        bad = rng.choice(len(one), round(share * len(one)), replace=False)
        value = np.array(one.value)
        value[bad] += rng.choice([-1, 1], len(bad)) * size * one.sd[bad]
        observations.append(replace(one, value=value))
        rows[source] = set(bad.tolist())
    return replace(survey, observations=tuple(observations)), rows


def open_field(rng):
    """A Kind by total station, exact: six set-ups that all see each other and eight points."""
    azimuth = np.arange(6) * np.pi / 3
    stations = np.column_stack([15 * np.sin(azimuth), 14 * np.cos(azimuth), rng.normal(0, 0.3, 6)])
    xyz = np.vstack([stations, rng.uniform([-6, -6, 1], [6, 6, 8], (8, 3))])
    start, end = (part.ravel() for part in np.mgrid[:6, :14])
    start, end = start[start != end], end[start != end]
    x, y, z = (xyz[end] - xyz[start]).T
    n, zeros = len(start), rng.uniform(0, 6, 6)
    angle = np.full(n, 10 * np.pi / 648000)
    exact = Survey(
        points=tuple(f"P{i}" for i in range(14)),
        xyz_m=xyz,
        observations=(
            Directions(np.arctan2(x, y) - zeros[start], angle, start, end, set=start),
            VerticalAngles(np.arctan2(np.hypot(x, y), z), angle, start, end, zenith=True),
            Distances(
                np.sqrt(x * x + y * y + z * z), np.full(n, 1e-3), start, end,
                instrument=np.full(n, -1),
            ),
        ),
        sets=zeros,
    )  # fmt: skip
    return Kind(exact, redrawn_station, "inner", np.zeros((0, 1), dtype=int))


def many_photographs():
    """A Kind by sixteen photographs, exact: five or six rays to each point."""
    exact, truth = photographed(noise=0.0, photos=16)
    return Kind(replace(exact, xyz_m=truth.xyz_m), redrawn, "control", np.zeros((0, 1), dtype=int))


def cleaned(name, surveys, seed=6):
    """Shares of blunders found and of sound observations removed; rms error over sd."""
    rng = np.random.default_rng(seed)
    kind = many_photographs() if name == "photographs" else open_field(rng)
    found = there = false = sound = 0
    squares = []
    for _ in range(surveys):
        survey, bad = blundered(kind, rng)
        done = snoop(survey, datum=kind.datum)
        removed = {(one.source, one.row) for one in done.removed}
        blunders = {(source, row) for source, rows in bad.items() for row in rows}
        found, there = found + len(removed & blunders), there + len(blunders)
        false += len(removed - blunders)
        sound += sum(len(t.rows) for t in done.adjusted.residuals) - len(blunders)
        sd = done.adjusted.point_sd_m
        squares.append(np.nanmean(((done.adjusted.xyz_m - kind.exact.xyz_m) / sd) ** 2))
    return found / there, false / sound, float(np.sqrt(np.mean(squares)))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("surveys", [pytest.param(draws(60, 100), marks=pytest.mark.study), 5])
def test_ten_percent_of_blunders(name, surveys, figure):
    """Property: nearly all are found, little else is removed, the points stay in their sds."""
    found, false, rms = cleaned(name, surveys)
    figure(
        f"{surveys} surveys with 10 % of 20-sigma blunders, {name}",
        f"found {found:.4f}, sound ones removed {false:.4f}, rms error over sd {rms:.2f}",
    )
    assert found > 0.97
    assert false < 0.01
    assert rms < (1.25 if surveys > 50 else 1.5)
