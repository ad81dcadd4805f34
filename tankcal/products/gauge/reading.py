"""Reading of a commissioning: gauge.toml, readings.csv and the record of the tank."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tankcal import record as records
from tankcal.adjust import CRITICAL
from tankcal.errors import InputError, Problem
from tankcal.gum.coverage import coverage_factor
from tankcal.job.checking import missing_beside
from tankcal.job.contract.keys import CSV
from tankcal.job.entries import ColumnValues, read_columns
from tankcal.job.fields import Field, choice, number, positive
from tankcal.job.folder import read_csv
from tankcal.job.tables import Log, make_table, read_bytes, shown
from tankcal.messages import message
from tankcal.products.exports.exporting import shortening_m
from tankcal.products.gauge.deviation import LEAST_LEVELS, Dips, KnownSlope, slope_of_tilt
from tankcal.products.gauge.saved import GaugeCourse, GaugeRecord
from tankcal.products.settings import EmptyFiles, fill_blanks, read_sections
from tankcal.record.manifest import digest_of
from tankcal.tank import gauging
from tankcal.text.shipped import LANGUAGES

SETTINGS, READINGS = "gauge.toml", "readings.csv"
SUPPORTS = ("bottom", "shell")
RULES = ("guarded", "simple")
LEAST_RANGE = 0.5  # of the working range, within which the levels are called close
LEAST_STEP_M = 0.05  # between two levels; closer levels are repeats
LARGEST_DEVIATION_M = 1.0  # beyond it, a slip, such as an ullage in the column of dips
BLANK_TAPE_K = 10.0  # u of the temperature of a tape without a measured temperature

# {name: standard uncertainty if gauge.toml does not declare it}. Values of tank/gauging.py are from
# memory, the others our own assumptions; the certificate marks all of them as assumed.
UNCERTAINTIES = {
    "u_dip_mm": gauging.UNCERTAINTIES["u_dip_mm"],
    "u_gauge_mm": 0.5,
    "u_tape_zero_mm": 0.5,
    "u_tape_ppm": gauging.UNCERTAINTIES["u_tape_ppm"],
    "u_tape_temperature_k": 2.0,
    "u_reference_mm": 1.0,
    "u_table_reference_mm": 1.0,
    "u_dip_plate_mm": 1.0,
    "u_table_zero_mm": 1.0,
    "u_movement_percent": 20.0,
}
TAPE = {  # if gauge.toml does not declare them
    "zero_correction_mm": 0.0,
    "scale_correction_ppm": 0.0,
    "expansion_per_k": 1.15e-5,  # steel, from memory
    "reference_temperature_c": 20.0,
}


def _text(name):
    return Field(name, "text", "")


# Keys and columns; their notes are in [gauge.notes] of the words of each language.
SECTIONS = {
    "certificate": (
        *(_text(name) for name in ("number", "by", "place", "customer", "note", "notice")),
        Field("date", "date", "", required=True),
        choice("language", "", LANGUAGES),
        number("coverage_probability", "", 0.5, 0.9999),
    ),
    "gauge": (
        *(_text(name) for name in ("tank", "record", "maker", "model", "serial", "principle")),
        positive("resolution_mm", "", 100, required=True),
        choice("supported_by", "", SUPPORTS, required=True),
        Field("corrects_head", "flag", ""),
        number("lowest_m", "", 0, 200, required=True),
        number("highest_m", "", 0, 200, required=True),
        number("scale_ppm", "", -10_000, 10_000),
        number("u_scale_ppm", "", 0, 10_000),
        _text("certificate"),
    ),
    "liquid": (_text("name"), positive("density_kg_m3", "", 2000)),
    "tape": (
        _text("serial"),
        _text("certificate"),
        number("zero_correction_mm", "", -100, 100),
        number("scale_correction_ppm", "", -5000, 5000),
        positive("expansion_per_k", "", 1e-4),
        number("reference_temperature_c", "", -20, 60),
    ),
    "reference": (positive("height_m", "", 200), positive("table_height_m", "", 200)),
    "pipe": (number("tilt_deg", "", 0, 20), number("u_tilt_deg", "", 0, 10)),
    "zeros": (number("dip_plate_m", "", -1e4, 1e4), number("table_zero_m", "", -1e4, 1e4)),
    "limit": (
        _text("source"),
        positive("absolute_mm", "", 1000),
        positive("relative_percent", "", 10),
        choice("rule", "", RULES),
    ),
    "uncertainty": tuple(number(name, "", 0, 1000) for name in UNCERTAINTIES),
    "csv": CSV,
}
COLUMNS = (
    Field("level", "name", "", required=True),
    number("dip_m", "", 0, 200),
    number("ullage_m", "", 0, 200),
    number("gauge_m", "", -5, 200, required=True),
    number("tape_c", "", -60, 150),
)


@dataclass(frozen=True)
class Comparison:
    """Checked input of a commissioning.

    Attributes
    ----------
    sections : dict
        {section: {key: value}} of gauge.toml.
    table : job.entries.ColumnValues
        Readings as in readings.csv.
    u : dict
        {name: standard uncertainty}, declared or assumed.
    tank : saved.GaugeRecord or None
        Facts of the tank from its record.
    names : tuple of str
        Name of each level, from the lowest level.
    counts : ndarray, shape (n,)
        Number of readings at each level.
    dips : deviation.Dips
    known_slope : deviation.KnownSlope or None
        Slope in place of an estimate; None: it is estimated.
    movement : callable or None
        movement(level_m) returns the movement h of the gauge; None: no movement is modelled.
    files : tuple of (str, str)
        Name and SHA-256 of gauge.toml and readings.csv.
    warnings : tuple of Problem
    """

    sections: dict
    table: ColumnValues
    u: dict
    tank: GaugeRecord | None
    names: tuple
    counts: np.ndarray
    dips: Dips
    known_slope: KnownSlope | None
    movement: object
    files: tuple
    warnings: tuple

    @property
    def probability(self):
        """Coverage probability of all U."""
        return self.sections["certificate"]["coverage_probability"] or 0.95

    @property
    def k_normal(self):
        """Coverage factor of a standard uncertainty with infinite degrees of freedom."""
        return float(coverage_factor(self.probability, np.inf))


def read_comparison(folder):
    """Read and check a commissioning.

    Parameters
    ----------
    folder : path
        Folder with gauge.toml and readings.csv, or its gauge.toml.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        With every problem of the files.
    """
    folder, log = Path(folder).absolute(), Log()
    settings = folder if folder.suffix == ".toml" else folder / SETTINGS
    readings = settings.with_name(READINGS)
    if not settings.is_file():
        text = message("gauge_no_settings", "no {file}; expected it in this folder: tankcal gauge "
                       "{name} --new writes empty input files", file=settings.name,
                       name=folder.name)  # fmt: skip
        raise InputError(Problem(settings.parent.name, text))
    source, table = _read_files(settings, readings, log)
    tank = _tank(source, settings.parent)
    files = tuple((path.name, digest_of(path)) for path in (settings, readings))
    return _compare(source, table, tank, files)


def read_files(settings, readings):
    """Read gauge.toml and readings.csv without checks of the comparison.

    Returns
    -------
    sections : dict
        {section: {key: value or None}}.
    table : job.entries.ColumnValues

    Raises
    ------
    InputError
        With every problem of the files.
    """
    source, table = _read_files(Path(settings), Path(readings), Log())
    source.log.stop_if_problems()
    return source.sections, table


def _read_files(settings, readings, log):
    """(`_Source`, `ColumnValues`) of both files; problems are in the log."""
    sections, places, marks = read_sections(settings, SECTIONS, log)
    data = None if marks is None else read_bytes(readings, log)
    raw = None if data is None else read_csv(READINGS, data, *marks, log, settings.name)
    table = None if raw is None else read_columns(None, raw, log, COLUMNS)
    return _Source(settings.name, sections, places, log), table


def read_saved_comparison(inputs, readings, tank, files):
    """Check a commissioning again from its saved inputs.

    Parameters
    ----------
    inputs : dict
        {section: {key: value}} of gauge.toml, without blank keys.
    readings : list of dict
        {column: value} of each row of readings.csv, with its number "row".
    tank : saved.GaugeRecord or None
        Facts of the tank from its record.
    files : tuple of (str, str)
        Name and SHA-256 of gauge.toml and readings.csv.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        With every problem of the inputs.
    """
    log, name = Log(), files[0][0] if files else SETTINGS
    sections, places, _ = read_sections(inputs, SECTIONS, log, name)
    headings = [field.name for field in COLUMNS]
    rows = [(reading["row"], [_cell(reading[key]) for key in headings]) for reading in readings]
    raw = make_table(READINGS, [(1, headings), *rows], ".", log)
    table = read_columns(None, raw, log, COLUMNS)
    log.stop_if_problems()
    return _compare(_Source(name, sections, places, log), table, tank, files)


def _cell(value):
    """Text of a saved value in a cell; repr keeps every digit of a number."""
    return "" if value is None else value if isinstance(value, str) else repr(value)


def _compare(source, table, tank, files):
    """`Comparison` of settings, readings and facts of the tank, with all checks."""
    sections, log = source.sections, source.log
    log.stop_if_problems()
    _check_settings(source, tank)
    lengths, by_ullage = _check_readings(source, table)
    log.stop_if_problems()
    u = fill_blanks(sections["uncertainty"], UNCERTAINTIES)
    if (
        sections["uncertainty"]["u_tape_temperature_k"] is None
        and np.isnan(table.numbers("tape_c")).any()
    ):
        u["u_tape_temperature_k"] = BLANK_TAPE_K
    movement = _movement(source, tank, by_ullage)
    names, counts, dips = _mean_readings(source, table, lengths, by_ullage, u, movement)
    known_slope = _find_slope(source, names)
    log.stop_if_problems()
    return Comparison(sections, table, u, tank, names, counts, dips, known_slope, movement,
                      files, tuple(log.warnings))  # fmt: skip


class _Source:
    """Sections of gauge.toml, with reports on their keys."""

    def __init__(self, file, sections, places, log):
        self.file, self.sections, self.places, self.log = file, sections, places, log

    def tell(self, key, text, *, is_warning=False):
        """Report on "section.key"."""
        report = self.log.warning if is_warning else self.log.problem
        row = self.places.get(key, self.places.get(key.partition(".")[0]))
        report(self.file, text, row, key)


def _tank(source, folder):
    """`GaugeRecord` of the record; None without a record, or after a problem."""
    name = source.sections["gauge"]["record"]
    if name is None:
        if source.sections["gauge"]["tank"] is None:
            source.tell("gauge.tank", message("gauge_no_tank", "missing; expected the name of the "
                        "tank, or its record"))  # fmt: skip
        return None
    path = folder / name
    path = path / "record.json" if path.is_dir() else path
    if not path.is_file():
        text = message("gauge_no_record", "found {name}, where no record is; expected record.json "
                       "of the tank, or its folder", name=shown(name))  # fmt: skip
        source.tell("gauge.record", text)
        return None
    if read_bytes(path, source.log) is None:
        return None
    try:
        tank = read_tank(path)
    except InputError as error:
        source.log.problems.extend(error.problems)
        return None
    if tank is None:
        source.tell("gauge.record", message("gauge_no_table", "the record of a survey without a "
                    "tank; expected a record with a capacity table"))  # fmt: skip
    return tank


def read_tank(path):
    """Read the `GaugeRecord` of a record.json; None for a record without a capacity table.

    Raises
    ------
    InputError
        If the file is no record.
    """
    record = records.read(path, tables=False)
    if record.capacity is None:
        return None
    are_known = all(course.thickness_m > 0 for course in record.courses)
    return GaugeRecord(
        digest_of(path),
        record.job.tank.id,
        record.job.datum.reference_height_m,
        record.capacity.zero_m,
        [GaugeCourse(c.height_m, c.thickness_m, c.inside_radius_m) for c in record.courses]
        if are_known
        else [],
        record.job.material.e_pa,
        str(record.job.certificate.get("notice") or ""),
    )


def shell_of(tank, density):
    """Arguments of `shortening_m` and `gauge_correction` after the level."""
    courses = [(course.height_m, course.thickness_m, course.radius_m) for course in tank.courses]
    return courses, density, tank.e_pa, tank.zero_m


def _check_settings(source, tank):
    """Report contradictory and incomplete settings."""
    gauge, limit, pipe = (source.sections[name] for name in ("gauge", "limit", "pipe"))
    if tank is not None and gauge["tank"] not in (None, tank.tank):
        text = message("gauge_other_tank", "found {tank}, but the record is of {other}; expected "
                       "the record of this tank", tank=gauge["tank"], other=tank.tank)  # fmt: skip
        source.tell("gauge.tank", text)
    low, high = gauge["lowest_m"], gauge["highest_m"]
    if None not in (low, high) and high <= low:
        text = message("gauge_no_working_range", "not above lowest_m; expected the highest level")
        source.tell("gauge.highest_m", text)
    has_limit = limit["absolute_mm"] is not None or limit["relative_percent"] is not None
    for key in ("source", "rule"):
        if has_limit and limit[key] is None:
            source.tell(f"limit.{key}", missing_beside("limit.absolute_mm"))
    if not has_limit and (limit["source"] is not None or limit["rule"] is not None):
        source.tell("limit.absolute_mm", missing_beside("limit.source"))
    for section, first, second in (
        ("pipe", "tilt_deg", "u_tilt_deg"),
        ("gauge", "scale_ppm", "u_scale_ppm"),
        ("zeros", "dip_plate_m", "table_zero_m"),
    ):
        values = source.sections[section]
        if (values[first] is None) != (values[second] is None):
            lacking, other = (second, first) if values[second] is None else (first, second)
            source.tell(f"{section}.{lacking}", missing_beside(f"{section}.{other}"))
    if pipe["tilt_deg"] is not None and gauge["supported_by"] == "shell":
        text = message("gauge_pipe_of_shell", "given for a gauge without a still pipe on the "
                       "bottom: the angle of any other pipe", )  # fmt: skip
        source.tell("pipe.tilt_deg", text, is_warning=True)


def _check_readings(source, table):
    """(corrected tape readings (rows,), whether each is an ullage)."""
    log = source.log
    if table.is_empty:
        log.problem(READINGS, message("gauge_no_readings", "no rows; expected a dip and an "
                    "indication of the gauge in each row"))  # fmt: skip
    dip, ullage = table.numbers("dip_m"), table.numbers("ullage_m")
    for place, row in enumerate(table.rows):
        if np.isfinite(dip[place]) and np.isfinite(ullage[place]):
            text = message("gauge_dip_and_ullage", "given together with a dip; expected either "
                           "of them")  # fmt: skip
            log.problem(READINGS, text, row, "ullage_m")
        elif np.isnan(dip[place]) and np.isnan(ullage[place]):
            text = message("gauge_no_dip", "missing; expected the dip, or the ullage")
            log.problem(READINGS, text, row, "dip_m")
    by_ullage = np.isfinite(ullage)
    if by_ullage.any() and source.sections["reference"]["height_m"] is None:
        source.tell("reference.height_m", missing_beside(f"{READINGS}, ullage_m"))
    tape = fill_blanks(source.sections["tape"], TAPE)
    # Without a temperature, the reading is not corrected for it.
    warmer = np.nan_to_num(table.numbers("tape_c") - tape["reference_temperature_c"])
    scale = tape["scale_correction_ppm"] * 1e-6 + tape["expansion_per_k"] * warmer
    reading = np.where(by_ullage, ullage, dip)
    # true length = reading (1 + scale) + zero correction
    return reading * (1 + scale) + tape["zero_correction_mm"] / 1000, by_ullage


def _movement(source, tank, by_ullage):
    """Function of the movement h of the gauge by the head of the liquid; None: not modelled."""
    gauge, density = source.sections["gauge"], source.sections["liquid"]["density_kg_m3"]
    if gauge["supported_by"] != "shell" or gauge["corrects_head"]:
        return None
    if by_ullage.any():
        text = message(
            "gauge_ullage_on_shell",
            "given for a gauge that the shell carries, whose reference point moves with the gauge; "
            "expected dips from the plate",
        )
        source.log.problem(READINGS, text, None, "ullage_m")
    if tank is None or not tank.courses:
        text = message("gauge_no_movement", "no record with courses and plates: the movement of "
                       "the shell is not modelled and remains in the line")  # fmt: skip
        source.tell("gauge.supported_by", text, is_warning=True)
        return None
    if density is None:
        source.tell("liquid.density_kg_m3", missing_beside("gauge.supported_by = shell"))
        return None
    shell = shell_of(tank, density)
    return lambda level: shortening_m(level, *shell)


def _mean_readings(source, table, lengths, by_ullage, u, movement):
    """(names, counts, `Dips`) of the levels, from the lowest."""
    height = source.sections["reference"]["height_m"]
    level = np.where(by_ullage, (height or 0.0) - lengths, lengths)
    gauge = table.numbers("gauge_m")
    for place in np.flatnonzero(np.abs(gauge - level) > LARGEST_DEVIATION_M):
        text = message(
            "gauge_far",
            "differs from the dip by {off:.3f} m; expected less than {most:g} m: {cause}",
            off=gauge[place] - level[place],
            most=LARGEST_DEVIATION_M,
            cause=_find_cause(source, table, place, lengths[place], by_ullage[place]),
        )
        source.log.problem(READINGS, text, table.rows[place], "gauge_m")
    groups = {}
    for place, name in enumerate(table.of("level")):
        groups.setdefault(name, []).append(place)
    for name, places in groups.items():
        if len(set(by_ullage[places])) > 1:
            text = message("gauge_mixed", "the level {name} has dips and ullages; expected either "
                           "of them", name=name)  # fmt: skip
            source.log.problem(READINGS, text, table.rows[places[0]], "level")
        if np.ptp(level[places]) > LEAST_STEP_M:
            text = message("gauge_repeats_apart", "the readings of {name} are up to {apart:.3f} m "
                           "apart; expected repeats within {least:g} m: give each level its own "
                           "name", name=name, apart=np.ptp(level[places]),
                           least=LEAST_STEP_M)  # fmt: skip
            source.log.problem(READINGS, text, table.rows[places[-1]], "level")
        _warn_of_outliers(source, table, gauge - level, places, u)
    order = sorted(groups, key=lambda name: level[groups[name]].mean())
    rows = [groups[name] for name in order]
    counts = np.array([len(places) for places in rows])

    def mean(values):
        return np.array([values[places].mean() for places in rows])

    mean_level, is_ullage = mean(level), np.array([by_ullage[places[0]] for places in rows])
    for place in np.flatnonzero(np.diff(mean_level) < LEAST_STEP_M):
        text = message("gauge_same_level", "the levels {low} and {high} are closer than {least:g} "
                       "m; expected a single name for repeats", low=order[place],
                       high=order[place + 1], least=LEAST_STEP_M)  # fmt: skip
        source.log.problem(READINGS, text, table.rows[rows[place + 1][0]], "level")
    resolution = source.sections["gauge"]["resolution_mm"] / 1000
    # A gauge at rest repeats its friction and rounding, so repeats reduce the error of dips only.
    of_gauge = (u["u_gauge_mm"] / 1000) ** 2 + resolution**2 / 12
    scatter = np.sqrt((u["u_dip_mm"] / 1000) ** 2 / counts + of_gauge)
    # A longer tape reading raises the level of a dip and lowers that of an ullage.
    sign, length = np.where(is_ullage, 1.0, -1.0), mean(lengths)
    expansion = fill_blanks(source.sections["tape"], TAPE)["expansion_per_k"]
    thermal = expansion * u["u_tape_temperature_k"]
    shared = {
        "tape zero": sign * u["u_tape_zero_mm"] / 1000,
        "tape scale": sign * length * u["u_tape_ppm"] * 1e-6,
        "tape temperature": sign * length * thermal,
    }
    if is_ullage.any():
        shared["reference height"] = np.where(is_ullage, -u["u_reference_mm"] / 1000, 0.0)
    moved = np.zeros(len(rows)) if movement is None else movement(mean_level)
    return tuple(order), counts, Dips(mean_level, mean(gauge), moved, scatter, shared)


def _find_cause(source, table, place, length_m, by_ullage):
    """Probable cause of an indication that is far from the dip, as a Message."""
    gauge, tape = table.numbers("gauge_m")[place], table.numbers("tape_c")[place]
    height = source.sections["reference"]["height_m"]

    def is_near(first, second):
        return abs(first - second) <= LARGEST_DEVIATION_M  # False for nan

    if is_near(tape, length_m):
        return message("gauge_cause_gauge", "are gauge_m and tape_c swapped?")
    if is_near(tape, gauge):
        return message("gauge_cause_tape", "are the tape reading and tape_c swapped?")
    if by_ullage and is_near(length_m, gauge):
        return message("gauge_cause_dip", "it agrees as a dip; move it to the column dip_m")
    if not by_ullage and height is not None and is_near(height - length_m, gauge):
        return message("gauge_cause_ullage", "it agrees as an ullage; move it to the column "
                       "ullage_m")  # fmt: skip
    return message("gauge_cause_unknown", "is it an ullage, or in another unit?")


def _warn_of_outliers(source, table, difference, places, u):
    """Warn of a repeat that lies further from the mean of its level than its u allows."""
    count = len(places)
    if count < 2:
        return
    sd = np.hypot(u["u_dip_mm"], u["u_gauge_mm"]) / 1000 * np.sqrt((count - 1) / count)
    off = difference[places] - difference[places].mean()
    for place, value in zip(places, off, strict=True):
        if abs(value) > CRITICAL * sd:
            text = message("gauge_outlier", "differs from the mean of its level by {off_mm:+.1f} "
                           "mm; standard uncertainty {sd_mm:.1f} mm: is a reading wrong?",
                           off_mm=1000 * value, sd_mm=1000 * sd)  # fmt: skip
            source.log.warning(READINGS, text, table.rows[place], "gauge_m")


def _find_slope(source, names):
    """`KnownSlope` for fewer levels than a line needs; None: the slope is estimated."""
    if len(names) >= LEAST_LEVELS:
        return None
    gauge, pipe = source.sections["gauge"], source.sections["pipe"]
    if gauge["scale_ppm"] is None:
        text = message("gauge_few_levels", "{count} levels; expected at least {least}, or "
                       "gauge.scale_ppm with its uncertainty: the scale of the gauge cannot be "
                       "estimated", count=len(names), least=LEAST_LEVELS)  # fmt: skip
        source.log.problem(READINGS, text, None, "level")
        return None
    slope, u = 0.0, 0.0
    if pipe["tilt_deg"] is not None:
        slope, u = slope_of_tilt(*np.radians([pipe["tilt_deg"], pipe["u_tilt_deg"]]))
    return KnownSlope(
        slope + gauge["scale_ppm"] * 1e-6, float(np.hypot(u, gauge["u_scale_ppm"] * 1e-6))
    )


# ---- empty input files


EMPTY_FILES = EmptyFiles(
    "gauge",
    (SETTINGS, SECTIONS),
    (READINGS, COLUMNS, "readings", "readings"),
    message("gauge_exists", "exists already; expected a folder without it"),
)
