"""Do 95 % intervals hold the truth in 95 % of simulated tanks? Form between the points included.

The truth is a closed form: pi r^2 + pi/2 sum (a_k^2 + b_k^2) for radius r and Fourier modes k.
"""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from draws import draws
from shapes import azimuths, ring

from tankcal.geometry.form import harmonics, unit_form
from tankcal.geometry.spectrum import estimate_form
from tankcal.sections import Group, fit_section, group_by_height, sample_of
from tankcal.tank.courses import course_shape
from tankcal.tank.volumes import ShellVolume
from tankcal.uncertainty import coverage_factor, effective_dof

MODES = 200
SD_M = np.sqrt(np.repeat(np.arange(2.0, MODES + 1) ** -3, 2))
UNIT = 0.020 / np.linalg.norm(SD_M[::2])  # amplitude of a form of 20 mm rms


def table(arguments, noise_m, rows_m, barrel_m=0.0):
    """Volumes of the rows, u by points, common form, own form and barrel (rows, 4), k of each row.

    arguments  of `fit_section`, but for the form, one for each course; barrel_m  its declared u
    """
    form = estimate_form([sample_of(*one) for one in arguments])
    shapes, by_points = [], []
    for one in arguments:
        levels = fit_section(*one, form).levels
        heights, outlines = (
            [level.height_m for level in levels],
            [level.outline for level in levels],
        )
        shapes.append(course_shape(*one[0].span_m, heights, outlines))
        jacobian = np.vstack([level.by_points for level in levels])
        by_points.append(shapes[-1].upper("by_parameters") @ jacobian * noise_m)
    volume = ShellVolume(tuple(shapes))
    factors = scipy.linalg.block_diag(*by_points), volume.form_m2, volume.own_form_m2
    u = [np.linalg.norm(volume.integrated(rows_m, factor), axis=1) for factor in factors]
    u.append(barrel_m * np.linalg.norm(volume.by_barrel_m2(rows_m), axis=1))
    u = np.column_stack(u)
    dof = effective_dof(u, (np.inf, form.common_dof, form.own_dof, np.inf))
    return volume.volume_m3(rows_m), u, coverage_factor(0.95, dof)


def targets(rng, common):
    """Arguments of the fit, rows and true volumes of five courses of 2 m with 24 targets each.

    R 10 m, form of 20 mm rms of which the part `common` runs up the whole shell; the targets stand
    at mid-height, their noise is 1 mm.
    """
    shared = np.sqrt(common) * rng.normal(size=len(SD_M))
    azimuth, arguments, areas = azimuths(24), [], []
    waves = harmonics(azimuth, MODES)[:, 3:]
    for course in range(5):
        wave = UNIT * SD_M * (shared + np.sqrt(1 - common) * rng.normal(size=len(SD_M)))
        height = 2.0 * course + 1.0
        xyz = ring(10.0 + waves @ wave, azimuth, z=height) + rng.normal(0, 0.001, (24, 3))
        group = Group(str(course), course, height, np.arange(24), (height - 1, height + 1))
        arguments.append((group, xyz, np.diag(np.full(72, 1e-6)), (0.0, 0.0), height))
        areas.append(np.pi * 10.0**2 + np.pi / 2 * wave @ wave)
    rows = np.array([1.0, 5.0, 10.0])
    return arguments, rows, 2.0 * np.clip(rows[:, None] / 2 - np.arange(5), 0, 1) @ areas


def coverage(tanks, common):
    """Parts of the tanks whose true rows lie within U, and within 1.96 u of the points alone."""
    rng = np.random.default_rng(31)
    inside, by_noise = np.zeros(3), np.zeros(3)
    for _ in range(tanks):
        arguments, rows, truth = targets(rng, common)
        volumes, u, k = table(arguments, 0.001, rows)
        error = np.abs(volumes - truth)
        inside += error < k * np.linalg.norm(u, axis=1)
        by_noise += error < 1.96 * u[:, 0]
    return inside / tanks, by_noise / tanks


def check(tanks, common, figure, full=None):
    """93 to 97 %, three binomial standard errors allowed; and the noise alone is far from it.

    full  tanks whose standard error counts, when fewer are drawn: 1.0 % of 450 tanks, where 3000
          have 0.4 %, but the band stays 91.8 to 98.2 %
    """
    inside, by_noise = coverage(tanks, common)
    where = f"rows 1 m, 5 m, total; {tanks} tanks, part of the form in common {common}"
    figure(f"coverage of 95 % intervals, {where}", np.round(inside, 4))
    figure(f"coverage by the noise of the points alone, {where}", np.round(by_noise, 4))
    assert np.all(np.abs(inside - 0.95) < 0.02 + 3 * np.sqrt(0.95 * 0.05 / (full or tanks)))
    assert np.all(by_noise < 0.80)


FORMS = pytest.mark.parametrize(
    ("common", "share"),
    [(1.0, 1.0), (0.0, 1.0), (0.5, 0.3)],
    ids=["common form", "form of each course", "half and half"],
)


@pytest.mark.slow
@FORMS
def test_intervals_cover_tanks_with_form_between_the_targets(common, share, figure):
    check(round(50 * share), common, figure)


@pytest.mark.study
@FORMS
def test_intervals_cover_tanks_with_form_study(common, share, figure):
    check(round(draws(450, 3000) * share), common, figure, round(3000 * share))


BARREL_M, COMPARED = 0.003, 50  # tanks


def scans(rng, heights):
    """Arguments of the fit, rows and true volumes of four scanned courses of 1.5 m, R 7.5 m.

    80 points of 3 mm each at random azimuths; form of 20 mm rms (0.6 common, 0.3 of the course, 0.1
    growing with the height); taper and barrel of each course of 3 mm sd, from middle to end. The
    barrel is a declared input: where points stand mostly low it is not determined.
    """
    form = UNIT * SD_M * np.sqrt([[0.6], [0.3], [0.1]])
    shared = form[0] * rng.normal(size=len(SD_M))
    courses, arguments = [], []
    for course in range(4):
        own, rising = form[1:] * rng.normal(size=(2, len(SD_M)))
        radius = np.polynomial.Polynomial([7.5, *rng.normal(0, BARREL_M, 2)])
        azimuth, zeta = rng.uniform(0, 2 * np.pi, 80), heights(rng, 80)
        waves = harmonics(azimuth, MODES)[:, 3:]
        distance = radius(zeta) + waves @ (shared + own) + zeta * (waves @ rising)
        xyz = ring(distance, azimuth) + rng.normal(0, 0.003, (80, 3)) * [1, 1, 0]
        xyz[:, 2] = 1.5 * course + 0.75 * (1 + zeta)
        turn = np.arctan2(xyz[:, 0], xyz[:, 1])
        joints = 1.5 * np.arange(5)
        group = group_by_height(xyz[:, 2], turn, np.full(80, course), joints)[0]
        covariance = scipy.sparse.diags_array(np.full(240, 9e-6)).tocsr()
        arguments.append((group, xyz, covariance, (0.0, 0.0), group.height_m))
        courses.append((radius, shared + own, rising))
    rows = np.array([0.75, 3.0, 6.0])
    return arguments, rows, np.array([_true_volume(courses, row) for row in rows])


def _true_volume(courses, row):
    node, weight = np.polynomial.legendre.leggauss(4)  # areas are of degree 4 in height
    total = 0.0
    for index, (radius, level, rising) in enumerate(courses):
        filled = np.clip(row - 1.5 * index, 0, 1.5)
        zeta = filled / 1.5 * (1 + node) - 1
        waves = level + zeta[:, None] * rising
        area = np.pi * radius(zeta) ** 2 + np.pi / 2 * np.sum(waves**2, axis=1)
        total += filled / 2 * weight @ area
    return total


def scan_study(tanks, heights):
    """Coverage of the rows; rms ppm of the fit in height and of a constant, of the first tanks."""
    rng = np.random.default_rng(7)
    inside, errors, constant = np.zeros(3), [], []
    for _ in range(tanks):
        arguments, rows, truth = scans(rng, heights)
        volumes, u, k = table(arguments, 0.003, rows, BARREL_M)
        inside += np.abs(volumes - truth) < k * np.linalg.norm(u, axis=1)
        if len(errors) == COMPARED:
            continue
        errors.append(volumes / truth - 1)
        level = [(replace(one[0], degree=0), *one[1:]) for one in arguments]
        constant.append(table(level, 0.003, rows)[0] / truth - 1)
    rms = [1e6 * np.sqrt(np.mean(np.square(found), axis=0)) for found in (errors, constant)]
    return inside / tanks, *rms


def everywhere(rng, n):
    return rng.uniform(-1, 1, n)


def mostly_low(rng, n):
    return np.where(rng.uniform(size=n) < 0.6, rng.uniform(-1, 0, n), rng.uniform(-1, 1, n))


HEIGHTS = pytest.mark.parametrize("heights", [everywhere, mostly_low])


def check_scans(tanks, heights, figure, full=None):
    """At least 93 % less three standard errors; of 100 tanks 2.2 %, of 300 (whose band counts) 1.3.

    full  tanks whose standard error counts, when fewer are drawn
    """
    inside, rms, constant = scan_study(tanks, heights)
    where = f"rows 0.75 m, 3 m, total; {tanks} scanned shells, points {heights.__name__}"
    figure(f"coverage of 95 % intervals, {where}", np.round(inside, 3))
    figure(f"rms ppm of the fit in height, of a constant, {where}", [rms.round(), constant.round()])
    assert np.all(inside > 0.93 - 3 * np.sqrt(0.95 * 0.05 / (full or tanks)))
    assert np.all(rms < constant)


@pytest.mark.slow
@HEIGHTS
def test_scanned_courses_that_taper_and_bulge(heights, figure):
    check_scans(10, heights, figure)


@pytest.mark.study
@HEIGHTS
def test_scanned_courses_that_taper_and_bulge_study(heights, figure):
    check_scans(draws(100, 300), heights, figure, 300)


def test_the_unit_form_has_the_variance_that_is_simulated():
    """Closed form: sum of k^-3 of the modes 2 to 200 at any azimuth, 20 mm rms."""
    assert UNIT**2 * np.sum(unit_form(np.array([0.7]), MODES) ** 2) == pytest.approx(0.020**2)
