"""Rows of a record for an export by its profile, their text, and the text read back by the linter.

If a profile does not fit a table, the reasons are reported. A profile writes whole numbers of
quanta; each number is rounded once.
"""

import tempfile
import unicodedata
from dataclasses import dataclass
from fractions import Fraction
from math import floor
from pathlib import Path

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.products.exports.breakpoints import (
    best_breakpoints,
    fewest_breakpoints,
    fewest_spline_breakpoints,
    polyline_error,
    spline_breakpoints,
    spline_error,
)
from tankcal.products.exports.profiles import (
    INCREMENTS_M,
    LEVEL_UNITS_M,
    LINE_ENDS,
    MARKED,
    MOST_POINTS,
)
from tankcal.products.linter.grids import read_grids
from tankcal.products.linter.layout import find_tables
from tankcal.products.linter.linting import lint
from tankcal.tank.dips import dip_label

_READ_AS = {"dip": "height", "ullage": "ullage", "increments": "height"}
_UNITS_READ = {
    unit: unit for unit in ("m", "cm", "mm", "in", "ft", "m3", "L", "bbl", "hL", "ft3")
} | {"gal": "US gal"}  # names of units known to the linter
_FEW = 3  # fewest rows required by the linter
_BY_NEIGHBOURS = ("lint_odd_volume", "lint_shifted", "lint_volumes_swapped", "lint_rough")
_OF_UNITS = ("lint_no_units",)  # finding about a heading without a unit
_MOST_TOLD = 5  # largest number of findings listed
_ON_STEP = 1e-6  # tolerance relative to a step
ZERO_M = 1e-9
_MOST_OF_SPLINE = 200  # largest number of points tried for an error
ON_THE_MARK_M = 1e-8
_MOSTLY = 0.5  # share of rows on marks of the profile above which only these are permitted


def make_body(rows, height_m, marks, profile, reference_m):
    """Return the rows of the file as lists of cells, in its order."""
    lines, before = [], 0
    for row in rows:
        cells = []
        for column in profile.columns:
            if column == "volume":
                cells.append(_volume(marks.volume[row], profile))
            elif column == "increment_volume":
                cells.append(_volume(marks.volume[row] - before, profile))
            else:
                cells.append(_level(column, row, height_m, marks, profile, reference_m))
        before = marks.volume[row]
        lines.append(cells)
    return lines[::-1] if profile.order == "descending" else lines


def _level(column, row, height_m, marks, profile, reference_m):
    """Cell of a level; the leading column as rounded, other columns rounded independently."""
    number = marks.level[row]
    if column == "increments":
        if column != profile.leading:
            number = count_increments(height_m[row] - profile.level_offset_m, profile.increment)
        return str(number)
    if profile.level_unit in MARKED:
        if column != profile.leading:
            number = to_quanta(reference_m - height_m[row], MARKED[profile.level_unit])
        return dip_label(float(number * MARKED[profile.level_unit]), profile.level_unit)
    if column != profile.leading:
        level = reference_m - height_m[row] if column == "ullage" else height_m[row]
        quantum = LEVEL_UNITS_M[profile.level_unit] / 10**profile.level_decimals
        number = to_quanta(level - profile.level_offset_m, quantum)
    return format_quanta(number, profile.level_decimals, profile.decimal)


def _volume(number, profile):
    return format_quanta(number, profile.volume_decimals, profile.decimal, profile.thousands)


def format_quanta(number, decimals, mark=".", thousands=""):
    """Text of a whole number of last digits.

    Examples
    --------
    >>> format_quanta(-1234567, 3, ",", "."), format_quanta(5, 2), format_quanta(12, 0)
    ('-1.234,567', '0.05', '12')
    """
    whole, part = divmod(abs(number), 10**decimals)
    text = f"{whole:,}".replace(",", thousands)
    sign = "-" if number < 0 else ""
    return f"{sign}{text}{mark}{part:0{decimals}d}" if decimals else f"{sign}{text}"


def file_text(body, profile, facts, values):
    """Return the text of the file: header, provenance, headings, rows.

    Parameters
    ----------
    body : list of list of str
        Rows of the file.
    profile : Profile
    facts : sequence of str
        Lines of provenance.
    values : dict
        {placeholder: text} of the header.
    """
    head = [line.format(**values) for line in profile.header]
    if profile.provenance:
        head += [f"{profile.comment} {fact}".strip() for fact in facts]
    if profile.headings:
        head.append(profile.separator.join(profile.headings))
    end = LINE_ENDS[profile.line_end]
    lines = [to_encodable(line, profile.encoding) for line in head]
    lines += [profile.separator.join(cells) for cells in body]
    return "".join(f"{line}{end}" for line in lines)


def to_encodable(text, encoding):
    """Return a text without characters missing in an encoding: accents removed, others left out."""
    kept = []
    for char in text:
        try:
            char.encode(encoding)
            kept.append(char)
        except UnicodeEncodeError:
            decomposed = unicodedata.normalize("NFKD", char)
            kept.append(decomposed.encode(encoding, "ignore").decode(encoding))
    return "".join(kept)


def read_back(data, body, profile, is_even=False, rounded=0):
    """Read the bytes of the file again.

    Raise InputError if the linter reports problems of its rows.

    The linter reads the rows as written under headings that it knows; the headings of the system
    are not examined. Increments of volume are summed before the examination.

    Parameters
    ----------
    data : bytes
    body : list of list of str
        Rows of the file.
    profile : Profile
    is_even : bool, optional
        Whether the rows are those of the table itself, unrounded; then no row may be missing.
    rounded : int, optional
        Number of rounded levels.
    """
    lines = data.decode(profile.encoding).split(LINE_ENDS[profile.line_end])[:-1]
    rows = lines[len(lines) - len(body) :]
    log = Log()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "export.csv")
        path.write_text(
            "\n".join([_headings(profile), *_sum_increments(rows, profile)]) + "\n", "utf-8"
        )
        grids = read_grids(path, log)
        log.stop_if_problems()
        tables = [table for grid in grids for table in find_tables(grid, log)]
        report = lint(path, even_steps=is_even)
    entries = max((table.entries for table in tables), key=len, default=())
    _refuse_other_rows(entries, body, profile)
    findings = [
        finding
        for finding in report.findings
        if not _is_caused_by_profile(finding, len(body), profile)
        and not _concerns_tank(finding, is_even)
    ]
    if findings:
        shown = [_make_problem(finding, profile) for finding in findings[:_MOST_TOLD]]
        raise InputError([*_rounding_hint(rounded, profile), *shown])


def _rounding_hint(count, profile):
    """Likely reason for rows that do not fit: rounded levels."""
    if not count:
        return []
    text = message("export_off_mark", "{count} levels had to be rounded, for the rows of the table "
                   "are on no marks of this profile; expected a table in its unit (table."
                   "height_unit of the job)", count=count)  # fmt: skip
    return [Problem(f"{profile.code}.toml", text, None, "levels.unit")]


def _headings(profile):
    """Headings, known to the linter, of the columns of the file."""
    known, is_led = [], False
    only_increments = "volume" not in profile.columns
    for column in profile.columns:
        if column in _READ_AS:
            unit = profile.increment if column == "increments" else profile.level_unit
            unit = f"_{_UNITS_READ[unit]}" if unit in _UNITS_READ else ""
            known.append("difference" if is_led else f"{_READ_AS[column]}{unit}")
            is_led = True
        elif column == "volume" or only_increments:
            unit = _UNITS_READ.get(profile.volume_unit)
            unit = "" if unit is None else f"_{unit}"
            known.append(f"volume{unit}")
        else:
            known.append("difference")
    return profile.separator.join(known)


def _sum_increments(rows, profile):
    """Rows as the linter reads them, with increments of volume summed."""
    if "volume" in profile.columns:
        return rows
    place = profile.columns.index("increment_volume")
    table = [row.split(profile.separator) for row in rows]
    total, order = 0, table[::-1] if profile.order == "descending" else table
    for cells in order:
        total += _number(cells[place], profile)
        cells[place] = format_quanta(total, profile.volume_decimals, profile.decimal)
    return [profile.separator.join(cells) for cells in table]


def _number(text, profile):
    """A written volume as a whole number of its last digits."""
    digits = text.replace(profile.thousands, "") if profile.thousands else text
    return int(digits.replace(profile.decimal, "") if profile.volume_decimals else digits)


def _refuse_other_rows(entries, body, profile):
    """Raise InputError unless the linter read equal numbers, row by row."""
    level = profile.columns.index(profile.leading)
    same = len(entries) == len(body)
    if "volume" in profile.columns:
        volume = profile.columns.index("volume")
        same = same and all(
            entry.volume.value == _number(cells[volume], profile) / 10**profile.volume_decimals
            for entry, cells in zip(entries, body, strict=False)
        )
    if profile.level_unit not in MARKED or profile.leading == "increments":
        same = same and all(
            entry.height.value == float(cells[level].replace(profile.decimal, "."))
            for entry, cells in zip(entries, body, strict=False)
        )
    if not same:
        text = message(
            "export_not_read_back", "the file does not read back as it was written; {rows} rows of "
            "{expected}: other marks between digits or columns may be needed",
            rows=len(entries), expected=len(body),
        )  # fmt: skip
        raise InputError(Problem(f"{profile.code}.toml", text))


def _is_caused_by_profile(finding, rows, profile):
    """Whether a finding is a consequence of the profile: thousands separators, two rows, a unit."""
    code = getattr(finding.problem.expected, "code", None)
    return (
        (code == "lint_written_in_all" and bool(profile.thousands))
        or (code == "lint_few_rows" and rows < _FEW)
        or (code in _OF_UNITS and not _are_units_known(profile))
    )


def _concerns_tank(finding, is_even):
    """Whether a finding concerns the tank, not the file: proportions, edges of fittings, kinks.

    Breakpoints are not a smooth table, so neighbours do not predict their volumes. The number read
    is that of the table all the same.
    """
    code = getattr(finding.problem.expected, "code", None)
    is_warning = finding.severity == "warning"
    return code == "lint_proportions" or (code in _BY_NEIGHBOURS and (is_warning or not is_even))


def _are_units_known(profile):
    """Whether the linter knows the units of both columns.

    It knows neither cubic feet nor 1/16 in.
    """
    level = profile.increment if profile.leading == "increments" else profile.level_unit
    return profile.volume_unit in _UNITS_READ and (level in _UNITS_READ or level in MARKED)


def _make_problem(finding, profile):
    problem = finding.problem
    text = message("export_finding", "the linter finds in the export: {finding}",
                   finding=problem.expected)  # fmt: skip
    return Problem(f"{profile.code}.toml", text, problem.row and problem.row - 1)


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
        self.fraction_rows = ()
        if profile.grid == "fractions":
            self._insert_fractions()
        self.has_zero = abs(self.height[0]) <= ZERO_M
        self.is_zero_left_out = self.has_zero and profile.zero_row == "forbidden"

    def _insert_fractions(self):
        """Add a row at each equal part of the highest dip, on the straight line between its rows.

        The error of straight lines between the rows of the table covers the added rows.
        """
        top, parts = self.height[-1], int(self.profile.parts)
        wanted = top * np.arange(1, parts + 1) / parts
        wanted = wanted[wanted >= self.height[0]]
        height = np.union1d(self.height, wanted)
        self.volume = np.interp(height, self.height, self.volume)
        self.height, self.fraction_rows = height, tuple(np.searchsorted(height, wanted).tolist())

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
        required = self._find_required_rows()
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

    def _find_required_rows(self):
        """Required rows: the ends, and rows about the critical zone of a roof."""
        required = {0, len(self.height) - 1, *self.fraction_rows}
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
            elif grid == "fractions":
                rows, table_rows = np.array(required), slice(None)
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
        if self.profile.grid == "fractions":
            text = message("export_fixed", "the system has fixed levels; leave out --points and "
                           "--max-error-l")  # fmt: skip
            return self.report(text, "table.grid")
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
