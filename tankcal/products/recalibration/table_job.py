"""Jobs from the geometry estimated from a former table, or from the radii in a record."""

import datetime
import io
import json
import re
from dataclasses import dataclass

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.products.recalibration.solid_geometry import size_sections, uncertainty_rows
from tankcal.report.folders import refuse_foreign, replace_folder
from tankcal.report.saved_document import iso_day
from tankcal.text.delimited import write_guarded
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import load_words, say

USUAL_TEMPERATURE_C = 20.0
UNKNOWN_ZERO_M = 0.02
LOWEST_THING_M = 2e-4  # smallest height of a fitting in deadwood.csv (dips with four decimals)
LEAST_RISE_M3 = 1e-6  # smallest rise between rows of bottom.csv (volumes with six decimals)
LEVEL_M = 1e-5  # last digit of the dips in bottom.csv
EMPTY_BELOW_M = 0.001  # distance of the empty level below a first row
SURE = 3.0  # standard uncertainties within which a bottom is flat, or a zero is at the bottom


@dataclass(frozen=True)
class RecordedRadii:
    """Radii of the courses in a record.

    Attributes
    ----------
    names : tuple of str
    radii_m : ndarray, shape (n,)
        Inside radii of the empty tank at the temperature of the record's table.
    covariance_m2 : ndarray, shape (n, n)
        From the covariance of the rows of its table.
    heights_m, thickness_m : ndarray, shape (n,)
    """

    names: tuple[str, ...]
    radii_m: np.ndarray
    covariance_m2: np.ndarray
    heights_m: np.ndarray
    thickness_m: np.ndarray

    @property
    def u_m(self):
        """Standard uncertainties (n,), m."""
        return np.sqrt(np.diag(self.covariance_m2))


def read_recorded(former):
    """Return the radii in the record of a former table.

    Returns
    -------
    RecordedRadii

    Raises
    ------
    InputError
        For a tank that is not upright, or that held liquid during the survey, or a course with
        fewer than two rows of the table.
    """
    record = former.record
    courses = record.get("courses") or []
    if (record["job"]["tank"].get("kind") or "vertical") != "vertical" or not courses:
        _refuse(
            former, message("read_no_courses", "not a tank of courses; expected an upright one")
        )
    if (record["job"]["survey"] or {}).get("liquid_level_m"):
        expected = message(
            "read_filled_record",
            "the tank held liquid when it was measured; expected the record of an empty one: run "
            "its job again for another table",
        )
        _refuse(former, expected)
    zero = record["capacity"].get("zero_m") or 0.0
    radii = np.array([course["inside_radius_m"] for course in courses])
    parts = [_area_factor(former, course, zero) for course in courses]
    factor = np.array(parts) / (2 * np.pi * radii[:, None])
    return RecordedRadii(
        tuple(course["course"] for course in courses),
        radii,
        factor @ factor.T,
        np.array([course["height_m"] for course in courses]),
        np.array([course["thickness_m"] for course in courses]),
    )


def _area_factor(former, course, zero):
    """Covariance factor (inputs,) of the mean area between the rows of a course."""
    low, high = course["bottom_m"] - zero, course["top_m"] - zero
    rows = np.flatnonzero((former.height_m >= low - 1e-6) & (former.height_m <= high + 1e-6))
    if len(rows) < 2:
        expected = message(
            "read_rows_of_course",
            "fewer than two rows within course {course}; expected rows in each",
            course=course["course"],
        )
        _refuse(former, expected)
    first, last = rows[0], rows[-1]
    apart = former.height_m[last] - former.height_m[first]
    return (former.factor_m3[last] - former.factor_m3[first]) / apart


def _refuse(former, expected):
    raise InputError(Problem(former.name, expected))


# ---- files of the jobs


@dataclass(frozen=True)
class JobFiles:
    """The files of a job.

    Attributes
    ----------
    texts : dict of {str: str}
        job.toml and CSV files.
    covariance_m2 : ndarray, shape (n, n), or None
        Covariance of the radii, for radii_cov.npz.
    courses : tuple of str
        Names of the courses.
    words : tuple of Message
        Phrases in `texts`, to be translated into the language of the job.
    """

    texts: dict
    covariance_m2: np.ndarray
    courses: tuple[str, ...]
    words: tuple = ()


def make_upright_job(former, geometry, names, *, u_common_m, e_pa, tank_id):
    """Return the `JobFiles` of an `UprightGeometry`.

    Parameters
    ----------
    former : FormerTable
    geometry : UprightGeometry
    names : sequence of str
        Names of the courses.
    u_common_m : float
        Common standard uncertainty of all radii from the method of the former table.
    e_pa : float
    tank_id : str
    """
    density = 0.0 if geometry.head == "without" else geometry.state.density_kg_m3
    zero, bottom = _bottom(former, geometry)
    heights = geometry.heights_m + np.eye(1, len(geometry.heights_m))[0] * (
        geometry.zero_m.value - zero
    )
    note = message("job_read_from", "read from {name}", name=str(former.name))
    settings = _settings(
        former,
        tank_id=tank_id,
        diameter=2 * float(geometry.radii_m[0]),
        height=float(np.sum(heights)),
        zero=zero,
        density=round(density, 1),
        source="table",
        u_common_m=u_common_m,
        e_pa=e_pa,
        note=note,
    )
    texts = {
        "job.toml": settings + _roof(former),
        **_wall(names, heights, geometry.thickness_m, geometry.radii_m),
    }
    if bottom is not None:
        rows = [(f"{level:.5f}", f"{volume:.6f}") for level, volume in bottom]
        texts["bottom.csv"] = _csv(("level_m", "volume_m3"), rows)
    things = _deadwood(geometry, zero + float(np.sum(heights)))
    names_of_things = [
        message("job_thing", "thing-{number}", number=k) for k in range(1, len(things) + 1)
    ]
    if things:
        rows = [(name, *thing) for name, thing in zip(names_of_things, things, strict=True)]
        heading = ("name", "bottom_m", "top_m", "volume_m3", "u_m3")
        texts["deadwood.csv"] = _csv(heading, rows)
    if geometry.state.bulges_m is not None:
        texts["uncertainty.csv"] = _profiles(geometry.state.bulges_m)
    words = (note, *names_of_things)
    return JobFiles(texts, geometry.covariance_m2, tuple(names), words)


def make_record_job(former, radii, *, tank_id):
    """Return the `JobFiles` of `RecordedRadii`."""
    job = former.record["job"]
    note = message("job_radii_of", "radii of {name}", name=str(former.name))
    settings = _settings(
        former,
        tank_id=tank_id,
        diameter=2 * float(radii.radii_m[0]),
        height=float(np.sum(radii.heights_m)),
        zero=-(former.record["capacity"].get("zero_m") or 0.0),
        density=former.liquid_density_kg_m3 or 0.0,
        source="record",
        u_common_m=0.0,
        e_pa=job["material"]["e_pa"],
        note=note,
    )
    wall = _wall(radii.names, radii.heights_m, radii.thickness_m, radii.radii_m)
    return JobFiles(
        {"job.toml": settings + _roof(former), **wall}, radii.covariance_m2, radii.names, (note,)
    )


def make_solid_job(former, fit, *, tank_id):
    """Return the `JobFiles` of a `SolidFit`: a job of declared dimensions."""
    diameter = fit["diameter"][0]
    tank = {
        "id": tank_id,
        "kind": fit.kind,
        "nominal_diameter_m": round(diameter, 3),
        "nominal_height_m": round(diameter, 3),
    }
    table = {
        "step_m": float(f"{np.median(np.diff(former.height_m)):.6g}"),
        "reference_temperature_c": _temperature(former),
    }
    lines = []
    for name, keys in ({"tank": tank} | size_sections(fit) | {"table": table}).items():
        lines.append(f"[{name}]")
        for key, value in keys.items():
            lines.append(f"{key} = {_text(value) if isinstance(value, str) else value}")
        lines.append("")
    lines += ["[survey]", 'side = "inside"', f"date = {_day(former)}"]
    # The dimensions are those at the reference temperature.
    lines += [f"shell_temperature_c = {_temperature(former)}", ""]
    texts = {"job.toml": "\n".join(lines)}
    rows = [
        ",".join(str(row[key]) for key in ("input", "u", "unit"))
        for row in uncertainty_rows(fit, former)
    ]
    if rows:
        texts["uncertainty.csv"] = "\n".join(["input,u,unit", *rows]) + "\n"
    return JobFiles(texts, None, ())


def _temperature(former):
    known = former.reference_temperature_c
    return USUAL_TEMPERATURE_C if known is None else known


def _day(former):
    day = iso_day(former.date)
    return day if day and day == former.date else datetime.date.today().isoformat()


def _settings(former, *, tank_id, diameter, height, zero, density, source, u_common_m, e_pa, note):
    temperature = _temperature(former)
    step = float(np.median(np.diff(former.height_m)))
    lines = [
        "[tank]",
        f"id = {_text(tank_id)}",
        'kind = "vertical"',
        f"nominal_diameter_m = {diameter:.3f}",
        f"nominal_height_m = {height:.4f}",
        "",
        "[survey]",
        'side = "inside"',
        f"date = {_day(former)}",
        "",
        "[datum]",
        f"bottom_z_m = {zero:.7f}",
        "dip_plate_z_m = 0.0",
        *(
            [f"reference_height_m = {former.reference_height_m:.4f}"]
            if former.reference_height_m is not None
            else []
        ),
        "",
        "[table]",
        f"step_m = {step:.6g}",
        f"reference_temperature_c = {temperature:g}",
        f"liquid_density_kg_m3 = {density:.1f}",
        "",
        "[material]",
        f"e_gpa = {e_pa / 1e9:g}",
        "",
        "[radii]",
        f'source = "{source}"',
        f"u_common_mm = {1000 * u_common_m:.4g}",
        f"reference_temperature_c = {temperature:g}",
        f"note = {_text(note)}",
        "",
    ]
    return "\n".join(lines)


def _text(text):
    return json.dumps(str(text), ensure_ascii=False)


def _roof(former):
    roof = former.roof
    if roof is None or roof.critical_m is None:
        return ""
    low, high = roof.critical_m
    return (
        f"\n[roof]\nmass_kg = {roof.mass_kg:g}\ncritical_bottom_m = {low:g}\n"
        f"critical_top_m = {high:g}\nreference_density_kg_m3 = {roof.density_kg_m3:g}\n"
        f'weighing = "{roof.weighing}"\n'
    )


def _wall(names, heights, plates, radii):
    sizes = zip(names, heights, plates, strict=True)
    courses = [(name, f"{height:.5f}", f"{1000 * plate:.6g}") for name, height, plate in sizes]
    rows = [(name, f"{radius:.7f}") for name, radius in zip(names, radii, strict=True)]
    return {
        "courses.csv": _csv(("course", "height_m", "thickness_mm"), courses),
        "radii.csv": _csv(("course", "radius_m"), rows),
    }


def _csv(heading, rows):
    stream = io.StringIO()
    write_guarded(stream, [heading, *rows])
    return stream.getvalue()


def _profiles(bulges_m):
    """Return uncertainty.csv of the profiles in the table, as the job has straight courses."""
    barrel = 1.5 * np.sqrt(np.mean(np.sum(bulges_m[:, 1::2] ** 2, axis=1)))
    taper = np.sqrt(np.mean(np.sum(bulges_m[:, ::2] ** 2, axis=1)))
    rows = [(name, f"{1000 * u:.3g}", "mm") for name, u in (("barrel", barrel), ("taper", taper))]
    return _csv(("input", "u", "unit"), rows)


def _deadwood(geometry, top_m):
    """Return rows of deadwood.csv: bottom, top, volume, u of each fitting within the rows used.

    The volume below the lowest row used belongs to the bottom. The part of a fitting above the last
    row is not observed and is left out.
    """
    rows = []
    for fitting in geometry.fittings:
        low, high = max(fitting.bottom_m.value, geometry.lowest_m), min(fitting.top_m.value, top_m)
        share = (high - low) / max(fitting.top_m.value - fitting.bottom_m.value, 1e-9)
        if high - low > LOWEST_THING_M:
            volume, u = share * fitting.volume_m3.value, share * fitting.volume_m3.u
            rows.append((f"{low:.4f}", f"{high:.4f}", f"{volume:.5f}", f"{u:.5f}"))
    return rows


def _bottom(former, geometry):
    """Return the dip of the bottom of the first ring, and the bottom below the lowest row used.

    The bottom is flat if a zero within its uncertainty explains every row; the second result is
    then None. Otherwise the second result is (rows, 2) dips and volumes up to the lowest row used.
    """
    base, lowest, zero, state = geometry.base_m3, geometry.lowest_m, geometry.zero_m, geometry.state
    shell = state.shell_m3(np.array([lowest]))[0]
    area = np.pi * state.radii_m[0] ** 2
    level = zero.value + (shell - base.value) / area
    below = former.height_m < lowest - 1e-9
    dips, volumes = former.height_m[below], former.volume_m3[below]
    flat = area * np.maximum(dips - level, 0.0)
    u = zero.u if np.isfinite(zero.u) else UNKNOWN_ZERO_M
    is_near = abs(level - zero.value) <= SURE * (u + geometry.expected_m3 / area)
    if is_near and np.all(np.abs(volumes - flat) < SURE * geometry.expected_m3):
        return level, None
    rows = _rising_rows([*zip(dips, volumes, strict=True), (lowest, max(base.value, 0.0))])
    # rounded down, so that the lowest dip does not lie above the shell
    floor = np.floor(min(zero.value, 0.0) / LEVEL_M) * LEVEL_M
    if (rows[0][0] > floor and rows[0][1] > 0) or len(rows) == 1:
        rows.insert(0, _extrapolate_row(rows, area, floor))
    return min(zero.value, lowest), np.array(rows)


def _rising_rows(rows):
    """Return rows of bottom.csv, from the last one down, whose volumes rise.

    Coarse rounding repeats volumes; a job refuses a bottom whose volumes do not rise.
    """
    kept = [rows[-1]]
    for dip, volume in reversed(rows[:-1]):
        if volume < kept[0][1] - LEAST_RISE_M3 or volume == kept[0][1] == 0:
            kept.insert(0, (dip, volume))
    return kept


def _extrapolate_row(rows, area_m2, floor_m):
    """Return (dip, volume) below the first row: at `floor_m`, or at the empty level above it.

    The two lowest rows are extrapolated; a single row is extrapolated with the area of the shell.
    """
    (low, first), slope = rows[0], area_m2
    if len(rows) > 1:
        slope = (rows[1][1] - first) / (rows[1][0] - low)
    if first <= 0:
        return low - EMPTY_BELOW_M, 0.0
    empty = low - first / slope
    if empty > floor_m:
        return empty, 0.0
    dip = min(floor_m, low - EMPTY_BELOW_M)
    return dip, max(slope * (dip - empty), 0.0)


SETTINGS = "job.toml"
COVARIANCE = "radii_cov.npz"
FILES = (
    *(SETTINGS, "courses.csv", "radii.csv", COVARIANCE, "bottom.csv", "deadwood.csv"),
    "uncertainty.csv",
)


def refuse_foreign_job(directory):
    """Raise InputError if `directory` contains files that `write_job` does not write."""
    refuse_foreign(directory, FILES)


def write_job(job, directory, language=DEFAULT):
    """Write the files of a `JobOfTable`, all or none.

    Parameters
    ----------
    job : JobOfTable
        Content of the job.
    directory : str or Path
        Folder of the job.
    language : str, optional
        Code of the language of the papers.

    Returns
    -------
    list of str
        Names of the files.
    """
    has_radii = job.covariance_m2 is not None
    names = [name for name in FILES if name in job.texts or (name == COVARIANCE and has_radii)]
    with replace_folder(directory) as folder:
        words = load_words(language)
        for name, text in job.texts.items():
            for item in job.words:  # messages in the text
                pair = (str(item), say(words, item))
                english, translation = (json.dumps(part, ensure_ascii=False)[1:-1] for part in pair)
                pattern = rf"(?<![\w-]){re.escape(english)}(?![\w-])"
                text = re.sub(pattern, lambda _, translation=translation: translation, text)
            if name == SETTINGS and language != DEFAULT:
                text = text.replace("[table]\n", f'[table]\nlanguage = "{language}"\n', 1)
            (folder / name).write_text(text, encoding="utf-8")
        if has_radii:
            np.savez(
                folder / COVARIANCE,
                covariance_m2=job.covariance_m2,
                courses=np.array(job.courses, dtype=str),
            )
    return names
