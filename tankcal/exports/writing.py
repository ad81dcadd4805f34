"""Text of an export by its profile, and the text read back by the linter."""

import tempfile
import unicodedata
from pathlib import Path

from tankcal.errors import InputError, Problem
from tankcal.exports.choosing import count_increments, to_quanta
from tankcal.exports.profiles import LEVEL_UNITS_M, LINE_ENDS, MARKED
from tankcal.job.tables import Log
from tankcal.linter import lint
from tankcal.linter.grids import read_grids
from tankcal.linter.layout import find_tables
from tankcal.messages import message
from tankcal.tank.dips import dip_label

_READ_AS = {"dip": "height", "ullage": "ullage", "increments": "height"}
_UNITS_READ = {
    unit: unit for unit in ("m", "cm", "mm", "in", "ft", "m3", "L", "bbl", "hL", "ft3")
} | {"gal": "US gal"}  # names of units known to the linter
_FEW = 3  # fewest rows required by the linter
_BY_NEIGHBOURS = ("lint_odd_volume", "lint_shifted", "lint_volumes_swapped", "lint_rough")
_OF_UNITS = ("lint_no_units",)  # finding about a heading without a unit
_MOST_TOLD = 5  # largest number of findings listed


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
