"""Parts of the survey of a real tank against each other and against all of it: does U hold there?

Halves of the points share no point; a half may be short of azimuths, heights or both. The wall is
what it is: no generator, and no model of it.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from draws import draws
from numpy.polynomial.legendre import legvander
from page_figures import agree, figures_of
from real_tank import write_real_job

import tankcal
from tankcal.pipeline.tanks import body_of
from tankcal.pipeline.wall.finding import find_wall, joints_of
from tankcal.tank.capacity import Capacity

ROWS, DELIVERIES, DELIVERED_M = 10, 5, 2.0
TOTAL = ROWS - 1
PLACES = {"quarters": 1, "fifths": 2, "5 %": 3}  # columns of docs/uncertainty.md
FULL = 78  # splits in halves; of fewer the part beyond U is known less well

pytestmark = pytest.mark.study


@dataclass
class Survey:
    """The job, the table of all its points, and where these stand: course, zeta, azimuth, place."""

    job: tankcal.Job
    wall: object
    heights_m: np.ndarray

    def table_of(self, chosen):
        """(15,) volumes of ten rows and five deliveries of 2 m, and their U, by some points."""
        points, index = self.job.points, np.flatnonzero(chosen)

        def some(values):
            return tuple(values[i] for i in index)

        fewer = replace(
            points,
            names=some(points.names),
            xyz_m=points.xyz_m[index],
            section=some(points.section),
            generatrix=some(points.generatrix),
            rows=some(points.rows),
        )
        job = replace(self.job, points=fewer)
        body = body_of(job, find_wall(job, lambda text: None))
        volumes, areas, sources = body.rows(np.minimum(self.heights_m, body.highest_m))
        weights = np.zeros((ROWS + DELIVERIES, len(volumes)))
        weights[:ROWS, :ROWS] = np.eye(ROWS)
        weights[ROWS:, ROWS:] = np.hstack([-np.eye(DELIVERIES), np.eye(DELIVERIES)])
        sources = tuple(one.weighted(weights) for one in sources)
        table = Capacity(np.zeros(15), weights @ volumes, weights @ areas, sources, 0.95)
        return table.volume_m3, table.U_m3


@pytest.fixture(scope="module")
def survey(shared, tmp_path_factory):
    job = tankcal.load(write_real_job(shared, tmp_path_factory.mktemp("real")))
    wall = find_wall(job, lambda text: None)
    top = body_of(job, wall).highest_m
    low = np.linspace(0, top - DELIVERED_M, DELIVERIES)
    rows = np.linspace(0, top, ROWS + 1)[1:]
    return Survey(job, wall, np.concatenate([rows, low, low + DELIVERED_M]))


@pytest.fixture(scope="module")
def whole(survey):
    return survey.table_of(np.ones(len(survey.job.points.names), dtype=bool))


@pytest.fixture(scope="module")
def zeta(survey):
    """(n,) height of each point within its course, -1 to 1; nan of points off the wall."""
    z = survey.job.points.xyz_m[:, 2] - survey.job.datum.bottom_z_m
    joints = joints_of(survey.job)
    course = np.clip(np.searchsorted(joints, z) - 1, 0, len(joints) - 2)
    found = 2 * (z - joints[course]) / np.diff(joints)[course] - 1
    return np.where(survey.wall.shell.reason == "", found, np.nan)


def test_halves_agree_within_their_u(survey, figure):
    """E_n of one half against the other: rms of 2 E_n is 1 where U is right."""
    rng, count = np.random.default_rng(1), len(survey.job.points.names)
    en = []
    for _ in range(draws(13, FULL)):
        half = rng.permutation(count) < count // 2
        (one, one_u), (other, other_u) = survey.table_of(half), survey.table_of(~half)
        en.append((one - other) / np.hypot(one_u, other_u))
    for name, part in (("rows", np.array(en)[:, :ROWS]), ("deliveries", np.array(en)[:, ROWS:])):
        shares = np.mean(np.abs(part) > 1, axis=1)  # of each split: its volumes are correlated
        beyond, its_sd = shares.mean(), shares.std(ddof=1) / np.sqrt(len(shares))
        scatter = np.sqrt(np.mean((2 * part) ** 2))
        figure(f"halves, {name}: part with |E_n| > 1, rms of 2 E_n", f"{beyond:.3f} {scatter:.2f}")
        assert 0.8 < scatter < 1.3
        of_rows, of_deliveries, _ = figures_of(
            "docs/studies/coverage.md",
            "|E_n| exceeds 1 in () % of rows and in () % of deliveries of () halvings",
        )
        stated = int(of_rows if name == "rows" else of_deliveries) / 100
        assert abs(beyond - stated) < 3.3 * its_sd + 0.005
        assert beyond < 0.10 + 2 * its_sd * (len(shares) < FULL)


def test_rings_at_one_height_are_within_u(survey, whole, zeta, figure):
    for name, chosen in (
        ("middle", np.abs(zeta) < 0.2),
        ("ends", np.abs(zeta) > 0.76),
        ("three", (np.abs(zeta) < 0.12) | (np.abs(np.abs(zeta) - 0.7) < 0.1)),
    ):
        volume, expanded = survey.table_of(chosen)
        off = (volume - whole[0]) / expanded
        ppm = 1e6 * np.array([volume[TOTAL] - whole[0][TOTAL], expanded[TOTAL]]) / whole[0][TOTAL]
        figure(f"rings at the {name}: ppm off, U, worst row in U",
               f"{ppm[0]:.0f} {ppm[1]:.0f} {np.abs(off[:ROWS]).max():.2f}")  # fmt: skip
        assert np.all(np.abs(off) < 1)
        printed = {
            "middle": figures_of("docs/studies/coverage.md", "| rings at mid height | () | () |"),
            "ends": figures_of(
                "docs/studies/coverage.md",
                "| rings at the ends of the courses | () (no row by more than () U) | () |",
            ),
            "three": figures_of(
                "docs/studies/coverage.md", "| three rings | () | () | | without the points"
            ),
        }[name]
        assert agree(ppm, [printed[0], printed[-1]])
        if name == "ends":
            assert agree([np.abs(off[:ROWS]).max()], [printed[1]])


def test_a_station_less_is_within_u(survey, whole, figure):
    """What each of the four stations is nearest to is left out."""
    names, xy = np.array(survey.job.points.names), survey.job.points.xyz_m[:, :2]
    stations = xy[[bool(name.startswith("st")) for name in names]]
    nearest = np.hypot(*(xy[:, None] - stations).transpose(2, 0, 1)).argmin(axis=1)
    every = []
    for station in range(len(stations)):
        volume, expanded = survey.table_of(nearest != station)
        off = volume - whole[0]
        ppm = 1e6 * np.array([off[TOTAL], expanded[TOTAL]]) / whole[0][TOTAL]
        figure(f"without station {station + 1}: ppm off, U", f"{ppm[0]:.0f} {ppm[1]:.0f}")
        assert np.all(np.abs(off) < expanded)
        every.append(np.abs(ppm))
    least, most = np.min(every, axis=0), np.max(every, axis=0)
    printed = figures_of(
        "docs/studies/coverage.md",
        "without the points of one of four stations | () to () | () to () |",
    )
    assert agree([least[0], most[0], least[1], most[1]], printed)


def test_the_bulge_is_the_same_in_all_courses(survey, zeta, figure):
    """The excess at mid course does not fall upwards, as a rest of the widening by filling does."""
    of_page = figures_of(
        "docs/studies/few-heights.md",
        "the real shell: estimate (its standard uncertainty) | () (()) | () (()) | () (()) | () "
        "(()) |",
    )
    stated = [of_page[i : i + 2] for i in (0, 2, 4, 6)]
    for height, places in (
        ("quarters", (-0.5, 0.5)),
        ("fifths", (-0.6, 0.6)),
        ("5 %", (-0.9, 0.9)),
    ):
        excess, covariance = _excess_at(places, survey, zeta)
        assert agree([excess.mean(), np.sqrt(covariance.mean())], stated[PLACES[height]])
        figure(f"excess at the {height}, mean and its sd, mm",
               f"{excess.mean():+.2f} {np.sqrt(covariance.mean()):.2f}")  # fmt: skip
    excess, covariance = _excess_at((0.0,), survey, zeta)
    courses = np.arange(len(excess)) - (len(excess) - 1) / 2
    mean = excess.mean(), np.sqrt(covariance.mean())
    assert agree(mean, stated[0])
    weights = np.linalg.inv(covariance)
    by = np.column_stack([np.ones(len(excess)), courses])
    cofactor = np.linalg.inv(by.T @ weights @ by)
    slope = (cofactor @ by.T @ weights @ excess)[1], np.sqrt(cofactor[1, 1])
    figure("excess at mid course, mean and its sd, mm", "{:+.2f} {:.2f}".format(*mean))
    figure("its slope, mm a course, and its sd", "{:+.3f} {:.3f}".format(*slope))
    about = excess - np.sum(weights @ excess) / np.sum(weights)
    figure("chi-squared of the courses about their mean", f"{about @ weights @ about:.1f}")
    assert mean[0] > 5 * mean[1]
    assert slope[0] + 2 * mean[0] / len(excess) > 3 * slope[1]  # by filling it is 0 at the top


def _excess_at(places, survey, zeta, waves=24):
    """(courses,) mean radius at heights of a course less that of the course, mm; its covariance.

    Robust least squares of radii: Legendre orders 0 to 4 of each course, waves up the whole shell.
    """
    kept = np.isfinite(zeta)
    x, y, z = survey.job.points.xyz_m[kept].T
    z = z - survey.job.datum.bottom_z_m
    joints = joints_of(survey.job)
    course = np.clip(np.searchsorted(joints, z) - 1, 0, len(joints) - 2)
    circle = np.column_stack([2 * x, 2 * y, np.ones(len(x))])
    axis = np.append(np.linalg.lstsq(circle, x**2 + y**2)[0][:2], [0.0, 0.0])
    own = np.eye(len(joints) - 1)[course][:, :, None] * legvander(zeta[kept], 4)[:, None]
    own = own.reshape(len(x), -1)
    for _ in range(4):  # the axis, and the azimuths about it
        away = np.column_stack([x - axis[0] - axis[2] * z, y - axis[1] - axis[3] * z])
        azimuth, radius = np.arctan2(*away.T), np.hypot(*away.T)
        turns = np.exp(1j * np.outer(azimuth, np.arange(1, waves + 1)))
        wave = np.stack([turns.imag, turns.real], axis=2).reshape(len(x), -1)
        design = np.hstack([wave[:, :2], z[:, None] * wave[:, :2], wave[:, 2:], own])
        weight = np.ones(len(x))
        for _ in range(10):  # Huber's weights
            found = np.linalg.lstsq(design * weight[:, None], radius * weight)[0]
            miss = np.abs(radius - design @ found)
            weight = np.sqrt(1 / np.maximum(1, miss / (1.5 * 1.4826 * np.median(miss))))
        axis = axis + found[:4]
    normal = (design * weight[:, None]).T @ (design * weight[:, None])
    noise = np.sum((weight * miss) ** 2) / (len(x) - len(normal))
    there = legvander(np.array(places), 4).mean(axis=0) - np.eye(5)[0]  # less order 0, the mean
    of_courses = np.kron(np.eye(len(joints) - 1), there)
    first = len(normal) - own.shape[1]
    covariance = noise * np.linalg.inv(normal)[first:, first:]
    return 1e3 * of_courses @ found[first:], 1e6 * of_courses @ covariance @ of_courses.T
