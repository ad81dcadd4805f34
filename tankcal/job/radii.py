"""From the checked radii.csv, radii_cov.npz, [radii], [change] to `Radii` and `Change`, in SI."""

import numpy as np

from tankcal.job.checks.extent import is_surveyed
from tankcal.job.model.radii import Change, Radii
from tankcal.job.structure import structure


def make_radii(values, tables, covariance_m2):
    """Build `Radii` and `Change` of a job without problems.

    Parameters
    ----------
    values : dict
        {section: {key: value}} of the settings.
    tables : dict of {str: ColumnValues or None}
        Tables by name.
    covariance_m2 : ndarray, shape (rows, rows), or None
        Covariance matrix in radii_cov.npz, in the order of radii.csv, m2.

    Returns
    -------
    radii : Radii
    change : Change or None
        None without a new survey.
    """
    table, given = tables["radii"], values["radii"]
    place = {name: i for i, name in enumerate(table.of("course"))}
    order = [place.get(name) for name in tables["courses"].of("course")]
    is_given = [i is not None for i in order]
    radius, covariance = np.full(len(order), np.nan), np.zeros((len(order), len(order)))
    # Place the rows of radii.csv in the order of the courses; missing courses stay nan.
    rows = [i for i in order if i is not None]
    radius[is_given] = table.numbers("radius_m")[rows]
    if covariance_m2 is None:
        covariance_m2 = np.diag(np.nan_to_num(table.numbers("u_mm") / 1000) ** 2)
    covariance[np.ix_(is_given, is_given)] = covariance_m2[np.ix_(rows, rows)]
    covariance[np.isnan(radius)], covariance[:, np.isnan(radius)] = 0.0, 0.0
    # Radii without a temperature refer to the temperature of the table.
    temperature = given["reference_temperature_c"]
    if temperature is None:
        temperature = values["table"]["reference_temperature_c"]
    radii = structure(
        Radii,
        given,
        radius_m=radius,
        covariance_m2=covariance,
        temperature_c=temperature,
        file=table.file,
        row=tuple(None if i is None else table.rows[i] for i in order),
    )
    return radii, structure(Change, values["change"]) if is_surveyed(tables) else None
