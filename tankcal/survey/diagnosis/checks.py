"""Comparison of check readings, check points and unused control with the adjustment."""

from dataclasses import replace

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.survey.network.quality import compare_left_out
from tankcal.survey.observations import ImageCoordinates
from tankcal.survey.results import CheckPoints, Reading

DISAGREE = 4.0  # standard deviations by which a check point may differ
LISTED = 10  # check points listed in warnings


def check_readings(adjusted, checks, cov_scale):
    """Reading rows (check=True) of observations left out of the adjustment.

    Parameters
    ----------
    adjusted : network.Adjusted
    checks : iterable of Observations
    cov_scale : float
        Variance factor of the covariances.

    Returns
    -------
    list of Reading
    """
    readings = []
    for observations in checks:
        parts = (
            _split_by_form(adjusted, observations)
            if isinstance(observations, ImageCoordinates)
            else [observations]
        )
        for part in parts:
            readings += _rows(adjusted, part, cov_scale)
    return readings


def find_disagreeing_checks(check_points, table):
    """Problem rows of check points that differ more than their uncertainty allows.

    Parameters
    ----------
    found : CheckPoints or None
    table : KnownPoints or None
        Contents of check.csv.

    Returns
    -------
    list of Problem
    """
    problems = []
    if check_points is None or table is None:
        return problems
    for name, difference, sd in zip(
        check_points.names, check_points.difference_m, check_points.sd_m, strict=True
    ):
        with np.errstate(divide="ignore", invalid="ignore"):
            # An sd of 0 gives no test.
            away = np.nan_to_num(np.abs(difference) / sd, posinf=0.0)
        if name in table.point and away.max() > DISAGREE:
            k = int(away.argmax())
            text = message(
                "check_point_off",
                "{axis} of {point} differs by {difference_mm:+.1f} mm from the adjusted point,"
                " {times:.1f} times its standard deviation of {sd_mm:.1f} mm",
                axis="xyz"[k],
                point=name,
                difference_mm=1e3 * difference[k],
                times=away[k],
                sd_mm=1e3 * sd[k],
            )
            row = table.rows[table.point.index(name)] if table.rows else None
            problems.append(Problem(table.file, text, row, f"{'xyz'[k]}_m"))
    return problems[:LISTED]


def _rows(adjusted, observations, cov_scale):
    """Reading rows of one table, without observations of points that are not adjusted."""
    ties = [np.asarray(getattr(observations, name)) for name in observations.ties]
    is_adjusted = np.isfinite(adjusted.xyz_m[np.array(ties)]).all(axis=(0, 2))
    observations = observations.taken(is_adjusted)
    if not len(observations):
        return []
    result = compare_left_out(adjusted, observations)
    sd = np.reshape(observations.sd, result.difference.shape)
    # The variance factor applies to the adjusted part; the variance of the reading keeps its scale.
    spread = np.sqrt(sd**2 + cov_scale * np.maximum(result.sd**2 - sd**2, 0.0))
    value = np.reshape(observations.value, sd.shape)
    trace, nan = observations.trace, float("nan")
    return [
        Reading(
            observations.kind, trace.ids[i], name, trace.file, trace.rows[i], 1, observations.unit,
            float(value[i, k]), float(result.difference[i, k]), float(sd[i, k]), 1.0,
            float(result.difference[i, k] / spread[i, k]), nan, nan, nan, False, True,
        )
        for i in range(len(observations))
        for k, name in enumerate(trace.element[i])
    ]  # fmt: skip


def _split_by_form(adjusted, images):
    """Yield the ImageCoordinates of each form of camera, as the solver requires."""
    table, spare = adjusted.problem.interior_of, adjusted.problem.layout.interior.size - 1
    active = np.flatnonzero((table < spare).any(axis=0))
    for form, rows in adjusted.survey.by_form(images):
        yield replace(images.taken(rows), form=form, active=active, interior_of=table)


def check_points(adjusted, measurements, known, acting, cov_scale):
    """Compare check.csv, check rows of control.csv and unused control with the adjustment.

    Parameters
    ----------
    adjusted : network.Adjusted
    measurements : Measurements
    known : Known
    acting : ndarray of bool, shape (points, 3)
        Control coordinates that were adjusted.
    cov_scale : float
        Variance factor of the covariances.

    Returns
    -------
    CheckPoints or None
        None: no check point.
    """
    number = {name: i for i, name in enumerate(adjusted.survey.points)}
    is_adjusted = np.isfinite(adjusted.xyz_m).all(axis=1)
    rows = {}
    for table in (measurements.check, measurements.control):
        for name, xyz, sd in _check_rows(table, only_checks=table is measurements.control):
            if name in number and is_adjusted[number[name]]:
                rows[name] = xyz, sd
    idle = np.isfinite(known.sd_m) & ~acting
    for i in np.flatnonzero(idle.any(axis=1) & is_adjusted):
        xyz = np.where(idle[i], known.xyz_m[i], np.nan)
        rows.setdefault(adjusted.survey.points[i], (xyz, known.sd_m[i]))
    if not rows:
        return None
    points = np.array([number[name] for name in rows])
    xyz, sd = (np.array([row[k] for row in rows.values()]) for k in (0, 1))
    difference = adjusted.xyz_m[points] - xyz
    # Check coordinates are independent of the adjustment, so the variances add.
    variance = cov_scale * np.einsum("nii->ni", adjusted.point_covariances_m2[points])
    size = np.sqrt(np.nansum(difference**2, axis=1))
    return CheckPoints(
        names=tuple(rows),
        difference_m=difference,
        sd_m=np.sqrt(variance + np.nan_to_num(sd) ** 2),
        r_xyz_m=float(np.sqrt(np.mean(size**2))),
        largest_m=float(size.max()),
        mean_m=float(size.mean()),
    )


def _check_rows(table, only_checks):
    """Yield name, coordinates and standard deviations of rows in the frame of the survey."""
    if table is None:
        return
    systems = table.system or (None,) * len(table.point)
    for name, system, check, xyz, sd in zip(
        table.point, systems, table.check, table.xyz_m, table.sd_m, strict=True
    ):
        if system is None and (check or not only_checks) and np.isfinite(xyz).any():
            yield name, np.asarray(xyz, dtype=float), np.asarray(sd, dtype=float)
