"""What was kept apart and is only compared: check readings, check points, control not acting."""

from dataclasses import replace

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.survey.network.quality import compare_left_out
from tankcal.survey.observations import ImageCoordinates
from tankcal.survey.results import CheckPoints, Reading

DISAGREE = 4.0  # sds by which a check point may differ
LISTED = 10  # check points that are told


def check_readings(adjusted, checks, cov_scale):
    """Reading rows (check=True) of observations that were left out of the adjustment.

    checks  Observations
    """
    found = []
    for one in checks:
        parts = _by_form(adjusted, one) if isinstance(one, ImageCoordinates) else [one]
        for part in parts:
            found += _rows(adjusted, part, cov_scale)
    return found


def find_disagreeing_checks(found, table):
    """Problem rows of check points that differ more than their uncertainty allows.

    found  CheckPoints or None        table  job.KnownPoints of check.csv, or None
    """
    problems = []
    if found is None or table is None:
        return problems
    for name, difference, sd in zip(found.names, found.difference_m, found.sd_m, strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
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


def _rows(adjusted, one, cov_scale):
    ties = [np.asarray(getattr(one, name)) for name in one.ties]
    there = np.isfinite(adjusted.xyz_m[np.array(ties)]).all(axis=(0, 2))
    one = one.taken(there)
    if not len(one):
        return []
    result = compare_left_out(adjusted, one)
    sd = np.reshape(one.sd, result.difference.shape)
    spread = np.sqrt(sd**2 + cov_scale * np.maximum(result.sd**2 - sd**2, 0.0))
    value = np.reshape(one.value, sd.shape)
    trace, nan = one.trace, float("nan")
    return [
        Reading(
            one.kind, trace.ids[i], name, trace.file, trace.rows[i], 1, one.unit,
            float(value[i, k]), float(result.difference[i, k]), float(sd[i, k]), 1.0,
            float(result.difference[i, k] / spread[i, k]), nan, nan, nan, False, True,
        )
        for i in range(len(one))
        for k, name in enumerate(trace.element[i])
    ]  # fmt: skip


def _by_form(adjusted, images):
    """ImageCoordinates of each form of camera, as the solver has them."""
    table, spare = adjusted.problem.interior_of, adjusted.problem.layout.interior.size - 1
    active = np.flatnonzero((table < spare).any(axis=0))
    for form, rows in adjusted.survey.by_form(images):
        yield replace(images.taken(rows), form=form, active=active, interior_of=table)


def check_points(adjusted, measurements, known, acting, cov_scale):
    """CheckPoints of check.csv, check rows of control.csv, and control that does not act; or None.

    known   Known                 acting  (points, 3) True: this control coordinate was adjusted
    """
    number = {name: i for i, name in enumerate(adjusted.survey.points)}
    there = np.isfinite(adjusted.xyz_m).all(axis=1)
    rows = {}
    for table in (measurements.check, measurements.control):
        for name, xyz, sd in _check_rows(table, only_checks=table is measurements.control):
            if name in number and there[number[name]]:
                rows[name] = xyz, sd
    idle = np.isfinite(known.sd_m) & ~acting
    for i in np.flatnonzero(idle.any(axis=1) & there):
        xyz = np.where(idle[i], known.xyz_m[i], np.nan)
        rows.setdefault(adjusted.survey.points[i], (xyz, known.sd_m[i]))
    if not rows:
        return None
    points = np.array([number[name] for name in rows])
    xyz, sd = (np.array([row[k] for row in rows.values()]) for k in (0, 1))
    difference = adjusted.xyz_m[points] - xyz
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
    """Names, coordinates and sds of the rows of a table in the survey's own frame."""
    if table is None:
        return
    systems = table.system or (None,) * len(table.point)
    for name, system, check, xyz, sd in zip(
        table.point, systems, table.check, table.xyz_m, table.sd_m, strict=True
    ):
        if system is None and (check or not only_checks) and np.isfinite(xyz).any():
            yield name, np.asarray(xyz, dtype=float), np.asarray(sd, dtype=float)
