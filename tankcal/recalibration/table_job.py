"""A job that can be run, made of what a former table says of its tank."""

import datetime
import json
from dataclasses import dataclass

import numpy as np

from tankcal.messages import message
from tankcal.recalibration.solid_geometry import declared_sizes, declared_uncertainties

USUAL_TEMPERATURE_C = 20.0
UNKNOWN_ZERO_M = 0.02
LOWEST_THING_M = 2e-4  # height of a thing in deadwood.csv, whose dips have four decimals
LEAST_RISE_M3 = 1e-6  # between rows of bottom.csv, whose volumes have six decimals
LEVEL_M = 1e-5  # last digit of the dips in bottom.csv
EMPTY_BELOW_M = 0.001  # of a first row without volume
SURE = 3.0  # standard uncertainties, within which a bottom is flat and a zero is at the bottom


@dataclass(frozen=True)
class JobOfTable:
    """The files of a job.

    Attributes
    ----------
    texts : dict of {str: str}
        job.toml and CSV files.
    covariance_m2 : ndarray, shape (n, n), or None
        Of the radii, for radii_cov.npz.
    courses : tuple of str
        What it is of.
    words : tuple of Message
        What `texts` say in words, as it stands there: to be said in the language of the job.
    """

    texts: dict
    covariance_m2: np.ndarray
    courses: tuple[str, ...]
    words: tuple = ()


def job_of_geometry(former, found, names, *, u_common_m, e_pa, tank_id):
    """The `JobOfTable` of an `UprightGeometry`.

    Parameters
    ----------
    former : FormerTable
    found : UprightGeometry
    names : sequence of str
        Of the courses.
    u_common_m : float
        Standard uncertainty that all radii have in common, as the former table was made.
    e_pa : float
    tank_id : str
    """
    density = 0.0 if found.head == "without" else found.state.density_kg_m3
    zero, bottom = _bottom(former, found)
    heights = found.heights_m + np.eye(1, len(found.heights_m))[0] * (found.zero_m.value - zero)
    note = message("job_read_from", "read from {name}", name=str(former.name))
    settings = _settings(
        former,
        tank_id=tank_id,
        diameter=2 * float(found.radii_m[0]),
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
        **_wall(names, heights, found.thickness_m, found.radii_m),
    }
    if bottom is not None:
        texts["bottom.csv"] = _csv(("level_m", "volume_m3"), bottom, (5, 6))
    things = _deadwood(found, zero + float(np.sum(heights)))
    names_of_things = [
        message("job_thing", "thing-{number}", number=k) for k in range(1, len(things) + 1)
    ]
    if things:
        rows = [(name, *thing) for name, thing in zip(names_of_things, things, strict=True)]
        heading = ("name", "bottom_m", "top_m", "volume_m3", "u_m3")
        texts["deadwood.csv"] = "\n".join(map(",".join, [heading, *rows])) + "\n"
    if found.state.bulges_m is not None:
        texts["uncertainty.csv"] = _profiles(found.state.bulges_m)
    words = (note, *names_of_things)
    return JobOfTable(texts, found.covariance_m2, tuple(names), words)


def job_of_record(former, radii, *, tank_id):
    """The `JobOfTable` of `RecordedRadii`."""
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
    return JobOfTable(
        {"job.toml": settings + _roof(former), **wall}, radii.covariance_m2, radii.names, (note,)
    )


def job_of_solid(former, fit, *, tank_id):
    """The `JobOfTable` of a `SolidFit`: a job of declared sizes."""
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
    for name, keys in ({"tank": tank} | declared_sizes(fit) | {"table": table}).items():
        lines.append(f"[{name}]")
        for key, value in keys.items():
            lines.append(f"{key} = {_text(value) if isinstance(value, str) else value}")
        lines.append("")
    lines += ["[survey]", 'side = "inside"', f"date = {_day(former)}"]
    lines += [f"shell_temperature_c = {_temperature(former)}", ""]  # that the sizes are at
    texts = {"job.toml": "\n".join(lines)}
    rows = [
        ",".join(str(row[key]) for key in ("input", "u", "unit"))
        for row in declared_uncertainties(fit, former)
    ]
    if rows:
        texts["uncertainty.csv"] = "\n".join(["input,u,unit", *rows]) + "\n"
    return JobOfTable(texts, None, ())


def _temperature(former):
    known = former.reference_temperature_c
    return USUAL_TEMPERATURE_C if known is None else known


def _day(former):
    return former.date if _is_date(former.date) else datetime.date.today().isoformat()


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


def _is_date(text):
    return isinstance(text, str) and len(text) == 10 and text[4] == text[7] == "-"


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
    names = [_cell(name) for name in names]
    courses = ["course,height_m,thickness_mm"]
    courses += [
        f"{name},{height:.5f},{1000 * plate:.6g}"
        for name, height, plate in zip(names, heights, plates, strict=True)
    ]
    rows = ["course,radius_m"]
    rows += [f"{name},{radius:.7f}" for name, radius in zip(names, radii, strict=True)]
    return {"courses.csv": "\n".join(courses) + "\n", "radii.csv": "\n".join(rows) + "\n"}


def _cell(name):
    return f'"{name}"' if "," in name else name


def _csv(heading, rows, decimals):
    lines = [",".join(heading)]
    for row in rows:
        lines.append(",".join(f"{v:.{d}f}" for v, d in zip(row, decimals, strict=True)))
    return "\n".join(lines) + "\n"


def _profiles(bulges_m):
    """uncertainty.csv of the profiles that the table shows: the job has straight courses."""
    barrel = 1.5 * np.sqrt(np.mean(np.sum(bulges_m[:, 1::2] ** 2, axis=1)))
    taper = np.sqrt(np.mean(np.sum(bulges_m[:, ::2] ** 2, axis=1)))
    rows = [f"{name},{1000 * u:.3g},mm" for name, u in (("barrel", barrel), ("taper", taper))]
    return "\n".join(["input,u,unit", *rows]) + "\n"


def _deadwood(found, top_m):
    """Rows of deadwood.csv: bottom, top, volume, u of each thing within the rows that were used.

    The volume below the lowest row that was used belongs to the bottom, and a table does not show
    what is above its last row: the part of a thing there is left out.
    """
    rows = []
    for one in found.fittings:
        low, high = max(one.bottom_m.value, found.lowest_m), min(one.top_m.value, top_m)
        share = (high - low) / max(one.top_m.value - one.bottom_m.value, 1e-9)
        if high - low > LOWEST_THING_M:
            volume, u = share * one.volume_m3.value, share * one.volume_m3.u
            rows.append((f"{low:.4f}", f"{high:.4f}", f"{volume:.5f}", f"{u:.5f}"))
    return rows


def _bottom(former, found):
    """Dip of the bottom of the first ring, and what lies below the lowest row that was used.

    The bottom is flat where the zero may be so placed that it explains every row: then it is there,
    and the second is None. Else they are (rows, 2) dips and volumes up to that row.
    """
    base, lowest, zero, state = found.base_m3, found.lowest_m, found.zero_m, found.state
    shell = state.shell_m3(np.array([lowest]))[0]
    area = np.pi * state.radii_m[0] ** 2
    level = zero.value + (shell - base.value) / area
    below = former.height_m < lowest - 1e-9
    dips, volumes = former.height_m[below], former.volume_m3[below]
    flat = area * np.maximum(dips - level, 0.0)
    u = zero.u if np.isfinite(zero.u) else UNKNOWN_ZERO_M
    is_near = abs(level - zero.value) <= SURE * (u + found.expected_m3 / area)
    if is_near and np.all(np.abs(volumes - flat) < SURE * found.expected_m3):
        return level, None
    rows = _rising([*zip(dips, volumes, strict=True), (lowest, max(base.value, 0.0))])
    floor = np.floor(min(zero.value, 0.0) / LEVEL_M) * LEVEL_M  # not above the shell when rounded
    if (rows[0][0] > floor and rows[0][1] > 0) or len(rows) == 1:
        rows.insert(0, _row_below(rows, area, floor))
    return min(zero.value, lowest), np.array(rows)


def _rising(rows):
    """Rows of bottom.csv, from the last one down, without those that are not below the next row.

    Coarse rounding repeats volumes, and a job refuses a bottom whose volumes do not rise.
    """
    kept = [rows[-1]]
    for dip, volume in reversed(rows[:-1]):
        if volume < kept[0][1] - LEAST_RISE_M3 or volume == kept[0][1] == 0:
            kept.insert(0, (dip, volume))
    return kept


def _row_below(rows, area_m2, floor_m):
    """(dip, volume) below the first row: at the dip `floor_m`, or above it where the tank is empty.

    The two lowest rows are extended; a single row by the area of the shell.
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
