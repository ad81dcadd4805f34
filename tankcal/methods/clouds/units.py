"""Error message for clouds without a wall, if another unit of a file explains the missing wall."""

import itertools

import numpy as np

from tankcal.clouds.wall.passes import PointSample
from tankcal.clouds.wall.start import has_wall
from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.methods.clouds.columns import UNITS_M

FILE = "clouds.toml"
SAMPLE, MOST_CHUNKS = 60_000, 8  # largest numbers of points and of chunks examined per file
DEFINED = {"e57": "m"}  # units defined by a format (E57: ASTM E2807); no other unit is tried
SAME = 1e-3  # relative difference of units that points cannot separate: feet and survey feet


def refusal_of_units(placing, sizes, refused):
    """Return the error that no wall was found, or an error that names the files in another unit.

    Each file is examined alone, with its scans scaled to each unit. The scale applies about the
    scanner if the pose comes from targets, and about the origin if the pose comes from the file. A
    format that defines its unit allows no other unit. If a wall was found, the unit is right.

    Parameters
    ----------
    placing : Placing
    sizes : dict
        Nominal sizes of the wall: kind, ends_m, radius_m, azimuth_rad.
    refused : InputError
        Error that no wall was found.

    Returns
    -------
    InputError
    """
    problems = []
    if any(problem.expected.code == "cloud_two_surfaces" for problem in refused.problems):
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
    """Return the possible units of the coordinates of a `CloudFile`, {unit: size in m}."""
    defined = DEFINED.get(file.header.format)
    return UNITS_M if defined is None else {defined: UNITS_M[defined]}


def is_unit_defined(placing):
    """Whether the format of every file defines its unit, and the job declares this unit."""
    return all(list(units_of(file).values()) == [file.unit_m] for file in placing.files)


def _some_points(placing, number):
    """Number of the first scan of a file with points, and a sample of its points (k, 3), m."""
    shares = [share for share in placing.shares() if share.file == number]
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
    """Name of another unit with which the points show a wall, or None."""
    tried = [declared_m]
    for unit, size in units.items():
        factor = size / declared_m
        if any(abs(size / earlier - 1) < SAME for earlier in tried):
            continue
        tried.append(size)
        # The pose from targets is independent of the unit of the file; the pose from the file is
        # not.
        for origin in (place_m, np.zeros(3)):
            if has_wall((xyz_m - origin) * factor + origin, **sizes):
                return unit
    return None
