"""Select the rows of a record's table for an export, or report why a profile does not fit."""

import numpy as np

from tankcal.exports.breakpoints import best_breakpoints, fewest_breakpoints, polyline_error
from tankcal.exports.marks import ON_THE_MARK_M, marks_of
from tankcal.exports.profiles import MOST_POINTS
from tankcal.exports.splines import fewest_spline_breakpoints, spline_breakpoints, spline_error
from tankcal.messages import message

_ON_STEP = 1e-6  # tolerance relative to a step
ZERO_M = 1e-9
_MOST_OF_SPLINE = 200  # largest number of points tried for an error


class Asked:
    """A request for rows of a record: by a profile, by a number of points, or within an error."""

    def __init__(self, file, record, profile, points, max_error_m3, log):
        self.file, self.record, self.profile, self.log = file, record, profile, log
        self.points, self.max_error_m3 = points, max_error_m3
        self.height = np.array(record.capacity.height_m)
        self.volume = np.array(record.capacity.volume_m3)
        self.own_m3 = 0.0 if record.interpolation is None else record.interpolation.largest_m3
        self.has_zero = abs(self.height[0]) <= ZERO_M
        self.is_zero_left_out = self.has_zero and profile.zero_row == "forbidden"

    def tell(self, text, key):
        self.log.problem(f"{self.profile.code}.toml", text, None, key)

    def marks(self):
        """Return (`Marks`, required rows); report values that do not fit."""
        profile, reference = self.profile, self.record.job.datum.reference_height_m
        if "ullage" in profile.columns and reference is None:
            text = message("export_no_reference", "the record has no reference height; expected "
                           "one for ullages")  # fmt: skip
            self.tell(text, "table.columns")
            return None, ()
        if profile.zero_row == "required" and not self.has_zero:
            text = message("export_no_zero", "the table begins at {at:.6g} m; expected a row of "
                           "dip 0", at=self.height[0])  # fmt: skip
            self.tell(text, "table.zero_row")
        fixed = self._fixed()
        marks = marks_of(self.height, self.volume, profile, reference, fixed)
        missing = [row for row in fixed if not marks.stands[row]]
        if missing:
            text = message("export_same_level", "the dips {dips} fall on one level of this profile;"
                           " expected more decimals", dips=[f"{self.height[k]:.6g}" for k in
                                                            missing])  # fmt: skip
            self.tell(text, "levels.decimals")
        if self.is_zero_left_out:
            marks.at_m[0], marks.written_m3[0] = 0.0, 0.0  # required first row of such a system
        return marks, fixed

    def _fixed(self):
        """Required rows: the ends, and rows about the critical zone of a roof."""
        fixed = {0, len(self.height) - 1}
        for_use = np.array(self.record.capacity.for_use, dtype=bool)
        if len(for_use) == len(self.height):
            edges = np.flatnonzero(np.diff(for_use.astype(int)))
            fixed |= {int(row) if for_use[row] else int(row) + 1 for row in edges}
        return sorted(fixed)

    def chosen(self, marks, fixed):
        """Return (rows, bound of the error without own_m3, its dip).

        Report an impossible request.
        """
        grid = self.profile.grid
        if self.points is None and self.max_error_m3 is None and grid != "breakpoints":
            rows = np.flatnonzero(marks.stands) if grid == "every row" else self._steps(marks)
            judge = spline_error if self.profile.interpolation == "spline" else polyline_error
            if grid == "every row":
                rows = _less_shifted_top(marks, rows, self.height)
            read = slice(int(rows[-1]) + 1) if grid == "every row" else slice(None)
            table = (self.height[read], self.volume[read], marks.at_m, marks.written_m3, rows)
            return (rows, *judge(*table)) if len(rows) > 1 else (rows, 0.0, 0.0)
        if "volume" not in self.profile.columns:
            text = message("export_increments_only", "has volumes of increments only; expected "
                           "every row there: leave out --points and --max-error-l")  # fmt: skip
            self.tell(text, "table.columns")
            return np.array(fixed), 0.0, 0.0
        solution = self._breakpoints(marks, fixed)
        return (
            (np.array(fixed), 0.0, 0.0)
            if solution is None
            else (solution.rows, solution.error, solution.at)
        )

    def _breakpoints(self, marks, fixed):
        more = int(self.is_zero_left_out)
        most = self.profile.max_points
        points = self.points if self.points is not None else most
        if points is None and self.max_error_m3 is None:
            text = message("export_how_many", "no limit of points is known; expected --points or "
                           "--max-error-l")  # fmt: skip
            return self.tell(text, "table.max_points")
        options = dict(
            fixed=fixed, at=marks.at_m, written=marks.written_m3, candidates=marks.stands
        )
        table, is_spline = (self.height, self.volume), self.profile.interpolation == "spline"
        if self.max_error_m3 is not None:
            return self._within(table, options, is_spline, most)
        points = min(points + more, len(self.height))
        if points < len(fixed):
            text = message("export_few_points", "{points} points; expected {least} or more: the "
                           "ends and the critical zone have to stand", points=points - more,
                           least=len(fixed) - more)  # fmt: skip
            return self.tell(text, "table.max_points")
        solution = (spline_breakpoints if is_spline else best_breakpoints)(
            *table, points, **options
        )
        return solution if solution is not None else self._tell_no_spline()

    def _within(self, table, options, is_spline, most):
        """Fewest rows within the requested error, reduced by the error of the table itself."""
        error = self.max_error_m3 - self.own_m3
        if is_spline:
            most = min(most or _MOST_OF_SPLINE, len(self.height))
            solution = fewest_spline_breakpoints(*table, error, most=most, **options)
        else:
            solution = fewest_breakpoints(*table, error, **options) if error > 0 else None
        if solution is None:
            rows = np.flatnonzero(options["candidates"])
            least = polyline_error(*table, options["at"], options["written"], rows)[0] + self.own_m3
            text = message(
                "export_not_within", "no rows keep {asked:.4g} L: all of them, rounded as the "
                "profile writes them, err by {least:.4g} L", asked=1000 * self.max_error_m3,
                least=1000 * least,
            )  # fmt: skip
            self.tell(text, "--max-error-l")
        return solution

    def _tell_no_spline(self):
        self.tell(message("export_no_spline", "no spline of so many points rises everywhere; "
                          "expected more points"), "table.interpolation")  # fmt: skip

    def _steps(self, marks):
        """Rows at every step, and the highest row."""
        step, height = self.profile.step_m, self.height
        if (height[-1] - height[0]) / step > MOST_POINTS:
            text = message("export_many_steps", "a step of {step:.6g} m; expected a larger one",
                           step=step)  # fmt: skip
            self.tell(text, "table.step_m")
            return np.array([0, len(height) - 1])
        numbers = np.round(height / step)
        is_on = np.abs(height - numbers * step) <= _ON_STEP * step
        wanted = np.arange(np.ceil(height[0] / step - _ON_STEP), height[-1] / step + _ON_STEP)
        missing = np.setdiff1d(wanted, numbers[is_on])
        if len(missing):
            text = message("export_no_row", "the table has no row at {at:.6g} m ({count} are "
                           "missing); expected one at every {step:.6g} m", at=missing[0] * step,
                           count=len(missing), step=step)  # fmt: skip
            self.tell(text, "table.step_m")
        is_on[[0, -1]] = True
        return np.flatnonzero(is_on & marks.stands)

    def refuse_limits(self, marks, rows):
        """Report rows, digits or volumes beyond the limits of the profile's system."""
        profile, count = self.profile, len(rows)
        fewest, most = profile.min_points or 1, profile.max_points or MOST_POINTS
        if not fewest <= count <= most:
            text = message("export_limit_points", "{count} rows; the system takes {fewest} to "
                           "{most}", count=count, fewest=fewest, most=most)  # fmt: skip
            self.tell(text, "table.max_points" if count > most else "table.min_points")
        largest = max(abs(marks.volume[row]) for row in rows)
        shown = f"{largest / 10**profile.volume_decimals:.{profile.volume_decimals}f}"
        if profile.digits is not None and largest >= 10**profile.digits:
            text = message("export_limit_digits", "the volume {volume} {unit} has more than the "
                           "{digits} digits that the system takes", volume=shown,
                           unit=profile.volume_unit, digits=profile.digits)  # fmt: skip
            self.tell(text, "volumes.digits")
        if profile.largest is not None and largest > profile.largest * 10**profile.volume_decimals:
            text = message("export_limit_volume", "the volume {volume} {unit} is above the largest"
                           " that the system takes, {largest:.9g}", volume=shown,
                           unit=profile.volume_unit, largest=profile.largest)  # fmt: skip
            self.tell(text, "volumes.largest")


def _less_shifted_top(marks, rows, height):
    """Return the rows without the highest one if only this row is off the marks.

    At the next mark, its volume would belong to another dip.
    """
    is_off = np.abs(marks.at_m[rows] - height[rows]) > ON_THE_MARK_M
    return rows[:-1] if len(rows) > 2 and is_off[-1] and not is_off[:-1].any() else rows
