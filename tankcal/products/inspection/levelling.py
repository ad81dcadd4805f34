"""Levelling tables settlement.csv and edge_profiles.csv: reading, epochs and their differences.

All problems of a file are reported to the log. The values are in SI units, with points sorted by
azimuth.
"""

import re
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np
import scipy

from tankcal.adjust import ALPHA
from tankcal.errors import SolutionError
from tankcal.geometry.circles import fit_circle
from tankcal.job.checking import missing_beside, tiny_sd
from tankcal.job.entries import read_columns
from tankcal.job.fields import Field, number, positive
from tankcal.job.folder import read_csv
from tankcal.job.tables import read_bytes
from tankcal.messages import list_some, message
from tankcal.products.inspection.out_of_plane import arcs_to_next

SETTLEMENT = (
    Field("point", "name", "name of the point, the same in all epochs", required=True),
    number("azimuth_deg", "of the point, clockwise from +y, degrees", -360, 360),
    number("x_m", "of the point, in place of azimuth_deg, metres", -1e7, 1e7),
    number("y_m", "of the point, in place of azimuth_deg, metres", -1e7, 1e7),
    number("elevation_m", "levelled, up, metres", -1e4, 1e4, required=True),
    positive("s_mm", "standard deviation of this elevation, millimetres", 100, in_full=True),
    Field("epoch", "name", "of the levelling, such as 2024-05-31; blank in all rows: one"),
)
EDGE_PROFILES = (
    number("azimuth_deg", "of the radial line, clockwise from +y, degrees", -360, 360,
           required=True),
    number("radius_m", "from the tank's centre, metres", 0, 200, required=True),
    number("z_m", "of the bottom, up, metres", -1e4, 1e4, required=True),
    positive("s_mm", "standard deviation of this elevation, millimetres", 100, in_full=True),
    number("weld_deg", "between the lap weld and the radial line, degrees; blank: 90, parallel to"
           " the shell", 0, 90),
)  # fmt: skip
ONE_EPOCH = "1"  # name of an epoch without a name
LEAST_READINGS = 5  # least number of readings of a radial line
# Largest numbers of points, epochs, readings of a line, and lines.
MOST_POINTS, MOST_EPOCHS, MOST_READINGS, MOST_LINES = 1000, 50, 500, 200
LONGEST_START = 10_000  # number of bytes within which the heading is searched for
MOST_RISE_M = 2.0  # largest range of an epoch or of a profile; more shows another unit
LEAST_SD_MM = 0.01  # smallest valid largest s_mm; less shows another unit
# Largest difference of azimuths in the rows of one point, and least difference of two points.
SAME_PLACE_DEG, SAME_AZIMUTH_DEG = 1.0, 0.05
OFF_CIRCLE = 0.05  # largest distance of a point from the circle, as a share of its radius
LEAST_POINTS = 8  # least number of points of an epoch
WIDEST_GAP_DEG = 90.0  # largest gap between neighbouring points of an epoch
SHOWN = 5  # largest number of names listed in a message
OTHER_DATUM_M = 1.0  # largest mean settlement; more shows epochs without a common bench mark
WITHIN_NOISE = 0.05  # significance level of the test that all elevations are equal


@dataclass(frozen=True)
class RadialLine:
    """Elevations of the bottom along one radial line, by radius.

    Attributes
    ----------
    azimuth_deg : float
        Azimuth from 0 to 360, clockwise from +y.
    radius_m, z_m : ndarray, shape (n,)
        Ascending radii from the tank's centre, and elevations, m.
    sd_m : ndarray, shape (n,), or None
        Standard deviations of the elevations, m; None if not given.
    weld_deg : float or None
        Angle between the lap weld and the radial line; None for a weld parallel to the shell.
    row : int
        First row of the line in the file.
    """

    azimuth_deg: float
    radius_m: np.ndarray
    z_m: np.ndarray
    sd_m: np.ndarray | None
    weld_deg: float | None
    row: int


def read_settlement(path, log):
    """Read the `Levelling` of settlement.csv, or report its problems to `log` and return None."""
    problem_count, values = len(log.problems), _read(path, SETTLEMENT, log)
    if values is None:
        return None
    epochs = _epochs_of_rows(values, log)
    circle_azimuths = _azimuths(values, log)
    if len(log.problems) > problem_count:
        return None
    azimuth, radius_m = circle_azimuths
    places = _places(values, azimuth, log)
    # Rows of each point in each epoch, {(epoch, point): rows}.
    groups = {}
    for i, pair in enumerate(zip(epochs, values.of("point"), strict=True)):
        groups.setdefault(pair, []).append(i)
    given = values.of("s_mm")[0] is not None
    pooled, dof = _pool_sd(values, groups)
    if given:
        _warn_about_repeats(values, groups, log)
    sd_m = values.numbers("s_mm") / 1000 if given else np.full(len(epochs), pooled)
    epoch_list = [_epoch(name, values, groups, places, sd_m) for name in dict.fromkeys(epochs)]
    for epoch in epoch_list:
        _check_epoch(epoch, values.file, log)
    if len(log.problems) > problem_count:
        return None
    if not (given or dof):
        text = message("levels_no_sd", "neither s_mm nor a point that was levelled twice: no"
                       " uncertainty is known, so nothing can be said to pass")  # fmt: skip
        log.warning(values.file, text)
    dof = np.inf if given else float(dof)
    return Levelling(values.file, tuple(sort_epochs(epoch_list)), given, dof, radius_m)


def _epoch(name, values, groups, places, sd_m):
    """`Epoch` with points by azimuth; repeated readings are averaged with weights 1 / sd^2."""
    points = sorted((p for e, p in groups if e == name), key=lambda p: places.get(p, 0.0))
    rows = [groups[name, point] for point in points]
    return Epoch(
        name=name,
        since=None,
        points=tuple(points),
        azimuth_rad=np.radians([places.get(point, np.nan) for point in points]),
        z_m=np.array([_mean(values, point_rows, sd_m) for point_rows in rows]),
        u_m=np.array([np.sum(sd_m[point_rows] ** -2.0) ** -0.5 for point_rows in rows]),
    )


def read_edge_profiles(path, log):
    """Read the radial lines of edge_profiles.csv, or report problems to `log` and return None."""
    problem_count, values = len(log.problems), _read(path, EDGE_PROFILES, log)
    if values is None:
        return None
    azimuth = values.numbers("azimuth_deg") % 360
    lines, angles = [], dict.fromkeys(azimuth.tolist())
    if len(angles) > MOST_LINES:
        text = message("edge_many_lines", "{count} radial lines; expected at most {most}: has each"
                       " reading an azimuth of its own?", count=len(angles),
                       most=MOST_LINES)  # fmt: skip
        log.problem(values.file, text, None, "azimuth_deg")
        return None
    for angle in angles:
        rows = np.flatnonzero(azimuth == angle)
        rows = rows[np.argsort(values.numbers("radius_m")[rows], kind="stable")]
        lines.append(_radial_line(values, rows, log))
    return None if len(log.problems) > problem_count else tuple(lines)


def _read(path, fields, log):
    """Read the ColumnValues of a CSV file; None if it has problems or no rows."""
    path = Path(path)
    problem_count, data = len(log.problems), read_bytes(path, log)
    if data is None:
        return None
    table = read_csv(path.name, data, *_marks(data), log)
    if table is None:
        return None
    values = read_columns(None, table, log, fields)
    if values.is_empty:
        log.problem(path.name, message("levels_no_rows", "no rows; expected levelled points"))
    sds = [sd for sd in values.of("s_mm") if sd is not None]
    if sds and max(sds) < LEAST_SD_MM:
        log.problem(path.name, tiny_sd("mm", max(sds)), values.rows[0], "s_mm")
    return None if len(log.problems) > problem_count else values


def _marks(data):
    """Separator and decimal mark of a CSV file, from its heading; Brazilian Excel uses ; and ,"""
    lines = (line.strip() for line in data[:LONGEST_START].splitlines())
    heading = next((line for line in lines if line and not line.startswith(b"#")), b"")
    return (";", ",") if b";" in heading else (",", ".")


# ---- settlement.csv


def _epochs_of_rows(values, log):
    """Names of the epochs of all rows; report blanks, two spellings and invalid dates."""
    names, first_spelling = values.of("epoch"), {}
    if not any(names):
        return [ONE_EPOCH] * len(names)
    for row, name in zip(values.rows, names, strict=True):
        if name is None:
            text = message("levels_no_epoch", "blank; expected the epoch, as in other rows")
            log.problem(values.file, text, row, "epoch")
            continue
        known, known_row = first_spelling.setdefault(name.casefold(), (name, row))
        if is_like_a_date(name) and known_row == row:
            text = message("levels_no_date", "found {name!r}; expected a date such as 2024-05-31,"
                           " or a name", name=name)  # fmt: skip
            log.problem(values.file, text, row, "epoch")
        if known != name:
            text = message("levels_epoch_spelt", "found {name!r}; expected {known!r}, as in row"
                           " {first_row}", name=name, known=known,
                           first_row=known_row)  # fmt: skip
            log.problem(values.file, text, row, "epoch")
    if len(first_spelling) > MOST_EPOCHS:
        text = message("levels_many_epochs", "{count} epochs; expected at most {most}",
                       count=len(first_spelling), most=MOST_EPOCHS)  # fmt: skip
        log.problem(values.file, text, None, "epoch")
    return names


def _azimuths(values, log):
    """Azimuths (rows,) in degrees, nan if blank, and the radius of their circle or None.

    None is returned if the columns are incomplete or contradictory.
    """
    azimuth, x, y = (values.numbers(name) for name in ("azimuth_deg", "x_m", "y_m"))
    has_azimuth, has_x, has_y = (values.columns[name] is not None
                                 for name in ("azimuth_deg", "x_m", "y_m"))  # fmt: skip
    if has_azimuth and (has_x or has_y):
        text = message("levels_two_places", "given together with {other}; expected only one of"
                       " them: azimuths, or coordinates", other="azimuth_deg")  # fmt: skip
        log.problem(values.file, text, None, "x_m" if has_x else "y_m")
    elif has_x != has_y:
        name, other = ("x_m", "y_m") if has_y else ("y_m", "x_m")
        log.problem(values.file, missing_beside(other), None, name)
    elif not (has_azimuth or has_x):
        text = message("levels_nowhere", "missing; expected the azimuths of the points, or x_m and"
                       " y_m")  # fmt: skip
        log.problem(values.file, text, None, "azimuth_deg")
    elif has_azimuth:
        return azimuth, None
    else:
        return _azimuths_about_circle(values, x, y, log)
    return None


def _azimuths_about_circle(values, x, y, log):
    """Azimuths about the centre of the circle through all points, and its radius, m."""
    known = np.isfinite(x) & np.isfinite(y)
    for row, one_x, one_y in zip(values.rows, x, y, strict=True):
        if np.isfinite(one_x) != np.isfinite(one_y):
            name, other = ("x_m", "y_m") if np.isnan(one_x) else ("y_m", "x_m")
            log.problem(values.file, missing_beside(other), row, name)
    xy = np.column_stack([x, y])[known]
    # Equal covariances give equal weights; only the circle is used, not its uncertainty.
    try:
        circle = fit_circle(xy, np.broadcast_to(np.eye(2) * 1e-4, (len(xy), 2, 2)))
    except (SolutionError, ValueError):
        text = message("levels_no_circle", "no circle goes through the points; expected"
                       " coordinates of points round the tank")  # fmt: skip
        log.problem(values.file, text, None, "x_m")
        return None
    deviations = np.abs(circle.residuals_m)
    for row, deviation in zip(np.array(values.rows)[known], deviations, strict=True):
        if deviation > OFF_CIRCLE * circle.radius_m:
            text = message("levels_off_circle", "{off:.3g} m off the circle through all points,"
                           " radius {radius:.4g} m; expected points at the shell",
                           off=float(deviation), radius=circle.radius_m)  # fmt: skip
            log.problem(values.file, text, int(row), "x_m")
    azimuth = np.degrees(np.arctan2(x - circle.x_m, y - circle.y_m))
    return azimuth, circle.radius_m


def _places(values, azimuth, log):
    """Mean azimuth of each point, {point: degrees from 0 to 360}; report contradictions."""
    rows_of = {}
    for i, point in enumerate(values.of("point")):
        rows_of.setdefault(point, []).append(i)
    places = {}
    for point, rows in rows_of.items():
        given = [i for i in rows if np.isfinite(azimuth[i])]
        if not given:
            text = message("levels_point_nowhere", "point {point!r} has no place in any row;"
                           " expected its azimuth, or x_m and y_m, in one",
                           point=point)  # fmt: skip
            log.problem(values.file, text, values.rows[rows[0]], "point")
            continue
        first = azimuth[given[0]]
        # Differences from -180 to 180 degrees, so that the mean is valid across north.
        differences = [(azimuth[i] - first + 180) % 360 - 180 for i in given]
        for i, difference in zip(given, differences, strict=True):
            if abs(difference) > SAME_PLACE_DEG:
                text = message("levels_moved", "point {point!r} is at {azimuth:.2f} degrees here,"
                               " at {first:.2f} in row {first_row}; expected one place",
                               point=point, azimuth=float(azimuth[i]) % 360,
                               first=float(first) % 360,
                               first_row=values.rows[given[0]])  # fmt: skip
                log.problem(values.file, text, values.rows[i], "point")
        places[point] = float(first + np.mean(differences)) % 360
    return places


def _pool_sd(values, groups):
    """Pooled standard deviation of a reading from repeats, m, and its degrees of freedom.

    Identical repeats suggest copied rows; the result is then nan and 0.
    """
    z = values.numbers("elevation_m")
    dof = sum(len(rows) - 1 for rows in groups.values())
    if not dof:
        return np.nan, 0
    squares = sum(np.sum((z[rows] - np.mean(z[rows])) ** 2) for rows in groups.values())
    return (float(np.sqrt(squares / dof)), dof) if squares > 0 else (np.nan, 0)


def _mean(values, rows, sd_m):
    """Mean elevation of the rows of a point, m, with weights 1 / sd^2 if the sds are known."""
    weights = None if np.isnan(sd_m[rows[0]]) else sd_m[rows] ** -2.0
    return np.average(values.numbers("elevation_m")[rows], weights=weights)


def _warn_about_repeats(values, groups, log):
    """Warn if repeats differ by more than s_mm allows (chi-squared test, 0.1 %)."""
    z, sd = values.numbers("elevation_m"), values.numbers("s_mm") / 1000
    dof = sum(len(rows) - 1 for rows in groups.values())
    if not dof:
        return
    squares = sum(
        np.sum(((z[rows] - _mean(values, rows, sd)) / sd[rows]) ** 2) for rows in groups.values()
    )
    if scipy.stats.chi2.sf(squares, dof) < ALPHA:
        text = message("levels_repeats_off", "points that were levelled again differ {times:.1f}"
                       " times as much as s_mm says",
                       times=float(np.sqrt(squares / dof)))  # fmt: skip
        log.warning(values.file, text, None, "s_mm")


def _check_epoch(epoch, file, log):
    """Report too few points, equal azimuths, wide gaps and another unit in an epoch."""
    if len(epoch.points) < LEAST_POINTS:
        text = message("levels_few_points", "epoch {epoch!r} has {count} points; expected at least"
                       " {least}", epoch=epoch.name, count=len(epoch.points),
                       least=LEAST_POINTS)  # fmt: skip
        log.problem(file, text)
        return
    if len(epoch.points) > MOST_POINTS:
        text = message("levels_many_points", "epoch {epoch!r} has {count} points; expected at most"
                       " {most}", epoch=epoch.name, count=len(epoch.points),
                       most=MOST_POINTS)  # fmt: skip
        log.problem(file, text)
        return
    gaps = np.degrees(arcs_to_next(epoch.azimuth_rad))
    for i in np.flatnonzero(gaps < SAME_AZIMUTH_DEG):
        text = message("levels_same_azimuth", "points {point!r} and {other!r} of epoch {epoch!r}"
                       " are both at {azimuth:.2f} degrees; expected two places, or one name",
                       point=epoch.points[i], other=epoch.points[(i + 1) % len(epoch.points)],
                       epoch=epoch.name,
                       azimuth=float(np.degrees(epoch.azimuth_rad[i])))  # fmt: skip
        log.problem(file, text)
    widest = int(np.argmax(gaps))
    if gaps[widest] > WIDEST_GAP_DEG:
        text = message("levels_half_round", "epoch {epoch!r} has no point for {gap:.0f} degrees"
                       " after {point!r}; expected points all round the tank", epoch=epoch.name,
                       gap=float(gaps[widest]), point=epoch.points[widest])  # fmt: skip
        log.problem(file, text)
    if np.ptp(epoch.z_m) > MOST_RISE_M:
        text = message("levels_other_unit", "elevations of epoch {epoch!r} differ by up to"
                       " {rise:.4g} m; expected metres, {most:g} m at most: are they in"
                       " millimetres?", epoch=epoch.name, rise=float(np.ptp(epoch.z_m)),
                       most=MOST_RISE_M)  # fmt: skip
        log.problem(file, text, None, "elevation_m")


# ---- edge_profiles.csv


def _radial_line(values, rows, log):
    """`RadialLine` of the rows of one azimuth; report its problems."""
    radius, z = values.numbers("radius_m")[rows], values.numbers("z_m")[rows]
    row, azimuth = values.rows[min(rows)], float(values.numbers("azimuth_deg")[rows[0]] % 360)
    if len(rows) < LEAST_READINGS:
        text = message("edge_few_readings", "the line at {azimuth:g} degrees has {count} readings;"
                       " expected at least {least}", azimuth=azimuth, count=len(rows),
                       least=LEAST_READINGS)  # fmt: skip
        log.problem(values.file, text, row, "azimuth_deg")
    if len(rows) > MOST_READINGS:
        text = message("edge_many_readings", "the line at {azimuth:g} degrees has {count} readings;"
                       " expected at most {most}", azimuth=azimuth, count=len(rows),
                       most=MOST_READINGS)  # fmt: skip
        log.problem(values.file, text, row, "azimuth_deg")
    for i in np.flatnonzero(np.diff(radius) == 0):
        text = message("edge_same_radius", "the line at {azimuth:g} degrees has {radius:g} m"
                       " already; expected each radius once", azimuth=azimuth,
                       radius=float(radius[i]))  # fmt: skip
        log.problem(values.file, text, values.rows[rows[i + 1]], "radius_m")
    if np.ptp(z) > MOST_RISE_M:
        text = message("edge_other_unit", "elevations of the line at {azimuth:g} degrees differ by"
                       " up to {rise:.4g} m; expected metres, {most:g} m at most: are they in"
                       " millimetres?", azimuth=azimuth, rise=float(np.ptp(z)),
                       most=MOST_RISE_M)  # fmt: skip
        log.problem(values.file, text, row, "z_m")
    welds = [angle for angle in np.array(values.of("weld_deg"))[rows] if angle is not None]
    if len(set(welds)) > 1:
        text = message("edge_two_welds", "the line at {azimuth:g} degrees has {angles} degrees;"
                       " expected one angle of its weld", azimuth=azimuth,
                       angles=list_some([f"{angle:g}" for angle in dict.fromkeys(welds)],
                                        SHOWN))  # fmt: skip
        log.problem(values.file, text, row, "weld_deg")
    has_sd = values.of("s_mm")[0] is not None
    sd_m = values.numbers("s_mm")[rows] / 1000 if has_sd else None
    return RadialLine(azimuth, radius, z, sd_m, float(welds[0]) if welds else None, row)


@dataclass(frozen=True)
class Epoch:
    """Elevations of one epoch, or their changes, by azimuth.

    Attributes
    ----------
    name : str
        Name of the epoch.
    since : str or None
        Name of the earlier epoch of a difference; None for an epoch itself.
    points : tuple of str
        Names of the points.
    azimuth_rad : ndarray, shape (n,)
        Azimuths, ascending from 0 to 2 pi, clockwise from +y.
    z_m, u_m : ndarray, shape (n,)
        Elevations (means of repeated readings) and their standard uncertainties, nan if unknown.
    """

    name: str
    since: str | None
    points: tuple[str, ...]
    azimuth_rad: np.ndarray
    z_m: np.ndarray
    u_m: np.ndarray


@dataclass(frozen=True)
class Levelling:
    """All epochs of settlement.csv.

    Attributes
    ----------
    file : str
        Name of the file.
    epochs : tuple of Epoch
        Epochs in the order of their dates; epochs with other names in the order of the file.
    sd_known : bool
        Whether s_mm was given. If not, the standard deviation is estimated from repeated readings.
    dof : float
        Degrees of freedom of all standard deviations: inf if given, the degrees of freedom of the
        repeated readings if estimated, and 0 if unknown.
    radius_m : float or None
        Radius of the circle through the points, m; None if azimuths were given.
    """

    file: str
    epochs: tuple[Epoch, ...]
    sd_known: bool
    dof: float
    radius_m: float | None


def is_date(name):
    """Whether a name is a date that sorts as text, such as 2024, 2024-05 or 2024-05-31.

    >>> [is_date(name) for name in ("2024", "2024-05", "2024-02-30", "31-12-2019", "2024-5-31")]
    [True, True, False, False, False]
    """
    if not re.fullmatch(r"[0-9]{4}(-[0-9]{2}){0,2}", name):
        return False
    try:
        date.fromisoformat((name + "-01-01")[:10])
    except ValueError:
        return False
    return True


def is_like_a_date(name):
    """Whether a name has numbers and hyphens as a date, but is no such date (31-12-2019)."""
    return re.fullmatch(r"[0-9]+(-[0-9]+){1,2}", name) is not None and not is_date(name)


def sort_epochs(epochs):
    """Epochs sorted by date if all names are dates such as 2024, 2024-05 or 2024-05-31."""
    dated = all(is_date(epoch.name) for epoch in epochs)
    return sorted(epochs, key=lambda epoch: epoch.name) if dated else epochs


def find_differences(levelling, log):
    """Differences of each later epoch to the first, and of the last epoch to the previous one."""
    pairs = [(epoch, levelling.epochs[0]) for epoch in levelling.epochs[1:]]
    if len(pairs) > 1:
        pairs.append((levelling.epochs[-1], levelling.epochs[-2]))
    changes = [_difference(*pair, levelling.file, log) for pair in pairs]
    return [epoch for epoch in changes if epoch is not None]


def _difference(later, earlier, file, log):
    """Difference of two epochs at their common points, or None if these are too few."""
    earlier_place = {point: i for i, point in enumerate(earlier.points)}
    common = [i for i, point in enumerate(later.points) if point in earlier_place]
    earlier_rows = [earlier_place[later.points[i]] for i in common]
    unmatched = [*dict.fromkeys(point for point in (*later.points, *earlier.points)
                      if point not in earlier_place or point not in later.points)]  # fmt: skip
    z = later.z_m[common] - earlier.z_m[earlier_rows]
    gaps = np.degrees(arcs_to_next(later.azimuth_rad[common])) if common else np.array([360.0])
    names = {"later": later.name, "earlier": earlier.name}
    if len(common) < LEAST_POINTS or gaps.max() > WIDEST_GAP_DEG:
        text = message("levels_no_difference", "{count} points are in both {later!r} and"
                       " {earlier!r}; {least} all round would be needed: no difference of the two"
                       " is made", count=len(common), least=LEAST_POINTS, **names)  # fmt: skip
        log.warning(file, text, None, "epoch")
        return None
    if unmatched:
        text = message("levels_alone", "only one of {later!r} and {earlier!r} has {points}: left"
                       " out of their difference", points=list_some(unmatched, SHOWN),
                       **names)  # fmt: skip
        log.warning(file, text, None, "epoch")
    if abs(np.mean(z)) > OTHER_DATUM_M:
        text = message("levels_other_datum", "{later!r} lies {off:.3g} m from {earlier!r} on the"
                       " whole: without a common bench mark nothing is said of uniform settlement",
                       off=float(np.mean(z)), **names)  # fmt: skip
        log.warning(file, text, None, "elevation_m")
    u = np.hypot(later.u_m[common], earlier.u_m[earlier_rows])
    points = tuple(later.points[i] for i in common)
    return Epoch(later.name, earlier.name, points, later.azimuth_rad[common], z, u)


def warn_about_points(epoch, file, diameter_m, limits, log):
    """Warn of too few points for the tank, of an odd number of points, and of wide gaps.

    Parameters
    ----------
    epoch : Epoch
    file : str
        Name of settlement.csv.
    diameter_m : float
        Diameter of the tank, m.
    limits : SettlementLimits
        Limits of the number and the distance of points; None in a field for no limit.
    log : Log
        Receives the warnings.
    """
    count, per_point = len(epoch.points), limits.diameter_per_point_m
    required = 0 if per_point is None else int(np.ceil(diameter_m / per_point - 1e-9))
    required += required % 2
    if count < required:
        text = message("levels_fewer_than_asked", "epoch {epoch!r} has {count} points; a tank of"
                       " {diameter:.4g} m asks for {wanted}", epoch=epoch.name, count=count,
                       diameter=diameter_m, wanted=required)  # fmt: skip
        log.warning(file, text)
    if count % 2:
        text = message("levels_odd", "epoch {epoch!r} has {count} points; an even number is"
                       " expected, so that diameters close", epoch=epoch.name,
                       count=count)  # fmt: skip
        log.warning(file, text)
    arcs = arcs_to_next(epoch.azimuth_rad) * diameter_m / 2
    if limits.largest_arc_m is not None and arcs.max() > limits.largest_arc_m + 1e-6:
        after = [epoch.points[i] for i in np.flatnonzero(arcs > limits.largest_arc_m + 1e-6)]
        text = message("levels_wide_gaps", "epoch {epoch!r} has points up to {arc:.3g} m apart,"
                       " more than {most:.3g} m, after {points}", epoch=epoch.name,
                       arc=float(arcs.max()), most=limits.largest_arc_m,
                       points=list_some(after, SHOWN))  # fmt: skip
        log.warning(file, text)


def is_within_noise(epoch, dof):
    """Whether the elevations of an epoch agree within their uncertainties (5 %).

    The test is the chi-squared test, or the F test if the standard deviations were estimated with
    `dof` degrees of freedom. Without a standard deviation (dof = 0) the result is False.
    """
    if not dof:
        return False
    weights = epoch.u_m**-2.0
    deviations = epoch.z_m - np.average(epoch.z_m, weights=weights)
    chi2, count = float(deviations**2 @ weights), len(deviations) - 1
    significance = (
        scipy.stats.chi2.sf(chi2, count)
        if np.isinf(dof)
        else scipy.stats.f.sf(chi2 / count, count, dof)
    )
    return bool(significance > WITHIN_NOISE)
