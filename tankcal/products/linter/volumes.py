"""Checks of the volumes of a table, row by row and as a whole."""

from dataclasses import dataclass
from itertools import groupby, pairwise, product
from math import log10, pi, sqrt

import numpy as np

from tankcal.messages import message
from tankcal.products.linter.examination import examine
from tankcal.products.linter.heights import FEWEST_ROWS
from tankcal.products.linter.numbers import BLANK

_USUAL_HEIGHT_UNITS_M, _USUAL_VOLUME_UNITS_M3 = [1.0, 0.01, 0.001], [1.0, 0.001]
_LEAST_VOLUME = 1e-9  # avoids division by zero for an empty table
_LOWEST_M, _HIGHEST_M = 0.5, 40.0  # range of usual tank heights
_SLIMMEST, _FLATTEST = 1 / 20, 30  # range of usual ratios of diameter to height
_CLOSE_DIAMETER, _CLOSE_VOLUME, _FAR = 0.02, 0.05, 0.2  # relative differences from nominal
_LEAST_GAP_M, _USUAL_GAP_M = 0.005, 0.02  # distance of the last row from the nominal height


@dataclass(frozen=True)
class Nominal:
    """Nominal volume, diameter and shell height of the tank; None: unknown.

    Attributes
    ----------
    volume_m3, diameter_m, height_m : float or None
    """

    volume_m3: float | None = None
    diameter_m: float | None = None
    height_m: float | None = None


NO_NOMINAL = Nominal()


@dataclass(frozen=True)
class Units:
    """Sizes of the units of a table, m and m3; None if unknown."""

    height_m: float | None
    volume_m3: float | None


NO_UNITS = Units(None, None)


def choose_units(table, volumes, log):
    """Return the `Units` from the headings, or those that give a tank of usual proportions."""
    pairs = _possible_units(table)
    if table.volume_choices:  # volumes do not distinguish gallons
        pairs = [pair for pair in pairs if pair.volume_m3 == table.volume_choices[0]]
        note = message(
            "lint_gallons",
            "gallons of no country: taken as US gallons (3.7854 L); imperial gallons (4.54609 L) "
            "give volumes 20 % larger; expected US gal or imp gal in the heading",
        )
        log.warning(table.name, note)
    units = min(pairs, key=lambda pair: _implausibility(volumes, pair))
    if len(pairs) > 1:
        text = message(
            "lint_no_units",
            "no unit in a heading: taken as heights in {height:g} m, volumes in {volume:g} m3",
            height=units.height_m,
            volume=units.volume_m3,
        )
        log.warning(table.name, text)
    return units


def likely_units(table, volumes):
    """Return the `Units` permitted by the headings that give a tank of usual proportions."""
    return [units for units in _possible_units(table) if _is_usual(volumes, units)]


def _possible_units(table):
    """Units that the headings permit."""
    heights, sizes = _USUAL_HEIGHT_UNITS_M, _USUAL_VOLUME_UNITS_M3
    if table.height_unit_m is not None:
        heights = [table.height_unit_m]
    if table.volume_choices:
        sizes = list(table.volume_choices)
    if table.volume_unit_m3 is not None:
        sizes = [table.volume_unit_m3]
    return [Units(*pair) for pair in product(heights, sizes)]


def _implausibility(volumes, units):
    """Measure of how unusual the proportions of a tank are; 0 for a usual tank."""
    height_m, ratio = _proportions(volumes, units)
    too_small, too_high = log10(_LOWEST_M / height_m), log10(height_m / _HIGHEST_M)
    return abs(log10(ratio)) + max(too_small, too_high, 0.0)


def _is_usual(volumes, units):
    """Whether the units give a tank of usual proportions."""
    height_m, ratio = _proportions(volumes, units)
    return _LOWEST_M <= height_m <= _HIGHEST_M and _SLIMMEST < ratio < _FLATTEST


def _proportions(volumes, units):
    """(height in m, diameter over height) of a table in given units."""
    height_m = float(volumes.height[-1] - volumes.height[0]) * units.height_m
    total = max(float(volumes.volume[-1]), _LEAST_VOLUME) * units.volume_m3
    return height_m, _slenderness(height_m, total)


def _slenderness(height_m, volume_m3):
    """Diameter over height of the upright cylinder with a given height and volume."""
    return sqrt(4 * volume_m3 / (pi * height_m)) / height_m


def check_totals(table, volumes, units, step, nominal, log):
    """Report disagreement with the nominal tank, or with any plausible tank."""
    height_m = float(abs(volumes.height[-1] - volumes.height[0])) * units.height_m
    total_m3 = float(volumes.volume[-1]) * units.volume_m3
    if total_m3 <= 0:
        expected = message(
            "lint_no_capacity",
            "the last volume is {volume:g}; expected the capacity of the tank",
            volume=volumes.volume[-1],
        )
        log.problem(table.name, expected)
        return
    has_nominal = nominal.volume_m3 is not None or nominal.diameter_m is not None
    if not has_nominal:
        _check_proportions(table, height_m, total_m3, log)
    if nominal.volume_m3 is not None:
        _check_total(table, total_m3, nominal.volume_m3, _CLOSE_VOLUME, log)
    if nominal.diameter_m is not None:
        expected = pi / 4 * nominal.diameter_m**2 * nominal.height_m
        _check_total(table, total_m3, expected, _CLOSE_DIAMETER, log)
    if nominal.height_m is not None:
        _check_top(table, volumes, units, step, nominal.height_m, log)


def _check_proportions(table, height_m, total_m3, log):
    """Warn about unusual proportions of the tank."""
    ratio = _slenderness(height_m, total_m3)
    if not _SLIMMEST < ratio < _FLATTEST:
        text = message(
            "lint_proportions",
            "{total:.6g} m3 in {height:.6g} m of height is a cylinder of {diameter:.4g} m "
            "diameter; expected the proportions of a tank: are the units right?",
            total=total_m3,
            height=height_m,
            diameter=ratio * height_m,
        )
        log.warning(table.name, text)


def _check_total(table, total_m3, expected_m3, close, log):
    """Report a total that differs from the nominal volume."""
    ratio = total_m3 / expected_m3
    if abs(ratio - 1) <= close:
        return
    power, hint = round(log10(ratio)), ""
    if power and abs(ratio / 10.0**power - 1) <= _FAR:
        hint = _hint_of_factor(power)
    text = message(
        "lint_total",
        "total {total:.6g} m3, expected about {nominal:.6g} m3 (nominal){hint}",
        total=total_m3,
        nominal=expected_m3,
        hint=hint,
    )
    report = log.warning if abs(ratio - 1) <= _FAR else log.problem
    report(table.name, text)


def _hint_of_factor(power):
    """Text that a power of ten is the likely cause of a difference."""
    factor = 10 ** abs(power)
    if power > 0:
        return message(
            "lint_times_larger",
            ": {factor} times larger; are the units, or thousands marks, right?",
            factor=factor,
        )
    return message(
        "lint_times_smaller",
        ": {factor} times smaller; are the units, or thousands marks, right?",
        factor=factor,
    )


def _check_top(table, volumes, units, step, nominal_m, log):
    """Report a last row that differs from the nominal height."""
    low, high = sorted(abs(float(h)) * units.height_m for h in volumes.height[[0, -1]])
    top_m = high if not table.is_ullage else high - low
    gap = nominal_m - top_m
    expected_gap = min(step * units.height_m * (1 - 1e-6), _USUAL_GAP_M)
    if abs(gap) < max(expected_gap, _LEAST_GAP_M):
        return
    hint = ""
    if gap > 0:
        hint = message("lint_last_rows", ": are the last rows missing?")
    text = message(
        "lint_top",
        "the table ends at {top:.6g} m, nominal height {nominal:.6g} m{hint}",
        top=top_m,
        nominal=nominal_m,
        hint=hint,
    )
    is_small = abs(gap) <= max(5 * step * units.height_m, _CLOSE_DIAMETER * nominal_m)
    report = log.warning if is_small else log.problem
    report(table.name, text)


_USUAL = 0.98  # share of the rows with at most the usual number of decimals
_FINEST = 1e-9  # smallest rounding relative to the total
_MOST_WRITTEN = 6  # largest number of decimals that people write
_LONG_BLANK = 10  # fewest rows of an intended blank
_FITTING, _EDGE = 0.5, 0.01  # largest effect of a fitting, relative to the volume of a step


@dataclass(frozen=True)
class Volumes:
    """Volumes of a table.

    Attributes
    ----------
    height, volume : ndarray, shape (n,)
        Readable rows, heights rising, in the units of the table.
    decimals : int
        Usual number of decimals.
    joints : sequence
        Heights at which the area of the cross section jumps.
    """

    height: np.ndarray
    volume: np.ndarray
    decimals: int
    joints: tuple[float, ...]


def check_volumes(table, series, log):
    """Return the `Volumes` of a series after reporting their problems to `log`; None if too few."""
    blank_rows = _find_long_blanks(table, series.entries, log)
    good = [
        k
        for k, entry in enumerate(series.entries)
        if k not in blank_rows and _is_readable(table, entry, log)
    ]
    if len(good) < FEWEST_ROWS:
        if not log.problems:  # only long blanks; an unreadable cell is a problem
            expected = message(
                "lint_few_volumes",
                "{count} rows with a volume; expected {fewest} or more",
                count=len(good),
                fewest=FEWEST_ROWS,
            )
            log.problem(table.name, expected)
        return None
    entries = [series.entries[k] for k in good]
    _check_marks(table, entries, log)
    height = series.height[good]
    volume = np.array([entry.volume.value for entry in entries])
    decimals = _check_rounding(table, entries, log)
    quantum = max(10.0**-decimals, _FINEST * float(np.abs(volume).max()), 1e-300)
    rounding = series.rounding[good] / series.step
    examined = examine(height / series.step, volume / quantum, rounding)
    reporter = _VolumeReporter(table, entries, volume, quantum, decimals, examined.joints, log)
    for fault in examined.faults:
        reporter.report(fault)
    _check_falls(reporter, examined.volume * quantum)
    if not examined.complete:
        log.warning(
            table.name,
            message("lint_rough", "the volumes are too rough for every row to be examined"),
        )
    joints = tuple(float(height[row]) for row in examined.joints)
    return Volumes(height, volume, decimals, joints)


def _find_long_blanks(table, entries, log):
    """Rows of long, intended blanks, such as a critical zone of a roof that is not for use."""
    blank_rows = set()
    for is_blank, run in groupby(
        range(len(entries)), lambda k: entries[k].volume.complaint == BLANK
    ):
        rows = list(run)
        if is_blank and len(rows) >= _LONG_BLANK:
            first, last = entries[rows[0]], entries[rows[-1]]
            text = message(
                "lint_no_volumes",
                "no volumes from here to row {last_row}: are these heights out of use?",
                last_row=last.row,
            )
            log.warning(table.name, text, first.row, first.volume_column)
            blank_rows.update(rows)
    return blank_rows


def _is_readable(table, entry, log):
    """Whether an entry has a volume; unreadable and negative volumes are reported."""
    reading = entry.volume
    if reading.value is None:
        if reading.complaint:
            log.problem(table.name, reading.complaint, entry.row, entry.volume_column)
        return False
    if reading.value < 0:
        expected = message(
            "lint_negative", "found {found}; expected a volume of 0 or more", found=reading.text
        )
        log.problem(table.name, expected, entry.row, entry.volume_column)
    return True


def _check_marks(table, entries, log):
    """Report thousands separators, and texts that look like numbers in a workbook."""
    for having, description in (
        (
            [e for e in entries if e.volume.marks],
            message("lint_thousands_mark", "a thousands mark"),
        ),
        (
            [e for e in entries if e.volume.is_typed and not table.is_text],
            message("lint_a_text", "a text, not a number"),
        ),
    ):
        if len(having) > 0.5 * sum(e.volume.value >= 1000 for e in entries):
            text = message(
                "lint_written_in_all",
                "{what} in {count} volumes; expected numbers that any program can read",
                what=description,
                count=len(having),
            )
            log.warning(table.name, text, having[0].row, having[0].volume_column)
        else:
            for entry in having:
                text = message(
                    "lint_written_so",
                    "found {what}; expected {expected}, as the other rows are written",
                    what=description,
                    expected=entry.volume.text,
                )
                log.problem(table.name, text, entry.row, entry.volume_column)


def _check_rounding(table, entries, log):
    """Return the usual number of decimals; report rows with more or fewer."""
    decimals = sorted(entry.volume.decimals for entry in entries)
    usual = decimals[int(_USUAL * (len(decimals) - 1))]
    if usual > _MOST_WRITTEN:
        return usual
    typed = [entry for entry in entries if entry.volume.is_typed]
    keeps_zeros = any(
        entry.volume.decimals == usual and entry.volume.text.endswith("0")
        for entry in typed
        if usual and entry.volume.value
    )
    short = [e for e in typed if e.volume.decimals < usual and e.volume.value]
    if keeps_zeros and len(short) <= max(1, len(entries) // 100):
        for entry in short:
            is_last = entry is entries[-1]
            report = log.problem if is_last else log.warning
            text = _other_decimals(entry, usual)
            if is_last:
                text = message("lint_cut", "{text}: is the last row cut?", text=text)
            report(table.name, text, entry.row, entry.volume_column)
    for entry in entries:
        if entry.volume.decimals > usual:
            text = _other_decimals(entry, usual)
            log.warning(table.name, text, entry.row, entry.volume_column)
    return usual


def _other_decimals(entry, usual):
    """Message about an unusual number of decimals."""
    return message(
        "lint_decimals",
        "found {found}; expected {usual} decimals as in the other rows",
        found=entry.volume.text,
        usual=usual,
    )


def _check_falls(reporter, corrected):
    """Report falling volumes that no other fault explains."""
    valid_rows = np.flatnonzero(np.isfinite(corrected))
    for before, row in pairwise(valid_rows):
        if corrected[row] < corrected[before] - 0.5 * reporter.quantum:
            text = message(
                "lint_falls",
                "found {found} after {before}; expected volumes that do not fall",
                found=reporter.text(row),
                before=reporter.text(before),
            )
            reporter.problem(row, text)


class _VolumeReporter:
    """Reports faults of volumes with the texts and rows of the file."""

    def __init__(self, table, entries, volume, quantum, decimals, joints, log):
        self.table, self.entries, self.volume, self.log = table, entries, volume, log
        self.quantum, self.decimals, self.joints = quantum, decimals, joints

    def text(self, k):
        """Text of a volume in the file."""
        return self.entries[k].volume.text

    def number(self, value):
        """Text of a volume with the usual decimals."""
        return f"{value:.{min(self.decimals, _MOST_WRITTEN)}f}"

    def problem(self, k, text, is_error=True):
        """Report an error or a warning about a volume."""
        entry = self.entries[k]
        report = self.log.problem if is_error else self.log.warning
        report(self.table.name, text, entry.row, entry.volume_column)

    def report(self, fault):
        """Report a fault of an examination."""
        first, last = (self.entries[k].row for k in (fault.first, fault.last))
        if fault.kind == "swap":
            self.problem(
                fault.first,
                message(
                    "lint_volumes_swapped",
                    "found {found}; volumes of rows {row} and {other_row} are swapped",
                    found=self.text(fault.first),
                    row=first,
                    other_row=last,
                ),
            )
        elif fault.kind == "row":
            self._report_row(fault)
        else:
            self._report_shift(fault, first, last)

    def _report_row(self, fault):
        """Report a wrong volume, with the likely intended number."""
        expected = self.volume[fault.first] - fault.size * self.quantum
        tolerance = max(3.0, 0.02 * abs(fault.size)) * self.quantum
        slip = suggest_number(self.text(fault.first), expected, tolerance, self.decimals)
        hint = (
            ""
            if not slip
            else message("lint_slip", ": {number}? ({slip})", number=slip[0], slip=slip[1])
        )
        is_beside_joint = fault.first in self.joints or fault.first + 1 in self.joints
        is_fitting = is_beside_joint and abs(fault.size) * self.quantum <= _EDGE * self._step(fault)
        text = message(
            "lint_odd_volume",
            "found {found}; expected about {expected}{hint}{fitting}",
            found=self.text(fault.first),
            expected=self.number(expected),
            hint=hint,
            fitting=_or_fitting(is_fitting),
        )
        self.problem(fault.first, text, not is_fitting)

    def _report_shift(self, fault, first, last):
        """Report volumes with a common error."""
        is_open = fault.kind == "shift"
        rows = message("lint_rows", "rows {row} to {last_row}", row=first, last_row=last)
        if is_open:
            rows = message("lint_from_row", "from row {row} on", row=first)
        is_fitting = is_open and fault.first > 0 and self._may_be_fitting(fault)
        text = message(
            "lint_shifted",
            "found {found}; volumes are {amount} for the rows around, {rows}{fitting}",
            found=self.text(fault.first),
            amount=_amount(self.number(abs(fault.size) * self.quantum), fault.size),
            rows=rows,
            fitting=_or_fitting(is_fitting),
        )
        self.problem(fault.first, text, not is_fitting)

    def _may_be_fitting(self, fault):
        """Whether a fitting may remove or add that volume within one step."""
        size, step = fault.size * self.quantum, self._step(fault)
        return -_FITTING * step <= size <= _EDGE * step

    def _step(self, fault):
        """Volume of the step before a fault, without the fault."""
        before = self.volume[fault.first - 1] if fault.first else 0.0
        return self.volume[fault.first] - fault.size * self.quantum - before


def _amount(number, size):
    """Text of an error of volumes."""
    if size > 0:
        return message("lint_too_large", "{number} too large", number=number)
    return message("lint_too_small", "{number} too small", number=number)


def _or_fitting(is_fitting):
    """Text that a fitting is possible, or ""."""
    return message("lint_fitting", ", or the edge of a fitting") if is_fitting else ""


# ---- likely intended numbers


def suggest_number(text, expected, tolerance, decimals):
    """Return the likely intended number as text and the kind of slip, or None.

    Parameters
    ----------
    text : str
        As written, with a decimal point and without thousands separators.
    expected : float
        Value from the neighbouring rows.
    tolerance : float
        Tolerance of the expected value.
    decimals : int
        Number of decimals of the other rows.

    Notes
    -----
    The nearest number with one wrong digit takes precedence. Then follow two digits swapped, a
    decimal mark moved, a digit missing, a digit too many.
    """
    for slip, candidates in (
        (message("slip_one_digit", "one digit"), _change_digit(text)),
        (message("slip_transposed", "two digits changed places"), _swap_digits(text)),
        (message("slip_decimal_mark", "the decimal mark"), _move_mark(text, decimals)),
        (message("slip_digit_missing", "a digit is missing"), _insert_digit(text)),
        (message("slip_digit_too_many", "a digit too many"), _remove_digit(text)),
    ):
        good = [
            (abs(float(candidate) - expected), candidate)
            for candidate in candidates
            if candidate != text
            and _is_natural(candidate, decimals)
            and abs(float(candidate) - expected) <= tolerance
        ]
        if good:
            return min(good)[1], slip
    return None


def _is_natural(text, decimals):
    """Whether a number looks natural: no needless leading zero, no more decimals than usual."""
    whole, _, part = text.partition(".")
    return not (whole[:1] == "0" and len(whole) > 1) and len(part) <= decimals


def _change_digit(text):
    """Numbers with one digit changed."""
    return [
        text[:k] + digit + text[k + 1 :]
        for k, char in enumerate(text)
        if char.isdigit()
        for digit in "0123456789"
    ]


def _swap_digits(text):
    """Numbers with two neighbouring digits swapped."""
    places = [k for k, char in enumerate(text) if char.isdigit()]
    numbers = []
    for a, b in pairwise(places):
        chars = list(text)
        chars[a], chars[b] = chars[b], chars[a]
        numbers.append("".join(chars))
    return numbers


def _move_mark(text, decimals):
    """Numbers with the decimal mark moved."""
    value = float(text)
    return [f"{value * 10.0**power:.{decimals}f}" for power in (-6, -3, -2, -1, 1, 2, 3, 6)]


def _insert_digit(text):
    """Numbers with one digit more."""
    return [
        text[:k] + digit + text[k:]
        for k in range(len(text) + 1)
        if k or text[:1].isdigit()
        for digit in "0123456789"
    ]


def _remove_digit(text):
    """Numbers with one digit less."""
    return [
        text[:k] + text[k + 1 :]
        for k, char in enumerate(text)
        if char.isdigit() and sum(c.isdigit() for c in text) > 1
    ]
