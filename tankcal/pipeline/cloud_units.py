"""What is told of clouds without a wall where another unit of a file explains it."""

import itertools

import numpy as np

from tankcal.clouds.wall.sampling import PointSample
from tankcal.clouds.wall.start import shows_wall
from tankcal.errors import InputError, Problem
from tankcal.job.contract.clouds import UNITS_M
from tankcal.messages import message

FILE = "clouds.toml"
SAMPLE, MOST_CHUNKS = 60_000, 8  # of a file: points that are looked at, pieces that are read
DEFINED = {"e57": "m"}  # unit that a format defines, by ASTM E2807 for E57: no other is guessed
SAME = 1e-3  # of two units that points do not tell apart: feet and survey feet


def refusal_of_units(placing, sizes, refused):
    """The error that no wall was found, or one that names the files in another unit.

    Each file is examined alone: each of its scans is as large as that unit makes it, about the
    scanner where its pose comes from targets, about the origin where it comes from the file. A
    format that defines its unit has no other, and a wall that was found has the right unit.

    Parameters
    ----------
    placing : Placing
    sizes : dict
        Of the wall: kind, ends_m, radius_m, azimuth_rad.
    refused : InputError

    Returns
    -------
    InputError
    """
    problems = []
    if any(one.expected.code == "cloud_two_surfaces" for one in refused.problems):
        return refused
    for number, file in enumerate(placing.files):
        units = units_of(file)
        if len(units) == 1 and file.unit_m in units.values():
            continue
        scan, xyz = _some_points(placing, number)
        unit = _unit_that_fits(xyz, placing.place_m[scan], file.unit_m, units, sizes)
        if unit is not None:
            declared = next(name for name, size in UNITS_M.items() if size == file.unit_m)
            text = message(
                "cloud_file_unit",
                "no wall near the nominal radius {nominal_m:.3f} m, but one if the coordinates of "
                "{file} are {unit}: found {declared}",
                nominal_m=sizes["radius_m"],
                file=file.file,
                unit=unit,
                declared=declared,
            )
            problems.append(Problem(FILE, text, column=f"{file.name}.unit"))
    return InputError(problems) if problems else refused


def units_of(file):
    """{unit: metres} that the coordinates of a `CloudFile` may be in."""
    defined = DEFINED.get(file.header.format)
    return UNITS_M if defined is None else {defined: UNITS_M[defined]}


def is_unit_defined(placing):
    """Whether all files have the unit that their format defines."""
    return all(list(units_of(one).values()) == [one.unit_m] for one in placing.files)


def _some_points(placing, number):
    """The first scan with points of a file, and some of its points, (k, 3) m."""
    shares = [one for one in placing.shares() if one.file == number]
    points = placing.points(shares, placing.tally())
    sample, first = PointSample(SAMPLE), None
    try:
        for scan, xyz in itertools.islice(points, MOST_CHUNKS):
            first = scan if first is None else first
            if scan == first:
                sample.add(xyz, scan)
    finally:
        points.close()
    return first or 0, sample.points()


def _unit_that_fits(xyz_m, place_m, declared_m, units, sizes):
    """Name of a unit with which the points show a wall; None: of no other."""
    tried = [declared_m]
    for unit, size in units.items():
        factor = size / declared_m
        if any(abs(size / one - 1) < SAME for one in tried):
            continue
        tried.append(size)
        for origin in (place_m, np.zeros(3)):
            if shows_wall((xyz_m - origin) * factor + origin, **sizes):
                return unit
    return None
