"""Radii of courses from a former table, a record or a declaration, and their change."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Radii:
    """Radii of the courses of a vertical tank, from the bottom up.

    Each radius belongs to the circle with the mean area of the course, inside, with the tank empty.

    Attributes
    ----------
    radius_m : ndarray, shape (courses,)
        nan: not known; the course was measured again.
    covariance_m2 : ndarray, shape (courses, courses)
        Covariance matrix without the common component, m2; 0 for radii not known.
    u_common_m : float
        Standard uncertainty of the common component.
    temperature_c : float
        Temperature of the shell at which the radii hold.
    source : {"table", "record", "declared"}
        Origin of the radii.
    note : str
        Printed.
    file : str
    row : tuple of int or None
        Row of each course in that file.
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
        """True for each course with a known radius, shape (courses,)."""
        return np.isfinite(self.radius_m)


@dataclass(frozen=True)
class Change:
    """Standard uncertainties of the change of radii since their measurement.

    Attributes
    ----------
    common_m : float
        Common change of all radii, m.
    own_m : float
        Independent change of each radius, m.
    shared_m : float
        Common component of the errors of the former radii and of the new survey, m.
    """

    common_m: float = 0.0
    own_m: float = 0.0
    shared_m: float = 0.0
