"""From the checked radii.csv, radii_cov.npz, [radii], [change] to `Radii` and `Change`, in SI."""

import numpy as np

from tankcal.job.checks.extent import is_surveyed
from tankcal.job.model.radii import Change, Radii


def make_radii(values, tables, covariance_m2):
    """(Radii, Change) of a job without problems; None: nothing was measured since then.

    covariance_m2  (rows, rows) of radii_cov.npz, in the order of radii.csv, or None
    """
    table, given = tables["radii"], values["radii"]
    place = {name: i for i, name in enumerate(table.of("course"))}
    order = [place.get(name) for name in tables["courses"].of("course")]
    known = [i is not None for i in order]
    radius, own = np.full(len(order), np.nan), np.zeros((len(order), len(order)))
    rows = [i for i in order if i is not None]
    radius[known] = table.numbers("radius_m")[rows]
    if covariance_m2 is None:
        covariance_m2 = np.diag(np.nan_to_num(table.numbers("u_mm") / 1000) ** 2)
    own[np.ix_(known, known)] = covariance_m2[np.ix_(rows, rows)]
    own[np.isnan(radius)], own[:, np.isnan(radius)] = 0.0, 0.0
    temperature = given["reference_temperature_c"]
    if temperature is None:
        temperature = values["table"]["reference_temperature_c"]
    radii = Radii(
        radius,
        own,
        given["u_common_mm"] / 1000,
        temperature,
        given["source"],
        given["note"] or "",
        table.file,
        tuple(None if i is None else table.rows[i] for i in order),
    )
    return radii, _change(values["change"]) if is_surveyed(tables) else None


def _change(given):
    return Change(*((given[f"{name}_mm"] or 0.0) / 1000 for name in ("common", "own", "shared")))
