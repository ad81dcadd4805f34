"""Export of a record: rows and error bound, writing by a profile, reading back, report.

An export also states HyTD of gauges supported by the shell: the head moves their reference
downwards. A shell that bulges becomes shorter (membrane, no axial load). With radius r and plate t
of a course:

    shortening(L) = sum over the courses of nu rho g / (E t) * integral of (L - z) r dz

The gauge applies C = 0 for L < L_0, C = -(L - L_0) D for L >= L_0, the two-parameter line nearest
to this curve. It corrects the level shown by the gauge, independently of the head in the table.
"""

import hashlib
import os
from dataclasses import dataclass, replace
from errno import EISDIR
from pathlib import Path

import numpy as np

from tankcal import record as records
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.methods.base import find_method
from tankcal.products.exports.writing import (
    ON_THE_MARK_M,
    RowRequest,
    file_text,
    make_body,
    read_back,
)
from tankcal.text.naming import file_name
from tankcal.text.words import load_words, say
from tankcal.units import STANDARD_GRAVITY

POISSON = 0.3  # Poisson's ratio of the shell
_SAMPLES = 150  # number of levels at which the line is compared with the curve


@dataclass(frozen=True)
class GaugeCorrection:
    """The line C = -(L - L_0) D of a gauge, and its largest distance from the movement.

    Attributes
    ----------
    start_m : float
        L_0, the level below which the correction is 0.
    factor : float
        D, metres of movement per metre of level.
    off_m : float
        Largest distance of the line from the movement.
    """

    start_m: float
    factor: float
    off_m: float


def shortening_m(level_m, courses, density_kg_m3, e_pa, zero_m=0.0):
    """Shortening of the shell at each level, m.

    Parameters
    ----------
    level_m : array_like, shape (n,)
        Dips.
    courses : sequence of (height_m, thickness_m, radius_m)
        From the bottom up.
    density_kg_m3, e_pa : float
        Density of the liquid, and Young's modulus of the shell.
    zero_m : float, optional
        Height of the zero of dips above the bottom.

    Examples
    --------
    >>> shortening = shortening_m([8.0], [(8.0, 0.008, 7.2)], 1000, 206e9)
    >>> print((1000 * shortening).round(3))  # nu rho g r h^2 / (2 E t)
    [0.411]
    """
    surface = np.asarray(level_m, dtype=float) + zero_m
    total, bottom = np.zeros_like(surface), 0.0
    for height, thickness, radius in courses:
        deep, shallow = (np.maximum(surface - z, 0) for z in (bottom, bottom + height))
        # integral of (L - z) r dz over the wet part of the course, divided by t
        total += radius * (deep**2 - shallow**2) / (2 * thickness)
        bottom += height
    return POISSON * density_kg_m3 * STANDARD_GRAVITY / e_pa * total


def gauge_correction(top_m, courses, density_kg_m3, e_pa, zero_m=0.0):
    """Return the `GaugeCorrection` nearest to the shortening at all levels up to the top.

    Parameters
    ----------
    top_m : float
        Highest dip.
    courses, density_kg_m3, e_pa, zero_m
        As in `shortening_m`.
    """
    from scipy.optimize import linprog, minimize_scalar

    even = np.linspace(0.0, top_m, _SAMPLES + 1)

    def best(start):
        """(D, largest distance) of the best line from a level on, by linear programming."""
        level = np.append(even, start)
        true = shortening_m(level, courses, density_kg_m3, e_pa, zero_m)
        rise, scale = np.maximum(level - start, 0), true.max()
        # Minimise the bound e with -e <= D rise - movement <= e; unknowns D and e.
        rows = np.column_stack([np.append(rise, -rise), np.full(2 * len(rise), -1.0)])
        solution = linprog([0, 1], rows, np.append(true, -true) / scale, bounds=[(0, None)] * 2)
        return solution.x * scale

    starts = np.linspace(0.0, 0.9 * top_m, 31)
    nearest = int(np.argmin([best(start)[1] for start in starts]))
    bounds = starts[max(nearest - 1, 0)], starts[min(nearest + 1, 30)]
    start = minimize_scalar(lambda level: best(level)[1], bounds=bounds, method="bounded").x
    factor, off = best(start)
    return GaugeCorrection(float(start), float(factor), float(off))


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
        return _report_lines(self)


def export_record(source, profile, *, points=None, max_error_m3=None, hangs_on_shell=False,
                  on_high_legs=False, language="en"):  # fmt: skip
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
    on_high_legs : bool, optional
        Whether the floating roof rests on its legs in their high position.
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
    if on_high_legs and not record.on_high_legs:
        text = message("export_single_position", "its roof has a single position of the legs")
        log.problem(path.name, text, None, "on_high_legs")
    log.stop_if_problems()
    if on_high_legs:
        record = _raise_legs(record)
    request = RowRequest(record, profile, points, max_error_m3, log)
    marks, required = request.marks()
    gauge = _find_gauge_correction(path.name, record, log) if hangs_on_shell else None
    log.stop_if_problems()
    rows, error, at = request.select_rows(marks, required)
    log.stop_if_problems()
    listed = rows[1:] if request.is_zero_left_out else rows
    request.refuse_limits(marks, listed)
    log.stop_if_problems()
    height, reference = request.height, record.job.datum.reference_height_m
    body = make_body(listed.tolist(), height, marks, profile, reference)
    facts, words = _provenance(record, digest), load_words(language)
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
        rows=len(record.capacity.height_m),
        error_m3=error + request.interpolation_m3,
        at_m=at,
        interpolation_m3=request.interpolation_m3,
        rounded_levels=rounded_levels,
        gauge=gauge,
        facts=tuple(facts),
        data=data,
        left_out_m=None if rows[-1] == len(height) - 1 else float(height[-1]),
    )


def _raise_legs(record):
    """Return a record whose table and critical zone are those of the high legs."""
    raised = {row.height_m: row for row in record.on_high_legs}
    capacity = record.capacity
    columns = {
        "volume_m3": "volume_m3",
        "for_use": "for_use",
        "U_m3": "U_m3",
        "stated_U_m3": "U_m3",
    }
    changed = {
        name: [
            getattr(raised[height], key) if height in raised else value
            for height, value in zip(capacity.height_m, getattr(capacity, name), strict=True)
        ]
        for name, key in columns.items()
    }
    high = {size.code: size.value for size in record.roof}
    codes = {"roof_critical_bottom": "roof_high_bottom", "roof_critical_top": "roof_high_top"}
    roof = [
        replace(size, value=high[codes[size.code]]) if size.code in codes else size
        for size in record.roof
    ]
    return replace(record, capacity=replace(capacity, **changed), roof=roof)


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


def _find_gauge_correction(file, record, log):
    """Return the `GaugeCorrection` of the shell; None after reporting why there is none."""
    density = _head_density(record)
    courses = [
        (course.height_m, course.thickness_m, course.inside_radius_m) for course in record.courses
    ]
    if not courses or min(thickness for _, thickness, _ in courses) <= 0:
        text = message("export_no_plates", "has no courses with the thickness of their plates; "
                       "expected them for --gauge-on-shell")  # fmt: skip
        log.problem(file, text, None, "courses")
        return None
    if density is None or density <= 0:
        text = message("export_no_density", "its table has no head of a liquid; expected one with "
                       "the density of the liquid for --gauge-on-shell")  # fmt: skip
        log.problem(file, text, None, "job.table.liquid_density_kg_m3")
        return None
    capacity = record.capacity
    return gauge_correction(
        capacity.height_m[-1], courses, density, record.job.material.e_pa, capacity.zero_m
    )


def _head_density(record):
    """Density of the head in the table, kg/m3, or None without a head."""
    head = next((choice.value for choice in record.choices if choice.code == "head"), None)
    return float(head) if isinstance(head, int | float) else None


# ---- report of an export, and provenance of its table


def _provenance(record, sha256):
    """Return lines of provenance as Messages: the table, its references and its uncertainty.

    record  a `record.making.Record`
    sha256  SHA-256 of its file
    """
    table, capacity = record.job.table, record.capacity
    provenance = message("export_record", "record SHA-256 {sha256}, tankcal {version}",
                         sha256=sha256, version=record.tankcal)  # fmt: skip
    theoretical = message("export_theoretical", "theoretical table: no survey of the tank stands "
                          "behind it")  # fmt: skip
    temperature = message("export_temperature", "reference temperature of the shell {celsius:.4g} "
                          "C", celsius=table.reference_temperature_c)  # fmt: skip
    U_top = message(
        "export_U_top", "U of the highest row: {U:.4g} L (k = {k:.3g}) of {volume:.1f} L",
        U=1000 * capacity.stated_U_m3[-1], k=capacity.k[-1], volume=1000 * capacity.volume_m3[-1],
    )  # fmt: skip
    return [
        _tank_line(record),
        provenance,
        *([] if _is_surveyed(record) else [theoretical]),
        temperature,
        _head_line(record),
        _zero_line(record),
        *_roof_lines(record),
        _expansion_line(record),
        U_top,
        *_delivery_lines(record),
    ]


def _report_lines(export):
    """Return the lines of the report of an `Export`: its errors and further facts, as Messages."""
    profile, litres = export.profile, 1000 * export.error_m3
    rows = message(
        "export_rows", "{points} of the {rows} rows of the table, dips {low:.6g} to {high:.6g} m, "
        "for {name}", points=len(export.dip_m), rows=export.rows, low=export.dip_m[0],
        high=export.dip_m[-1], name=profile.name,
    )  # fmt: skip
    error = message(
        "export_error", "largest error of what is read there: {error:.4g} L, worst at the dip "
        "{at:.6g} m; rounding included, and {own:.4g} L that straight lines between the rows of "
        "the table err themselves", error=litres, at=export.at_m,
        own=1000 * export.interpolation_m3,
    )  # fmt: skip
    lines = [rows, error, message("export_error_delivery", "of a delivery up to twice that: "
                                  "{twice:.4g} L", twice=2 * litres)]  # fmt: skip
    if profile.interpolation == "spline":
        lines.append(
            message(
                "export_spline",
                "for natural cubic splines between the rows: a "
                "program that reads straight lines must not use this file",
            )
        )
    if export.left_out_m is not None:
        lines.append(
            message(
                "export_top_left_out",
                "the highest row, {dip:.6g} m, is on no level of this profile and is left out: "
                "above {high:.6g} m the file says nothing",
                dip=export.left_out_m,
                high=export.dip_m[-1],
            )
        )
    if export.rounded_levels:
        lines.append(
            message(
                "export_rounded",
                "levels that had to be rounded: {count}; the error above counts it",
                count=export.rounded_levels,
            )
        )
    if not profile.verified:
        lines.append(
            message(
                "export_not_verified",
                "the profile was not verified with the system's own text: {source}",
                source=profile.source,
            )
        )
    if profile.remark:
        lines.append(message("export_remark", "{remark}", remark=profile.remark))
    return lines if export.gauge is None else [*lines, _gauge_line(export.gauge)]


def _gauge_line(gauge):
    return message(
        "export_hytd", "HyTD of a gauge that hangs on the shell: starting level {start:.2f} m, "
        "deformation factor {factor:.4f} mm/m; off by at most {off:.3f} mm. It corrects the level "
        "of the gauge; the head that this table has is another thing",
        start=gauge.start_m, factor=1000 * gauge.factor, off=1000 * gauge.off_m,
    )  # fmt: skip


def _is_surveyed(record):
    """Whether any quantity of the tank was measured, not only declared."""
    measured = [find_method(name) for name in record.surveys]
    return (
        record.job.tank.kind == "mesh"
        or record.points != []
        or record.adjustment is not None
        or any(not method.completes_survey for method in measured)  # former radii are declared
    )


def _tank_line(record):
    tank = record.job.tank.id
    number = record.job.certificate.get("number")
    if not number:
        return message("export_tank", "tank {tank}, without the number of a certificate", tank=tank)
    return message("export_tank_certificate", "tank {tank}, certificate {number}",
                   tank=tank, number=str(number))  # fmt: skip


def _head_line(record):
    density = _head_density(record)
    if density is None:
        return message("export_no_head", "head of the liquid: none in this table")
    return message("export_head", "with the head of a liquid of {density:.5g} kg/m3: not to be "
                   "applied again", density=density)  # fmt: skip


def _zero_line(record):
    reference = record.job.datum.reference_height_m
    plate = record.capacity.zero == "dip_plate"
    zero = message("export_from_bottom", "dips count from the bottom")
    if plate:
        zero = message("export_from_plate", "dips count from the dip plate")
    if reference is None:
        return message("export_zero", "{zero}; reference height not given", zero=zero)
    return message("export_zero_reference", "{zero}; reference height {reference:.6g} m",
                   zero=zero, reference=reference)  # fmt: skip


def _roof_lines(record):
    roof = {roof.code: roof.value for roof in record.roof or ()}
    mass = roof.get("roof_mass")
    if mass is None:
        return []
    weighing = message("export_in_vacuum", "weighed in vacuum")
    if roof.get("roof_weighing") == "air":
        weighing = message("export_in_air", "weighed in air")
    text = message(
        "export_roof", "floating roof of {mass:.6g} kg ({weighing}) at {density:.5g} kg/m3 is "
        "taken off; critical zone {low:.6g} to {high:.6g} m",
        mass=mass, weighing=weighing, density=roof.get("roof_reference_density", 0.0),
        low=roof.get("roof_critical_bottom", 0.0), high=roof.get("roof_critical_top", 0.0),
    )  # fmt: skip
    return [text]


def _expansion_line(record):
    material, heights = record.job.material, record.job.table.height_expansion
    ppm = 1e6 * material.expansion_per_k
    if heights:
        return message("export_expansion_3a", "expansion of the shell {ppm:.4g} ppm/K, of heights,"
                       " too", ppm=ppm)  # fmt: skip
    return message("export_expansion_2a", "expansion of the shell {ppm:.4g} ppm/K, not of heights",
                   ppm=ppm)  # fmt: skip


def _delivery_lines(record):
    if not record.deliveries:
        return []
    least = min(record.deliveries, key=lambda delivery: delivery.minimum_m)
    worst = least.at_minimum or least.relative
    text = message(
        "export_U_delivery", "U of the least delivery ({height:.4g} m): at most {U:.4g} L of "
        "{volume:.1f} L", height=least.minimum_m, U=1000 * worst.U_m3,
        volume=1000 * worst.volume_m3,
    )  # fmt: skip
    return [text]
