"""Export of a record: selection of rows, error bound, writing by a profile, reading back."""

import hashlib
import os
from dataclasses import dataclass
from errno import EISDIR
from pathlib import Path

import numpy as np

from tankcal import record as records
from tankcal.exports.choosing import RowRequest
from tankcal.exports.facts import provenance_lines, report_lines
from tankcal.exports.marks import ON_THE_MARK_M
from tankcal.exports.shell_movement import GaugeCorrection, gauge_correction
from tankcal.exports.writing import file_text, make_body, read_back
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.text.naming import file_name
from tankcal.text.words import load_words, say


@dataclass(frozen=True)
class Export:
    """A table as a system will read it, with its error.

    Attributes
    ----------
    profile : Profile
    tank : str
        Name of the tank.
    dip_m, volume_m3 : (points,) ndarray
        Rows of the file as the system interprets them, ascending.
    rows : int
        Number of rows of the table in the record.
    error_m3 : float
        Bound of the error at any dip: rounding, line or spline, and `interpolation_m3`.
    at_m : float
        Dip of the largest error (without interpolation_m3).
    interpolation_m3 : float
        Largest error of linear interpolation in the record, as stated in the record.
    rounded_levels : int
        Number of rows whose level is rounded to a mark of the profile.
    gauge : GaugeCorrection or None
        HyTD of a gauge supported by the shell.
    facts : tuple of Message
        Provenance.
    data : bytes
        The file.
    left_out_m : float or None
        Dip of the highest row of the table, if the file ends below it.
    """

    profile: object
    tank: str
    dip_m: np.ndarray
    volume_m3: np.ndarray
    rows: int
    error_m3: float
    at_m: float
    interpolation_m3: float
    rounded_levels: int
    gauge: GaugeCorrection | None
    facts: tuple
    data: bytes
    left_out_m: float | None = None

    @property
    def lines(self):
        """Messages of the report."""
        return report_lines(self)


def export_record(source, profile, *, points=None, max_error_m3=None, hangs_on_shell=False,
                  language="en"):  # fmt: skip
    """Return the `Export` of the table in a record.

    Parameters
    ----------
    source : path
        A record.json.
    profile : Profile
    points : int, optional
        Largest number of rows of the file; rows with the smallest error are selected.
    max_error_m3 : float, optional
        Largest error; the fewest rows are selected.
    hangs_on_shell : bool, optional
        Whether the gauge is supported by the shell; HyTD is then computed.
    language : str, optional
        Language of the lines of provenance.

    Raises
    ------
    InputError
        With every reason why the profile does not fit the table.
    """
    path, log = Path(source), Log()
    record = records.read(path, tables=False)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    _check_table(path.name, record, log)
    log.stop_if_problems()
    request = RowRequest(record, profile, points, max_error_m3, log)
    marks, required = request.marks()
    gauge = _gauge(path.name, record, log) if hangs_on_shell else None
    log.stop_if_problems()
    rows, error, at = request.select_rows(marks, required)
    log.stop_if_problems()
    listed = rows[1:] if request.is_zero_left_out else rows
    request.refuse_limits(marks, listed)
    log.stop_if_problems()
    height, reference = request.height, record.job.datum.reference_height_m
    body = make_body(listed.tolist(), height, marks, profile, reference)
    facts, words = provenance_lines(record, digest), load_words(language)
    values = {
        "tank": record.job.tank.id, "number": str(record.job.certificate.get("number") or ""),
        "date": record.job.survey.date or "", "points": str(len(listed)),
        "level_unit": profile.increment if profile.leading == "increments" else profile.level_unit,
        "volume_unit": profile.volume_unit,
    }  # fmt: skip
    text = file_text(body, profile, [say(words, fact) for fact in facts], values)
    data = text.encode(profile.encoding)
    is_off_mark = np.abs(marks.at_m[listed] - height[listed]) > ON_THE_MARK_M
    rounded_levels = int(is_off_mark.sum())
    read_back(
        data,
        body,
        profile,
        is_even=len(listed) == len(height) and not rounded_levels,
        rounded=rounded_levels,
    )
    return Export(
        profile=profile,
        tank=record.job.tank.id,
        dip_m=marks.at_m[listed],
        volume_m3=marks.written_m3[listed],
        rows=len(height),
        error_m3=error + request.interpolation_m3,
        at_m=at,
        interpolation_m3=request.interpolation_m3,
        rounded_levels=rounded_levels,
        gauge=gauge,
        facts=tuple(facts),
        data=data,
        left_out_m=None if rows[-1] == len(height) - 1 else float(height[-1]),
    )


def default_name(export):
    """Default name of the file of an export, from the tank and the profile."""
    return f"{file_name(export.tank, 'tank')}-{export.profile.code}{export.profile.ending}"


def write_export(export, out, language="en"):
    """Write the file and its report (NAME-report.txt), both or none; return their paths."""
    out, words = Path(out), load_words(language)
    report = out.with_name(f"{out.stem}-report.txt")
    lines = [say(words, line) for line in (*export.lines, *export.facts)]
    contents = {out: export.data, report: "".join(f"{line}\n" for line in lines).encode()}
    waiting = {}
    for path in contents:
        if path.is_dir():  # reported before any file is written
            raise IsADirectoryError(EISDIR, os.strerror(EISDIR), str(path))
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        for path, data in contents.items():
            waiting[path] = path.with_name(f".{path.name}.{os.getpid()}.tmp")
            waiting[path].write_bytes(data)
        for path, temporary in waiting.items():
            temporary.replace(path)
    finally:
        for temporary in waiting.values():
            temporary.unlink(missing_ok=True)
    return [*contents]


def _check_table(file, record, log):
    """Report why the table of a record cannot be exported."""
    if record.capacity is None:
        text = message("export_no_table", "has no capacity table: its survey was only adjusted")
        log.problem(file, text, None, "capacity")
        return
    height, volume = np.array(record.capacity.height_m), np.array(record.capacity.volume_m3)
    if len(height) != len(volume) or len(height) < 2 or np.any(np.diff(height) <= 0):
        text = message("export_bad_heights", "heights that do not rise row by row; expected two "
                       "rows or more that do, with a volume each")  # fmt: skip
        log.problem(file, text, None, "capacity.height_m")
    columns = ("k", "stated_U_m3")
    if any(len(getattr(record.capacity, column)) != len(height) for column in columns):
        text = message("export_columns", "columns of different lengths; expected one value a row")
        log.problem(file, text, None, "capacity.stated_U_m3")


def _gauge(file, record, log):
    """Return the `GaugeCorrection` of the record's shell.

    None after reporting why there is none.
    """
    head = next((choice.value for choice in record.choices if choice.code == "head"), None)
    courses = [
        (course.height_m, course.thickness_m, course.inside_radius_m) for course in record.courses
    ]
    if not courses or min(thickness for _, thickness, _ in courses) <= 0:
        text = message("export_no_plates", "has no courses with the thickness of their plates; "
                       "expected them for --gauge-on-shell")  # fmt: skip
        log.problem(file, text, None, "courses")
        return None
    if not isinstance(head, int | float) or head <= 0:
        text = message("export_no_density", "its table has no head of a liquid; expected one with "
                       "the density of the liquid for --gauge-on-shell")  # fmt: skip
        log.problem(file, text, None, "job.table.liquid_density_kg_m3")
        return None
    zero = record.capacity.zero_m
    top = record.capacity.height_m[-1]
    return gauge_correction(top, courses, float(head), record.job.material.e_pa, zero)
