"""Files of a survey as used by its checks, and checks of the tables of readings."""

import math
import re
from dataclasses import dataclass, field

import numpy as np

from tankcal.errors import SHEET
from tankcal.job.checking import has_rows, refuse_repeated, tell_missing, temperature_missing
from tankcal.job.checks.survey.doubtful import refuse_packed
from tankcal.job.contract.observations import ANGLES, READINGS
from tankcal.job.contract.registers import KIND
from tankcal.job.entries import as_spelt
from tankcal.job.fields import ANGLE_UNITS, is_blank
from tankcal.job.tables import REGISTERS, nearest
from tankcal.messages import join_with_or, list_some, message

MAX_HINTS = 50  # largest number of suggestions; thousands of them would take minutes
KNOWN = (("control", "point"), ("check", "point"), ("targets", "point"), ("setups", "station"))


@dataclass(frozen=True)
class SurveyFiles:
    """Content of the files of a survey, and the log.

    Attributes
    ----------
    values : dict or None
        {section: {key: value}} of the settings; None: unreadable.
    tables : dict
        {name: ColumnValues; None: missing or unreadable}.
    registers : dict
        {"cameras" or "instruments": {name: {key: value}}}.
    raw : RawJob
        Job as read.
    log : Log
        Receives problems and warnings.
    reported : frozenset of (str, int)
        File and row of the rows with problems reported before.
    """

    values: dict | None
    tables: dict
    registers: dict
    raw: object
    log: object
    reported: frozenset = field(default_factory=frozenset)

    def is_unreadable(self, name):
        """Return True if the table or register exists but is not readable."""
        among = self.raw.registers if name in REGISTERS else self.raw.tables
        return name in among and among[name] is None

    def sound(self, table):
        """True for the rows of a table without a problem, shape (n,)."""
        return np.array([(table.file, row) not in self.reported for row in table.rows], dtype=bool)

    def is_given(self, register, owner, key):
        """Return True if a camera or an instrument has the key, with a valid or invalid value."""
        entries = self.raw.registers[register].entries[owner]
        value = entries.get(as_spelt(register, entries, key))
        return value is not None and not is_blank(value.raw)

    def tell_key(self, report, register, owner, key, expected):
        """Report on one key of a camera or an instrument.

        Parameters
        ----------
        report : callable
            log.problem or log.warning.
        register : str
            "cameras" or "instruments".
        owner, key : str
            Name of the camera or instrument, and key.
        expected : Message
            Text of the report.
        """
        entries_of_register = self.raw.registers[register]
        key = as_spelt(register, entries_of_register.entries[owner], key)
        value = entries_of_register.entries[owner].get(key)
        row = entries_of_register.rows[owner] if value is None else value.row
        report(entries_of_register.file, expected, row, f"{owner}.{key}")


def refuse_undefined(files, table, column, defined, where):
    """Report each name in a column that is not defined.

    A missing table of definitions is reported once. If one of its names is unreadable, nothing is
    reported, because the unreadable name may be the missing one.

    Parameters
    ----------
    files : SurveyFiles
        Files of the survey.
    table : ColumnValues
        Table with the names.
    column : str
        Column of the names.
    defined : collection of str or None
        Defined names; None for an unreadable name.
    where : str
        Table or register with the definitions.
    """
    its_table = files.tables.get(where)
    if files.is_unreadable(where) or None in defined or (its_table and its_table.skipped):
        return
    first, count = {}, {}
    for row, name in zip(table.rows, table.of(column), strict=True):
        if name is not None and name not in defined:
            first.setdefault(name, row)
            count[name] = count.get(name, 0) + 1
    file = files.raw.file_of(where)
    if first and not defined:
        tell_missing(files.log, file, table.file, column)
        return
    for number, (name, row) in enumerate(first.items()):
        hint = nearest(name, defined) if number < MAX_HINTS else ""
        more = (
            message("rows_name_it", "; {count} rows refer to it", count=count[name])
            if count[name] > 1
            else ""
        )
        expected = message(
            "name_undefined",
            "found {name!r}; expected a name defined in {file}{hint}{more}",
            name=name,
            file=file,
            hint=hint,
            more=more,
        )
        files.log.problem(table.file, expected, row, column)


def tell_rows(report, table, is_wrong, column, expected):
    """Report the rows where `is_wrong` (n,) is True.

    If several rows are concerned because the column is missing or blank, one message is sufficient.

    Parameters
    ----------
    report : callable
        log.problem or log.warning.
    table : ColumnValues
        Table with n rows.
    is_wrong : ndarray of bool, shape (n,)
        Rows to be reported.
    column : str
        Column of the fault.
    expected : Message
        Text of the report.
    """
    if np.count_nonzero(is_wrong) > 1 and table.columns.get(column) is None:
        summary = message("column_missing_or", "the column is missing or {what}", what=expected)
        report(table.file, summary, None, column)
        return
    for place in np.flatnonzero(is_wrong):
        report(table.file, expected, table.rows[place], column)


# ---- checks for one point in two spellings: P1, p1, P 1, P-1, P01


def _columns():
    """(table, column) of all names of observed points."""
    yield "image_points", "point"
    yield "stadia", "to"
    for name in READINGS:
        for column in ("at", "from", "to"):
            yield name, column


def observed_names(files):
    """{name: number of rows} of the observed points and of the stations."""
    counts = {}
    for name, column in (*_columns(), ("setups", "station")):
        table = files.tables[name]
        if has_rows(table) and column in table.columns:
            for point in table.of(column):
                counts[point] = counts.get(point, 0) + 1
    return counts


def all_points(files):
    """Names of all points of the survey, in the order of its files."""
    counts = observed_names(files)
    for name, column in KNOWN:
        if has_rows(files.tables[name]):
            counts |= dict.fromkeys(files.tables[name].of(column), 1)
    return [name for name in counts if name is not None]


def plain(name):
    """Common form of the spellings of one name: P1 for p1, P 1, P-1, P_01."""
    text = re.sub(r"[\s_.\-/#()]+", "-", name.casefold())
    text = re.sub(r"(?<=[^\W\d])-(?=\d)|(?<=\d)-(?=[^\W\d])", "", text)
    return re.sub(r"(?<!\d)0+(?=\d)", "", text).strip("-")


def check_names(files):
    """Report similar spellings; a spelling in a single row is a problem.

    A point in a single row cannot be determined; a point in several rows may be another point.
    """
    places = {}
    for name, column in (*KNOWN, *_columns()):
        table = files.tables[name]
        if has_rows(table) and column in table.columns:
            for row, point in zip(table.rows, table.of(column), strict=True):
                if point is not None:
                    entry = places.setdefault(point, [table.file, row, column, 0])
                    entry[3] += 1
    similar = {}
    for point in places:
        similar.setdefault(plain(point), []).append(point)
    for spellings in similar.values():
        if len(spellings) > 1:
            _tell(files, sorted(spellings, key=lambda point: -places[point][3]), places)


def _tell(files, spellings, places):
    most_frequent, *others = spellings
    for point in others:
        file, row, column, count = places[point]
        if count == 1:
            rows_of_other = places[most_frequent][3]
            expected = message(
                "spelt_once",
                "{point!r} is in 1 row, {other!r} in {rows} rows; expected one spelling of "
                "one point, or another name",
                point=point,
                other=most_frequent,
                rows=rows_of_other,
            )
            if rows_of_other == 1:
                expected = message(
                    "each_spelt_once",
                    "{point!r} is in 1 row, {other!r} in 1 row; expected one spelling of one "
                    "point, or another name",
                    point=point,
                    other=most_frequent,
                )
            files.log.problem(file, expected, row, column)
        else:
            expected = message(
                "two_spellings",
                "{point!r} is in {rows} rows, {other!r} in {rows_of_other} rows: is it one "
                "point in two spellings?",
                point=point,
                rows=count,
                other=most_frequent,
                rows_of_other=places[most_frequent][3],
            )
            files.log.warning(file, expected, row, column)


# correlated_readings.csv: unique pairs of two different existing values.

OF_AXES = ("control", "vectors")  # tables with x, y and z in a row


def check_correlated(files):
    """Require two different adjusted values in each row of correlated_readings.csv."""
    table = files.tables["correlated_readings"]
    if not has_rows(table):
        return
    first = {}
    columns = [table.of(f"{part}_{i}") for i in "12" for part in ("table", "row", "value")]
    for row, *cells in zip(table.rows, *columns, strict=True):
        ends = []
        for i, (name, number, axis) in enumerate((cells[:3], cells[3:]), start=1):
            if name is None or number is None:
                break  # reported already
            column, expected = _doubt_of_end(files.tables[name], name, number, axis)
            if column:
                files.log.problem(table.file, expected, row, f"{column}_{i}")
                break
            ends.append((name, int(number), axis))
        if len(ends) < 2:
            continue
        if ends[0] == ends[1]:
            expected = message(
                "correlated_with_itself",
                "a value is correlated with itself; expected two different values",
            )
            files.log.problem(table.file, expected, row, "row_2")
            continue
        first_row = first.setdefault(frozenset(ends), row)
        if first_row != row:
            expected = message(
                "correlated_twice",
                "this pair is already in row {before}; expected once",
                before=first_row,
            )
            files.log.problem(table.file, expected, row, "row_2")


def _doubt_of_end(referenced, name, at, axis):
    """Column ("row" or "value") and message of a fault at one end of a pair, or (None, None).

    Parameters
    ----------
    referenced : ColumnValues or None
        Table of the value; None: missing.
    name : str
        Name of the table.
    at : float
        Row.
    axis : str or None
        x, y or z.
    """
    if referenced is None or at not in referenced.rows:
        return "row", message(
            "correlated_no_such_row",
            "found {at:g}, and {table} has no such row; expected a row of that table, the heading"
            " being row 1",
            at=at,
            table=name,
        )
    place = list(referenced.rows).index(at)
    if "use" in referenced.columns and referenced.of("use")[place] == "check":
        return "row", message(
            "correlated_only_compared",
            "row {at:g} of {table} is only compared (use = check); expected one that is adjusted",
            at=at,
            table=name,
        )
    if name == "control" and axis is not None:
        return _doubt_of_control(referenced, place, axis)
    if (name in OF_AXES) == (axis is not None):
        return None, None
    if axis is None:
        return "value", message(
            "correlated_which_axis",
            "expected x, y or z, which of the three values of a row of {table} it is",
            table=name,
        )
    return "value", message(
        "correlated_one_value",
        "found {axis}; expected nothing: a row of {table} has one value",
        axis=axis,
        table=name,
    )


def _doubt_of_control(referenced, place, axis):
    """Column and message of a fault of a control coordinate, or (None, None).

    The coordinate must be an observation in the system of the survey.
    """
    if "system" in referenced.columns and referenced.of("system")[place] is not None:
        return "row", message(
            "correlated_other_system",
            "row {at:g} of control is in the system {system}; expected one in the system of the"
            " survey: coordinates of further systems have no correlations",
            at=referenced.rows[place],
            system=referenced.of("system")[place],
        )
    sd = (
        referenced.numbers(f"s{axis}_mm")[place]
        if f"s{axis}_mm" in referenced.columns
        else math.nan
    )
    if not sd > 0:
        return "value", message(
            "correlated_no_observation",
            "{axis} in row {at:g} of control has no standard deviation above 0; expected "
            "one: a coordinate that is held, or only approximate, has no correlations",
            axis=axis,
            at=referenced.rows[place],
        )
    return None, None


BY_CHANCE = 0.1  # share of rows that may be equal, because coarse readings repeat
MOST_REPEATED = 3  # largest number of rows named in a warning


def check_readings(files):
    """Check all tables of readings, one by one."""
    for name in READINGS:
        table = files.tables[name]
        if not has_rows(table):
            continue
        if name in ANGLES:
            check_angle(files, table, ANGLES[name])
        _refuse_same_ends(files, name, table)
        warn_copies(files, table)
    if has_rows(files.tables["directions"]):
        _warn_single_directions(files, files.tables["directions"])
    if has_rows(files.tables["image_points"]):
        warn_copies(files, files.tables["image_points"])


def check_angle(files, table, angle, *, is_needed=True):
    """Require an angle in exactly one unit in each row.

    Parameters
    ----------
    files : SurveyFiles
        Files of the survey.
    table : ColumnValues
        Table of readings.
    angle : str
        Name of the angle, such as "direction".
    is_needed : bool, optional
        False: the angle may be missing.
    """
    columns = [f"{angle}_{unit}" for unit in ANGLE_UNITS]
    expected_columns = join_with_or(columns)
    filled = [name for name, values in table.columns.items() if values is not None]
    headings = {
        *files.raw.tables[files_name(table)].headings,
        *filled,
    }  # renamed headings by their columns
    if not any(column in headings for column in columns):
        if not is_needed:
            return
        expected = message(
            "angle_column_missing", "missing column; expected {wanted}", wanted=expected_columns
        )
        files.log.problem(table.file, expected, None, columns[0])
        return
    is_valid = files.sound(table)
    count = sum(~np.isnan(table.numbers(column)) for column in columns)
    first = next(column for column in columns if column in headings)
    expected = message("angle_blank", "blank; expected {wanted}", wanted=expected_columns)
    tell_rows(files.log.problem, table, is_needed & is_valid & (count == 0), first, expected)
    twice = is_valid & (count > 1)
    expected = message(
        "angle_in_two_units", "in two units; expected one of {wanted}", wanted=expected_columns
    )
    tell_rows(files.log.problem, table, twice, first, expected)
    if f"{angle}_deg" in headings:
        refuse_packed(table, f"{angle}_deg", files.log)


def files_name(table):
    """Name of a table from the name of its file or sheet."""
    return table.file.removeprefix(SHEET).removesuffix(".csv")


def _refuse_same_ends(files, name, table):
    """Report readings between a point and itself."""
    ends = ["from", "to"]
    if name == "horizontal_angles":
        ends = ["at", "from", "to"]
    columns = [table.of(end) for end in ends if end in table.columns]
    if name in TAKEN_FROM_SETUPS:
        setups = files.tables["setups"]
        if setups is None:
            return
        stations = dict(zip(setups.of("setup"), setups.of("station"), strict=True))
        columns = [[stations.get(setup) for setup in table.of("setup")], table.of("to")]
    reading = name.replace("_", " ").rstrip("s")
    for row, points in zip(table.rows, zip(*columns, strict=True), strict=True):
        given = [point for point in points if point is not None]
        if len(set(given)) == len(given):
            continue
        twice = next(point for point in given if given.count(point) > 1)
        expected = message(
            "between_itself",
            "{kind} between {twice!r} and itself; expected different points",
            kind=reading,
            twice=twice,
        )
        if name in TAKEN_FROM_SETUPS:
            expected = message(
                "station_to_itself",
                "{kind} from station {twice!r} to itself; expected another point",
                kind=reading,
                twice=twice,
            )
        files.log.problem(table.file, expected, row, "to")


def warn_copies(files, table, *, are_sights=False):
    """Warn once about identical rows, if there are more than by chance.

    are_sights is True for sights to the wall, which are never equal by chance.
    """
    raw = files.raw.tables[files_name(table)]
    first, copies = {}, []
    for row, cells in zip(raw.row_numbers, raw.rows, strict=True):
        try:
            first_row = first.setdefault(cells, row)
        except TypeError:  # a cell that cannot be compared is reported already
            continue
        if first_row != row:
            copies.append((row, first_row))
    if len(copies) <= BY_CHANCE * len(raw.rows):
        return
    figures = {
        "count": len(copies),
        "pairs": list_some([f"{row} = {first_row}" for row, first_row in copies], MOST_REPEATED),
    }
    expected = (
        message(
            "pasted_rows",
            "{count} rows are the same as another one to the last digit (rows {pairs}): was a part"
            " of the file pasted twice?",
            **figures,
        )
        if are_sights
        else message(
            "copied_rows",
            "{count} rows are the same as another one to the last digit (rows {pairs}): were "
            "they copied? Each counts as a separate reading",
            **figures,
        )
    )
    files.log.warning(table.file, expected, copies[0][0])


def _warn_single_directions(files, table):
    """Warn about a single direction in a set, which determines the orientation only."""
    sets = {}
    rows = zip(
        table.rows, table.of("setup"), table.of("set"), table.of("to"), table.of("use"), strict=True
    )
    for row, setup, name, to, use in rows:
        if setup is not None and to is not None and use != "check":
            sets.setdefault((setup, name), {})[to] = row
    for (setup, name), rows_of_targets in sets.items():
        if len(rows_of_targets) == 1 and not table.skipped:
            set_name = setup
            if name is not None:
                set_name = message("set_of_setup", "{setup}, set {set}", setup=setup, set=name)
            expected = message(
                "single_direction",
                "set-up {where} has directions to one point only; they determine only its "
                "orientation",
                where=set_name,
            )
            files.log.warning(table.file, expected, next(iter(rows_of_targets.values())), "to")


# ---- instruments

DOUBTFUL_CORRECTION = 5e-4  # largest plausible scale correction
TAKEN_FROM_SETUPS = ("slope_distances", "directions", "zenith_angles")


def check_instruments(files):
    """Check instruments, unique set-ups, and references to them."""
    for name, given in files.registers["instruments"].items():
        _check_instrument(files, name, given)
    setups, instruments = files.tables["setups"], files.registers["instruments"]
    if setups is not None:
        refuse_repeated(setups, "setup", files.log)
        refuse_undefined(files, setups, "instrument", instruments, "instruments")
    defined = () if setups is None else dict.fromkeys(setups.of("setup"))
    for table in TAKEN_FROM_SETUPS:
        if has_rows(files.tables[table]):
            refuse_undefined(files, files.tables[table], "setup", defined, "setups")
    distances = files.tables["distances"]
    if has_rows(distances):
        refuse_undefined(files, distances, "instrument", instruments, "instruments")
        _check_temperatures(files, distances, instruments)


def check_correction(files, name, given):
    """Warn about an implausible scale correction, such as a percentage or millimetres."""
    correction = given["correction"]
    if correction is not None and abs(correction) > DOUBTFUL_CORRECTION:
        expected = message(
            "large_correction",
            "found {correction:g}, {ppm:.0f} ppm; expected a small ratio, such as 0.0001",
            correction=correction,
            ppm=1e6 * correction,
        )
        files.tell_key(files.log.warning, "instruments", name, "correction", expected)


def _check_instrument(files, name, given):
    check_correction(files, name, given)
    if given["expansion_per_k"] and not files.is_given(
        "instruments", name, "certified_temperature_c"
    ):
        key = "certified_temperature_c"
        files.tell_key(files.log.problem, "instruments", name, key, temperature_missing())


def _check_temperatures(files, distances, instruments):
    """Warn about missing and ineffective temperatures of tape readings."""
    temperature = distances.numbers("temperature_c")
    expands = np.array(
        [
            bool((instruments.get(name) or {}).get("expansion_per_k"))
            for name in distances.of("instrument")
        ],
        dtype=bool,
    )
    is_missing = expands & np.isnan(temperature)
    is_ineffective = ~expands & ~np.isnan(temperature) & files.sound(distances)
    for is_reported, expected in (
        (
            is_missing,
            message(
                "tape_without_temperature",
                "blank in {rows} rows of a tape with expansion_per_k; they are not corrected",
                rows=int(is_missing.sum()),
            ),
        ),
        (
            is_ineffective,
            message(
                "temperature_idle",
                "without effect in {rows} rows: the instrument has no expansion_per_k",
                rows=int(is_ineffective.sum()),
            ),
        ),
    ):
        if is_reported.any():
            row = distances.rows[int(np.argmax(is_reported))]
            files.log.warning(distances.file, expected, row, "temperature_c")


# ---- stadia


def bars_of(registers):
    """{name: {key: value}} of the stadia bars of instruments.toml."""
    instruments = registers["instruments"]
    return {name: keys for name, keys in instruments.items() if is_bar(keys["kind"])}


def is_bar(kind):
    """Return True for the kind of a stadia bar, in any spelling."""
    return (kind or "").strip().lower() == KIND


def bars_used(table, bars):
    """Bar of each reading, shape (n,); blank: the only bar; None: several bars."""
    only = next(iter(bars)) if len(bars) == 1 else None
    return [only if name is None else name for name in table.of("bar")]


def check_bars(files, table):
    """Check the stadia bars of instruments.toml, and the references of readings to them."""
    bars = bars_of(files.registers)
    for name, given in bars.items():
        for key in ("length_m", "u_mm"):
            if given[key] is None:
                expected = message(
                    "bar_not_described",
                    "missing; expected it of a stadia: distances are read against its length",
                )
                files.tell_key(files.log.problem, "instruments", name, key, expected)
    if files.raw.registers.get("instruments", 0) is None:  # unreadable, reported already
        return
    if not files.registers["instruments"]:
        tell_missing(files.log, files.raw.file_of("instruments"), table.file, "bar")
        return
    reported = set()
    for row, bar in zip(table.rows, bars_used(table, bars), strict=True):
        if bar not in bars and bar not in reported:
            reported.add(bar)
            expected = message(
                "no_such_bar",
                "found {name!r}; expected a stadia of {file}: kind = stadia, length_m, u_mm",
                name=bar or "",
                file=files.raw.file_of("instruments"),
            )
            files.log.problem(table.file, expected, row, "bar")


def check_stadia(files):
    """Check all stadia readings and their bars."""
    table = files.tables["stadia"]
    if not has_rows(table):
        return
    setups = files.tables["setups"]
    defined = () if setups is None else dict.fromkeys(setups.of("setup"))
    refuse_undefined(files, table, "setup", defined, "setups")
    check_angle(files, table, "angle")
    check_bars(files, table)
    stations = {}
    if setups is not None:
        stations = dict(zip(setups.of("setup"), setups.of("station"), strict=True))
    for row, setup, to in zip(table.rows, table.of("setup"), table.of("to"), strict=True):
        if to is not None and stations.get(setup) == to:
            refuse_itself(files.log, table, row, to)


def refuse_itself(log, table, row, to):
    """Report a bar on the station of its own set-up."""
    expected = message(
        "stadia_at_itself",
        "found station {to!r} of the set-up itself; expected another one",
        to=to,
    )
    log.problem(table.file, expected, row, "to")
