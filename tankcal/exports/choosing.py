"""Select the rows of a record's table for an export, or report why a profile does not fit.

A profile writes whole numbers of quanta; each number is rounded once.
"""

from dataclasses import dataclass
from fractions import Fraction
from math import floor

import numpy as np

from tankcal.exports.breakpoints import (
    best_breakpoints,
    fewest_breakpoints,
    fewest_spline_breakpoints,
    polyline_error,
    spline_breakpoints,
    spline_error,
)
from tankcal.exports.profiles import INCREMENTS_M, MOST_POINTS
from tankcal.messages import message

_ON_STEP = 1e-6  # tolerance relative to a step
ZERO_M = 1e-9
_MOST_OF_SPLINE = 200  # largest number of points tried for an error
ON_THE_MARK_M = 1e-8
_MOSTLY = 0.5  # share of rows on marks of the profile above which only these are permitted


class RowRequest:
    """A request for rows of a record: by a profile, by a number of points, or within an error."""

    def __init__(self, record, profile, points, max_error_m3, log):
        self.record, self.profile, self.log = record, profile, log
        self.points, self.max_error_m3 = points, max_error_m3
        self.height = np.array(record.capacity.height_m)
        self.volume = np.array(record.capacity.volume_m3)
        self.interpolation_m3 = (
            0.0 if record.interpolation is None else record.interpolation.largest_m3
        )
        self.has_zero = abs(self.height[0]) <= ZERO_M
        self.is_zero_left_out = self.has_zero and profile.zero_row == "forbidden"

    def report(self, text, key):
        """Report a problem of a key of the profile, or of an option."""
        self.log.problem(f"{self.profile.code}.toml", text, None, key)

    def marks(self):
        """Return (`Marks`, required rows); report values that do not fit."""
        profile, reference = self.profile, self.record.job.datum.reference_height_m
        if "ullage" in profile.columns and reference is None:
            text = message("export_no_reference", "the record has no reference height; expected "
                           "one for ullages")  # fmt: skip
            self.report(text, "table.columns")
            return None, ()
        if profile.zero_row == "required" and not self.has_zero:
            text = message("export_no_zero", "the table begins at {at:.6g} m; expected a row of "
                           "dip 0", at=self.height[0])  # fmt: skip
            self.report(text, "table.zero_row")
        required = self._required_rows()
        marks = make_marks(self.height, self.volume, profile, reference, required)
        missing = [row for row in required if not marks.permitted[row]]
        if missing:
            text = message("export_same_level", "the dips {dips} fall on one level of this profile;"
                           " expected more decimals", dips=[f"{self.height[k]:.6g}" for k in
                                                            missing])  # fmt: skip
            self.report(text, "levels.decimals")
        if self.is_zero_left_out:
            marks.at_m[0], marks.written_m3[0] = 0.0, 0.0  # required first row of such a system
        return marks, required

    def _required_rows(self):
        """Required rows: the ends, and rows about the critical zone of a roof."""
        required = {0, len(self.height) - 1}
        for_use = np.array(self.record.capacity.for_use, dtype=bool)
        if len(for_use) == len(self.height):
            edges = np.flatnonzero(np.diff(for_use.astype(int)))
            required |= {int(row) if for_use[row] else int(row) + 1 for row in edges}
        return sorted(required)

    def select_rows(self, marks, required):
        """Return (rows, bound of the error without interpolation_m3, its dip).

        Report an impossible request.
        """
        grid = self.profile.grid
        if self.points is None and self.max_error_m3 is None and grid != "breakpoints":
            if grid == "every row":
                rows = _drop_shifted_top(marks, np.flatnonzero(marks.permitted), self.height)
                table_rows = slice(int(rows[-1]) + 1)  # the file states no volume above its top
            else:
                rows, table_rows = self._steps(marks), slice(None)
            if len(rows) < 2:
                return rows, 0.0, 0.0
            judge = spline_error if self.profile.interpolation == "spline" else polyline_error
            table = self.height[table_rows], self.volume[table_rows]
            return (rows, *judge(*table, marks.at_m, marks.written_m3, rows))
        if "volume" not in self.profile.columns:
            text = message("export_increments_only", "has volumes of increments only; expected "
                           "every row there: leave out --points and --max-error-l")  # fmt: skip
            self.report(text, "table.columns")
            return np.array(required), 0.0, 0.0
        solution = self._breakpoints(marks, required)
        if solution is None:
            return np.array(required), 0.0, 0.0
        return solution.rows, solution.error, solution.at

    def _breakpoints(self, marks, required):
        """Return the `Breakpoints` of the request; None after reporting why there are none."""
        # A required first row that the file omits does not count as a point.
        more = int(self.is_zero_left_out)
        most = self.profile.max_points
        points = self.points if self.points is not None else most
        if points is None and self.max_error_m3 is None:
            text = message("export_how_many", "no limit of points is known; expected --points or "
                           "--max-error-l")  # fmt: skip
            return self.report(text, "table.max_points")
        options = dict(
            fixed=required, at=marks.at_m, written=marks.written_m3, candidates=marks.permitted
        )
        table, is_spline = (self.height, self.volume), self.profile.interpolation == "spline"
        if self.max_error_m3 is not None:
            return self._fewest_rows_within_error(table, options, is_spline, most)
        points = min(points + more, len(self.height))
        if points < len(required):
            text = message("export_few_points", "{points} points; expected {least} or more: the "
                           "ends and the critical zone have to stand", points=points - more,
                           least=len(required) - more)  # fmt: skip
            return self.report(text, "table.max_points")
        find = spline_breakpoints if is_spline else best_breakpoints
        solution = find(*table, points, **options)
        if solution is None:
            text = message("export_no_spline", "no spline of so many points rises everywhere; "
                           "expected more points")  # fmt: skip
            self.report(text, "table.interpolation")
        return solution

    def _fewest_rows_within_error(self, table, options, is_spline, most):
        """Fewest rows within the requested error, reduced by the error of the table itself."""
        error = self.max_error_m3 - self.interpolation_m3
        if is_spline:
            most = min(most or _MOST_OF_SPLINE, len(self.height))
            solution = fewest_spline_breakpoints(*table, error, most=most, **options)
        else:
            solution = fewest_breakpoints(*table, error, **options) if error > 0 else None
        if solution is None:
            rows = np.flatnonzero(options["candidates"])
            least = (
                polyline_error(*table, options["at"], options["written"], rows)[0]
                + self.interpolation_m3
            )
            text = message(
                "export_not_within", "no rows keep {asked:.4g} L: all of them, rounded as the "
                "profile writes them, err by {least:.4g} L", asked=1000 * self.max_error_m3,
                least=1000 * least,
            )  # fmt: skip
            self.report(text, "--max-error-l")
        return solution

    def _steps(self, marks):
        """Rows at every step, and the highest row."""
        step, height = self.profile.step_m, self.height
        if (height[-1] - height[0]) / step > MOST_POINTS:
            text = message("export_many_steps", "a step of {step:.6g} m; expected a larger one",
                           step=step)  # fmt: skip
            self.report(text, "table.step_m")
            return np.array([0, len(height) - 1])
        numbers = np.round(height / step)
        is_on = np.abs(height - numbers * step) <= _ON_STEP * step
        wanted = np.arange(np.ceil(height[0] / step - _ON_STEP), height[-1] / step + _ON_STEP)
        missing = np.setdiff1d(wanted, numbers[is_on])
        if len(missing):
            text = message("export_no_row", "the table has no row at {at:.6g} m ({count} are "
                           "missing); expected one at every {step:.6g} m", at=missing[0] * step,
                           count=len(missing), step=step)  # fmt: skip
            self.report(text, "table.step_m")
        is_on[[0, -1]] = True
        return np.flatnonzero(is_on & marks.permitted)

    def refuse_limits(self, marks, rows):
        """Report rows, digits or volumes beyond the limits of the profile's system."""
        profile, count = self.profile, len(rows)
        fewest, most = profile.min_points or 1, profile.max_points or MOST_POINTS
        if not fewest <= count <= most:
            text = message("export_limit_points", "{count} rows; the system takes {fewest} to "
                           "{most}", count=count, fewest=fewest, most=most)  # fmt: skip
            self.report(text, "table.max_points" if count > most else "table.min_points")
        largest = max(abs(marks.volume[row]) for row in rows)
        shown = f"{largest / 10**profile.volume_decimals:.{profile.volume_decimals}f}"
        if profile.digits is not None and largest >= 10**profile.digits:
            text = message("export_limit_digits", "the volume {volume} {unit} has more than the "
                           "{digits} digits that the system takes", volume=shown,
                           unit=profile.volume_unit, digits=profile.digits)  # fmt: skip
            self.report(text, "volumes.digits")
        if profile.largest is not None and largest > profile.largest * 10**profile.volume_decimals:
            text = message("export_limit_volume", "the volume {volume} {unit} is above the largest"
                           " that the system takes, {largest:.9g}", volume=shown,
                           unit=profile.volume_unit, largest=profile.largest)  # fmt: skip
            self.report(text, "volumes.largest")


def _drop_shifted_top(marks, rows, height):
    """Return the rows without the highest one if only this row is off the marks.

    At the next mark, its volume would belong to another dip.
    """
    is_off = np.abs(marks.at_m[rows] - height[rows]) > ON_THE_MARK_M
    return rows[:-1] if len(rows) > 2 and is_off[-1] and not is_off[:-1].any() else rows


@dataclass(frozen=True)
class Marks:
    """Rows of a table as whole numbers of the profile's last digits.

    Attributes
    ----------
    level, volume : (rows,) list of int
        Quanta of the leading column of levels, and of volumes, offsets subtracted.
    at_m, written_m3 : (rows,) ndarray
        Dip and volume as a system interprets them.
    permitted : (rows,) ndarray of bool
        Permitted rows: on a mark if most rows are, and only one row per level.
    """

    level: list
    volume: list
    at_m: np.ndarray
    written_m3: np.ndarray
    permitted: np.ndarray


def to_quanta(value, quantum):
    """Whole number of quanta nearest to a number, exact; halves are rounded up.

    Examples
    --------
    >>> to_quanta(5.5, Fraction(1, 100)), to_quanta(0.0004999, Fraction(1, 1000))
    (550, 0)
    """
    over, under = float(value).as_integer_ratio()
    over, under = over * quantum.denominator, under * quantum.numerator
    return (2 * over + under) // (2 * under)


def count_increments(height_m, increment):
    """Height as a whole number of increments, such as "1/16 in".

    Examples
    --------
    >>> from tankcal.tank.dips import parse_dip
    >>> count_increments(parse_dip("5 ft 3 3/16 in", "ft-in-16"), "1/16 in")
    1011
    >>> count_increments(5.5, "1/100 m")
    550
    """
    return to_quanta(height_m, INCREMENTS_M[increment])


def make_marks(height_m, volume_m3, profile, reference_m=None, required=()):
    """Return the `Marks` of a table in a profile.

    Parameters
    ----------
    height_m, volume_m3 : (rows,) ndarray
    profile : Profile
    reference_m : float, optional
        Reference height of ullages.
    required : sequence of int, optional
        Rows that take precedence over other rows of equal level.
    """
    quantum, volume_quantum = profile.level_quantum_m, profile.volume_quantum_m3
    is_ullage = profile.leading == "ullage"
    level_offset = Fraction(str(profile.level_offset_m))
    volume_offset = Fraction(str(profile.volume_offset_m3))
    levels = reference_m - height_m if is_ullage else height_m
    level = _quanta(levels, quantum, level_offset)
    volume = _quanta(volume_m3, volume_quantum, volume_offset)
    at = np.array([float(n * quantum + level_offset) for n in level])
    at = reference_m - at if is_ullage else at
    written = np.array([float(n * volume_quantum + volume_offset) for n in volume])
    return Marks(level, volume, at, written, _find_permitted(height_m, at, level, required))


def _quanta(values, quantum, offset):
    if offset == 0:
        return [to_quanta(value, quantum) for value in values.tolist()]
    half = Fraction(1, 2)
    return [floor((Fraction(value) - offset) / quantum + half) for value in values.tolist()]


def _find_permitted(height_m, at_m, level, required):
    """Mask (rows,) of the permitted rows."""
    off = np.abs(at_m - height_m)
    on_mark = off <= ON_THE_MARK_M
    permitted = on_mark.copy() if on_mark.mean() >= _MOSTLY else np.ones(len(off), dtype=bool)
    permitted[list(required)] = True
    off[list(required)] = -1.0  # takes precedence over other rows of its level
    best = {}
    for row in np.flatnonzero(permitted):
        n = level[row]
        if n not in best or off[row] < off[best[n]]:
            best[n] = row
    kept = np.zeros(len(off), dtype=bool)
    kept[list(best.values())] = True
    return kept
