"""Do 95 % intervals hold on lying tanks and spheres of a second set of generators?

`generated_vessels` has other shapes than `generated_rings` and `generated_solids`, and sizes that
grow with sqrt(R t) or R; none of the sizes of the package was chosen by them.
"""

from itertools import pairwise

import numpy as np
import pytest
from draws import draws
from generated_rings import U, strapped_job
from generated_solids import SPHERES
from generated_vessels import BALLS, WeldedTank, make_ball, make_lying
from page_figures import figures_of, ratios_agree, shares_agree
from scipy.stats import binom
from strapped_balls import strapped_job as strapped_ball
from test_coverage_of_rings import SHARES, base_job  # noqa: F401  (a fixture)
from test_coverage_of_strapped_spheres import FOLDER, found_of

from tankcal.methods.great_circles.sphere import find_strapped_sphere
from tankcal.methods.rings.wall import find_ringed_wall
from tankcal.pipeline.tanks import body_of
from tankcal.tank.capacity import Capacity

LEAST_HELD, DELIVERED = 0.94, 0.3  # of the highest dip
ROWS_OF_PAGE = {  # by straps per ring
    2: ("docs/uncertainty.md", "| horizontal tank, two straps per ring | (), (), () | () |"),
    3: ("docs/uncertainty.md", "| horizontal tank, three straps per ring | (), (), () | () |"),
}


def ellipse_below(a, b, height):
    """Area of an ellipse below a height above its lowest point; semi-axes a level, b upright."""
    t = np.arccos(1 - height / b)
    return a * b * (t - np.sin(t) * np.cos(t))


def test_true_volumes_of_an_elliptical_tank():
    """Truth: the segment of an ellipse."""
    a, b, lengths = 1.21, 1.19, np.array([2.0, 2.5])

    def ellipse(ring, s, turn):
        return a * b / np.hypot(a * np.cos(turn), b * np.sin(turn)) - 1.2

    tank = WeldedTank(np.full(2, 1.2), lengths, np.zeros(2), (ellipse,), 0.0, 1.0)
    dips = np.array([0.1, 0.7, 1.19, 2.0, 2.38])
    expected = lengths.sum() * ellipse_below(a, b, dips)
    assert tank.volumes(dips) == pytest.approx(expected, abs=3e-6 * expected[-1])  # chords


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_true_volumes_of_a_lying_tank(seed):
    """Second methods: r^2 / 2 over all turns; horizontal strips between the walls of a slice."""
    tank = make_lying(np.random.default_rng(seed))
    turn = np.arange(4000) * 2 * np.pi / 4000
    full, part, dip = 0.0, 0.0, 0.8 * tank.base[0]
    ring, zeta = tank._place(tank.dip)
    zero = tank.axis[ring] - tank.section(ring, zeta, np.zeros(1))[0]
    for ring, (low, high) in enumerate(pairwise(tank.joints)):
        for s in low + (np.arange(400) + 0.5) / 400 * (high - low):
            r = tank.section(ring, 2 * (s - low) / (high - low) - 1, turn)
            full += np.mean(r**2) * np.pi * (high - low) / 400
            level = zero + np.hypot(1, tank.tilt) * dip - tank.tilt * (s - tank.dip)
            x, z = r * np.sin(turn), tank.axis[ring] - r * np.cos(turn)
            part += _strips(x, z, level) * (high - low) / 400
    found = tank.volumes(np.array([dip, 10.0]))
    assert found == pytest.approx([part, full], rel=2e-5)


def _strips(x, z, level):
    """Area of a section below a level, by the width of strips of equal height."""
    bottom = int(np.argmin(z))
    top = int(np.argmax(z))
    first, other = sorted((bottom, top))
    right, left = slice(first, other + 1), np.r_[other : len(z), 0 : first + 1]
    heights = z[bottom] + (np.arange(20_000) + 0.5) / 20_000 * (level - z[bottom])
    sides = []
    for places in (np.arange(len(z))[right], left):
        order = np.argsort(z[places])
        sides.append(np.interp(heights, z[places][order], x[places][order]))
    return np.abs(sides[0] - sides[1]).mean() * (level - z[bottom])


@pytest.mark.slow
@pytest.mark.parametrize("family", BALLS)
def test_true_volume_of_a_ball(family):
    """Second method: r^3 / 3 over Gauss places of the height and even turns."""
    ball = make_ball(np.random.default_rng(4), family)
    up, weights = np.polynomial.legendre.leggauss(900)
    turn = np.arange(1501) * 2 * np.pi / 1501
    level = np.sqrt(1 - up**2)[:, None]
    way = [level * np.cos(turn), level * np.sin(turn), np.broadcast_to(up[:, None], (900, 1501))]
    volume = weights @ np.mean(ball.radius_at(np.stack(way, axis=-1)) ** 3, axis=1) * 2 * np.pi / 3
    assert ball.volume_below([2.1 * ball.radius_m])[0] == pytest.approx(volume, rel=3e-6)


def errors_of_ring(seed, base, shares):
    """(rows and deliveries,) errors and U over the volume of the full tank, the full tank sixth."""
    rng = np.random.default_rng(seed)
    tank = make_lying(rng)
    job = strapped_job(rng, tank, base, shares)
    body = body_of(job, find_ringed_wall(job, lambda text: None))
    full = body.parts[0].solid._highest_m  # above the highest dip, where the tank leans
    dips = np.append(np.array(SHARES) * body.parts[0].top_m, full)
    off = U["datum"] * rng.normal()
    low = np.array([0.15, 0.45]) * body.parts[0].top_m
    high = low + DELIVERED * body.parts[0].top_m
    truth = tank.volumes(np.concatenate([dips[:-1] + off, [10.0], low + off, high + off]))
    return judged(body, np.concatenate([dips, low, high]), truth, len(dips))


def errors_of_ball(seed, family):
    rng = np.random.default_rng(seed)
    ball = make_ball(rng, family)
    job = strapped_ball(rng, ball, FOLDER, meridians=int(rng.integers(3, 7)))
    body = body_of(job, find_strapped_sphere(job, lambda text: None))
    dips = np.append(np.array(SHARES) * ball.height_m, body.highest_m)
    low = np.array([0.15, 0.45]) * ball.height_m
    levels = np.concatenate([dips, low, low + DELIVERED * ball.height_m])
    return judged(body, levels, ball.volume_below(levels), len(dips))


def judged(body, levels, truth, rows):
    """Errors and U of rows, then of deliveries, over the total, which is the last of the rows."""
    count = (len(levels) - rows) // 2
    weights = np.zeros((rows + count, len(levels)))
    weights[:rows, :rows] = np.eye(rows)
    weights[rows:, rows:] = np.hstack([-np.eye(count), np.eye(count)])
    volumes, areas, sources = body.rows(levels)
    sources = tuple(one.weighted(weights) for one in sources)
    table = Capacity(0 * weights @ truth, weights @ volumes, weights @ areas, sources, 0.95)
    return (weights @ (volumes - truth)) / truth[rows - 1], table.U_m3 / truth[rows - 1]


def judge(found, name, figure):
    """Held shares of totals, rows and deliveries, and how wide U of the total is."""
    error, expanded = (np.array(one) for one in zip(*found, strict=True))
    held, last = np.abs(error) <= expanded, len(SHARES)
    parts = [held[:, last].mean(), held[:, : last + 1].mean(), held[:, last + 1 :].mean()]
    off = error[:, last]
    wide = expanded[:, last].mean() / 1.96 / np.sqrt(np.mean(off**2))
    figure(f"{name}: held totals, rows, deliveries", " ".join(f"{one:.3f}" for one in parts))
    figure(f"{name}: mean U over 1.96 rms errors of the total", f"{wide:.2f}")
    figure(f"{name}: mean error of the total, ppm, and its standard error",
           f"{1e6 * off.mean():.0f} {1e6 * off.std() / np.sqrt(len(off)):.0f}")  # fmt: skip
    return parts, wide


def least(count):
    """`LEAST_HELD` less three standard errors of so many."""
    return LEAST_HELD - 3 * np.sqrt(0.95 * 0.05 / count)


@pytest.mark.slow
@pytest.mark.twentieth
def test_intervals_hold_on_vessels(base_job, figure):  # noqa: F811
    found = [errors_of_ring(seed, base_job, (0.2, 0.8)) for seed in range(10)]
    assert min(judge(found, "welded rings, two straps", figure)[0]) > least(10)
    found = [errors_of_ball(seed, BALLS[seed % 3]) for seed in range(6)]
    assert min(judge(found, "spheres", figure)[0]) > least(6)


@pytest.mark.study
@pytest.mark.parametrize("shares", [(0.2, 0.8), (0.1, 0.5, 0.9)])
def test_intervals_hold_on_rings_of_vessels_study(base_job, figure, shares):  # noqa: F811
    count = draws(12, 500)
    found = [errors_of_ring(seed, base_job, shares) for seed in range(count)]
    held, wide = judge(found, f"welded rings, {len(shares)} straps", figure)
    assert min(held) > least(count)
    (full,) = figures_of(
        "docs/studies/rings.md", "(second set, () tanks for each number of straps)"
    )
    *stated, ratio = figures_of(*ROWS_OF_PAGE[len(shares)])
    assert shares_agree(held, stated, count, int(full))
    assert ratios_agree(wide, ratio, count, int(full))
    far, tables = figures_of(
        "docs/studies/rings.md", "() of these () tables had an error of more than 2 U"
    )
    beyond = sum(bool(np.any(np.abs(error) > 2 * expanded)) for error, expanded in found)
    assert beyond <= binom.ppf(0.999, count, int(far) / int(tables))


@pytest.mark.study
@pytest.mark.parametrize("family", BALLS)
def test_intervals_hold_on_spheres_of_vessels_study(figure, family):
    count = draws(6, 200)
    found = [errors_of_ball(seed, family) for seed in range(count)]
    (stated,) = figures_of(
        "docs/studies/spheres.md", "held at least () of the volumes of each family"
    )
    assert float(stated) == LEAST_HELD
    held, wide = judge(found, f"spheres, {family}", figure)
    assert min(held) > least(count)
    low, high, full = figures_of(
        "docs/studies/spheres.md",
        "There U of the total is () to () times 1.96 rms errors (() spheres of each family)",
    )
    # within the range, or beside it by the sampling error of both studies
    nearest = np.clip(wide, float(low), float(high))
    assert ratios_agree(wide, f"{nearest:.1f}", count, int(full))


@pytest.mark.study
def test_width_on_spheres_of_both_sets_study(figure):
    """Spheres with and without pressed legs together: those of `generated_solids` and of here."""
    count, rng = draws(10, 70), np.random.default_rng(4242)
    totals = [
        [values[-1] for values in found_of(rng, family)] for family in SPHERES for _ in range(count)
    ]
    for family in BALLS:
        found = [errors_of_ball(seed, family) for seed in range(30_000, 30_000 + count)]
        totals += [[values[len(SHARES)] for values in one] for one in found]
    error, expanded = np.transpose(totals)
    wide = expanded.mean() / 1.96 / np.sqrt(np.mean(error**2))
    held = np.mean(np.abs(error) <= expanded)
    figure("spheres of both sets: held totals; mean U over 1.96 rms errors", f"{held}; {wide}")
    stated, ratio, full = figures_of(
        "docs/studies/spheres.md",
        "Over both sets () of the totals were held, and U is () times 1.96 rms errors (() spheres)",
    )
    assert shares_agree([held], [stated], len(totals), int(full))
    assert ratios_agree(wide, ratio, len(totals), int(full))
    (far,) = figures_of("docs/studies/spheres.md", "No error of these totals exceeded () U")
    assert not np.any(np.abs(error) > float(far) * expanded)
