"""Radii of a saved result, with their covariance from its capacity table."""

from dataclasses import dataclass

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message


@dataclass(frozen=True)
class RecordedRadii:
    """Radii of the courses in a record.

    Attributes
    ----------
    names : tuple of str
    radii_m : ndarray, shape (n,)
        Inside radii of the empty tank at the temperature of the record's table.
    covariance_m2 : ndarray, shape (n, n)
        From the covariance of the rows of its table.
    heights_m, thickness_m : ndarray, shape (n,)
    """

    names: tuple[str, ...]
    radii_m: np.ndarray
    covariance_m2: np.ndarray
    heights_m: np.ndarray
    thickness_m: np.ndarray

    @property
    def u_m(self):
        """Standard uncertainties (n,), m."""
        return np.sqrt(np.diag(self.covariance_m2))


def read_recorded(former):
    """Return the radii in the record of a former table.

    Parameters
    ----------
    former : FormerTable
        Table with its record.

    Returns
    -------
    RecordedRadii

    Raises
    ------
    InputError
        For a tank that is not upright, or that held liquid during the survey, or a course with
        fewer than two rows of the table.
    """
    record = former.record
    courses = record.get("courses") or []
    if (record["job"]["tank"].get("kind") or "vertical") != "vertical" or not courses:
        _refuse(
            former, message("read_no_courses", "not a tank of courses; expected an upright one")
        )
    if (record["job"]["survey"] or {}).get("liquid_level_m"):
        expected = message(
            "read_filled_record",
            "the tank held liquid when it was measured; expected the record of an empty one: run "
            "its job again for another table",
        )
        _refuse(former, expected)
    zero = record["capacity"].get("zero_m") or 0.0
    radii = np.array([course["inside_radius_m"] for course in courses])
    parts = [_by_rows(former, course, zero) for course in courses]
    factor = np.array(parts) / (2 * np.pi * radii[:, None])
    return RecordedRadii(
        tuple(course["course"] for course in courses),
        radii,
        factor @ factor.T,
        np.array([course["height_m"] for course in courses]),
        np.array([course["thickness_m"] for course in courses]),
    )


def _by_rows(former, course, zero):
    """Covariance factor (inputs,) of the mean area between the rows of a course."""
    low, high = course["bottom_m"] - zero, course["top_m"] - zero
    rows = np.flatnonzero((former.height_m >= low - 1e-6) & (former.height_m <= high + 1e-6))
    if len(rows) < 2:
        expected = message(
            "read_rows_of_course",
            "fewer than two rows within course {course}; expected rows in each",
            course=course["course"],
        )
        _refuse(former, expected)
    first, last = rows[0], rows[-1]
    apart = former.height_m[last] - former.height_m[first]
    return (former.factor_m3[last] - former.factor_m3[first]) / apart


def _refuse(former, expected):
    raise InputError(Problem(former.name, expected))
