"""Radii of courses from a former table, a record or a declaration, and their possible change."""

from dataclasses import dataclass

import numpy as np

from tankcal.job.checks.extent import is_surveyed
from tankcal.job.covariance import read_covariance
from tankcal.job.structure import structure
from tankcal.methods.radii.checks import COVARIANCE


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
    change : Change or None
        Possible change since the measurement; None without a new survey.
    """

    radius_m: np.ndarray
    covariance_m2: np.ndarray
    u_common_m: float
    temperature_c: float
    source: str
    note: str = ""
    file: str = "radii.csv"
    row: tuple = ()
    change: Change | None = None

    @property
    def is_known(self):
        """True for each course with a known radius, shape (courses,)."""
        return np.isfinite(self.radius_m)


def make_radii(values, tables, raw):
    """`Radii` of a job without problems; parameters as for `Method.read`."""
    table, given = tables["radii"], values["radii"]
    place = {name: i for i, name in enumerate(table.of("course"))}
    order = [place.get(name) for name in tables["courses"].of("course")]
    is_given = [i is not None for i in order]
    radius, covariance = np.full(len(order), np.nan), np.zeros((len(order), len(order)))
    # Place the rows of radii.csv in the order of the courses; missing courses stay nan.
    rows = [i for i in order if i is not None]
    radius[is_given] = table.numbers("radius_m")[rows]
    data = raw.archives.get(COVARIANCE.file)
    if data is not None:
        covariance_m2 = read_covariance(data)
    else:
        covariance_m2 = np.diag(np.nan_to_num(table.numbers("u_mm") / 1000) ** 2)
    covariance[np.ix_(is_given, is_given)] = covariance_m2[np.ix_(rows, rows)]
    covariance[np.isnan(radius)], covariance[:, np.isnan(radius)] = 0.0, 0.0
    # Radii without a temperature refer to the temperature of the table.
    temperature = given["reference_temperature_c"]
    if temperature is None:
        temperature = values["table"]["reference_temperature_c"]
    return structure(
        Radii,
        given,
        radius_m=radius,
        covariance_m2=covariance,
        temperature_c=temperature,
        file=table.file,
        row=tuple(None if i is None else table.rows[i] for i in order),
        change=structure(Change, values["change"]) if is_surveyed(tables) else None,
    )
