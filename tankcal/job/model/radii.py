"""Radii of courses that a former table, a record or a declaration gives, and their change."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Radii:
    """Radii of the courses of an upright tank, from the bottom up.

    Each is that of the circle of the course's mean area, inside, the shell empty.

    Attributes
    ----------
    radius_m : ndarray, shape (courses,)
        nan: not known; the course was measured again.
    covariance_m2 : ndarray, shape (courses, courses)
        Of what they do not have in common, m2; of a radius that is not known 0.
    u_common_m : float
        Standard uncertainty that all have in common.
    temperature_c : float
        Of the shell that they are for.
    source : {"table", "record", "declared"}
        Where they come from.
    note : str
        Printed.
    file : str
    row : tuple of int or None
        Of each course in that file.
    """

    radius_m: np.ndarray
    covariance_m2: np.ndarray
    u_common_m: float
    temperature_c: float
    source: str
    note: str = ""
    file: str = "radii.csv"
    row: tuple = ()

    @property
    def is_known(self):
        """(courses,) where a radius was given."""
        return np.isfinite(self.radius_m)


@dataclass(frozen=True)
class Change:
    """How radii may have changed since they were measured: standard uncertainties, m.

    common_m, own_m  of all together, and of each for itself
    shared_m         what the former radii and the new survey have in common
    """

    common_m: float
    own_m: float
    shared_m: float = 0.0
