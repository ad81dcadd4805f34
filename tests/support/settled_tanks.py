"""Tanks with known settlement, of forms that are no prior of the package, levelled with errors.

dip      waves 2 to 4 and a local dip a few points wide
smooth   a random smooth form: Gaussian correlation along the shell, 0.25 to 1.2 rad
edge     an ovality, and one to four points that settled, beside each other or anywhere

Each is tilted by 5 to 40 mm. The sd of the levelling is a share of the largest true S, log-uniform
within its class; limits of S lie at 0.6 to 1.6 of the truth, those of R2 as near.
"""

from dataclasses import dataclass

import numpy as np
from levelled_tanks import LIMITS, epoch_of, even_azimuths

from tankcal.products.inspection.out_of_plane import find_neighbours, fit_plane, r_squared
from tankcal.products.inspection.rules import SettlementLimits, Strength, make_check
from tankcal.products.inspection.settlement import assess, settlement_figures

POINTS = (16, 20, 24)
RADIUS_M, HEIGHT_M, E_PA = 15.0, 12.0, 206e9
FACTOR = LIMITS.curvature_factor
CLASSES = {"0.01 to 0.1": (0.01, 0.1), "0.1 to 0.3": (0.1, 0.3), "0.3 to 1": (0.3, 1.0)}


def _dip(rng, t):
    z = sum(
        rng.normal(0, 3) / k ** rng.uniform(1, 2.5) * np.cos(k * t - rng.uniform(0, 7))
        for k in (2, 3, 4)
    )
    width = rng.uniform(0.6, 2.0) * (t[1] - t[0])
    off = (t - rng.uniform(0, 2 * np.pi) + np.pi) % (2 * np.pi) - np.pi
    return z - rng.uniform(2, 15) * np.exp(-((off / width) ** 2) / 2)


def _smooth(rng, t):
    off = 2 * np.sin((t[:, None] - t) / 2)
    values, vectors = np.linalg.eigh(np.exp(-((off / rng.uniform(0.25, 1.2)) ** 2) / 2))
    amplitudes = np.sqrt(np.maximum(values, 0)) * rng.normal(size=len(t))
    return rng.uniform(2, 15) * vectors @ amplitudes


def _edge(rng, t):
    z = rng.uniform(0, 4) * np.cos(2 * t - rng.uniform(0, 7))
    count, start = rng.integers(1, 5), rng.integers(len(t))
    beside = (start + np.arange(count)) % len(t)
    places = beside if rng.uniform() < 0.5 else rng.choice(len(t), count, replace=False)
    z[places] -= 1 + rng.exponential(6, count)
    return z


FAMILIES = {"dip": _dip, "smooth": _smooth, "edge": _edge}


@dataclass(frozen=True)
class Levelled:
    """A judged check of a levelled tank with its truth; mm, or a share."""

    family: str
    code: str
    truth: float
    check: object


def _tank(rng, family, count, noise):
    """The checks of S and R2 of one tank; noise: class of the sd over the largest true S."""
    t = even_azimuths(count)
    true = FAMILIES[family](rng, t) + rng.uniform(5, 40) * np.cos(t - rng.uniform(0, 7))
    plane = fit_plane(t, true)
    S = np.abs(find_neighbours(t, RADIUS_M).operator @ plane.residual_m).max()
    r2 = r_squared(true, plane.residual_m)[0]
    s = S * np.exp(rng.uniform(*np.log(noise)))
    arc, limit = 2 * np.pi * RADIUS_M / count, S * rng.uniform(0.6, 1.6)
    yield_pa = 2e-3 * limit * E_PA * HEIGHT_M / (FACTOR * arc**2)
    strength = Strength(2 * RADIUS_M, HEIGHT_M, yield_pa=yield_pa, e_pa=E_PA)
    limits = SettlementLimits(
        curvature_factor=FACTOR, least_r2=1 - (1 - r2) * rng.uniform(0.6, 1.6)
    )
    epoch = epoch_of(true + rng.normal(0, s, count), s_mm=s)
    figures = settlement_figures(assess(epoch, np.inf, strength, limits), limits)
    checks = {figure.code: make_check(figure) for figure in figures}
    return [
        Levelled(family, code, truth, checks[code])
        for code, truth in (("settlement_all", S), ("settlement_cosine", r2))
    ]


def levelled_class(name, each, seed):
    """`Levelled` of `each` tanks of every family, of a class of noise."""
    rng = np.random.default_rng([seed, list(CLASSES).index(name)])
    return [
        one
        for family in FAMILIES
        for number in range(each)
        for one in _tank(rng, family, POINTS[number % len(POINTS)], CLASSES[name])
    ]


def shares(levelled, families=tuple(FAMILIES)):
    """{code: bias over u, share held, and how verdicts came out} of what is determined."""
    found = {}
    for code in ("settlement_all", "settlement_cosine"):
        rows = [
            one
            for one in levelled
            if one.code == code and one.family in families and one.check.value is not None
        ]
        found[code] = _shares(rows, at_least=code == "settlement_cosine")
    return found


def _shares(rows, at_least):
    value, U, k, reading, U_reading, limit, truth = np.array(
        [
            (abs(c.value), c.U, c.k, abs(c.reading), c.U_reading, c.limit.value, row.truth)
            for row in rows
            for c in [row.check]
        ]
    ).T
    sign = -1 if at_least else 1
    within = sign * (truth - limit) <= 0
    verdict = np.array([row.check.verdict for row in rows])
    passed_by_reading = sign * (reading - limit) <= -U_reading
    return {
        "tanks": len(rows),
        "bias_u": float(np.mean((value - truth) * k / U)),
        "held": float(np.mean(np.abs(value - truth) <= U)),
        "reading: bias": float(np.mean((reading - truth) * 1.96 / U_reading)),
        "reading: held": float(np.mean(np.abs(reading - truth) <= U_reading)),
        "within": int(within.sum()),
        "failed within": int(np.sum(within & (verdict == "failed"))),
        "reading beyond, within": int(np.sum(within & (sign * (reading - limit) > 0))),
        "passed beyond": int(np.sum(~within & (verdict == "passed"))),
        "reading passed beyond": int(np.sum(~within & passed_by_reading)),
    }
