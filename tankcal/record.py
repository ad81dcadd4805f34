"""The record: all that workbook and report need, as plain data (docs/record-format.md)."""

import json
import platform
from dataclasses import asdict
from pathlib import Path

import numpy as np
import scipy

import tankcal
from tankcal.chain import corrections_of, noise_is_estimated, shell_volume, thermal_scale
from tankcal.errors import InputError, Problem
from tankcal.shell import CRITICAL_W

FORMAT = "tankcal-record/1"
DECLARABLE = ("scale", "datum", "plate_thickness", "paint", "shell_temperature", "expansion")


def record_of(result):
    """The record of a `chain.Result`: a dict of plain numbers, texts and lists."""
    return _plain(
        {
            "format": FORMAT,
            "tankcal": tankcal.__version__,
            "versions": {
                "python": platform.python_version(),
                "numpy": np.__version__,
                "scipy": scipy.__version__,
            },
            "files": [asdict(file) for file in result.job.files],
            "job": _job(result.job),
            "shell": _shell(result),
            "points": _points(result),
            "rejected": _rejected(result),
            "sections": [_section(result, section) for section in result.sections],
            "courses": _courses(result),
            "capacity": _capacity(result),
            "gross": _gross(result),
            "corrections": _corrections(result),
            "budget": _budget(result),
            "choices": _choices(result),
            "warnings": [
                {"file": w.file, "row": w.row, "column": w.column, "text": w.expected}
                for w in result.warnings
            ],
            "adjustment": None,
            "deliveries": None,
            "monte_carlo": None,
        }
    )


def save(record, path):
    """Write a record as UTF-8 JSON."""
    text = json.dumps(record, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    Path(path).write_text(text + "\n", encoding="utf-8")


def load(path):
    """Read a record; raises InputError when it is no record of this format."""
    name = Path(path).name
    try:
        record = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(Problem(name, f"cannot be read as a record: {error}")) from error
    found = record.get("format") if isinstance(record, dict) else None
    if found != FORMAT:
        raise InputError(Problem(name, f"found format {found!r}, expected {FORMAT!r}"))
    return record


def _job(job):
    return {
        "tank": asdict(job.tank),
        "survey": asdict(job.survey),
        "datum": asdict(job.datum),
        "table": asdict(job.table),
        "material": asdict(job.material),
        "courses": [asdict(course) for course in job.courses],
        "certificate": job.certificate,
        "source": job.source,
    }


def _shell(result):
    shell, sections = result.shell, result.sections
    residuals = np.concatenate([section.circle.residuals_m for section in sections])
    estimated = noise_is_estimated(result.job)
    return {
        "x_m": shell.axis_m[0],
        "y_m": shell.axis_m[1],
        "z_m": shell.z_m,
        "slope_x": shell.slope[0],
        "slope_y": shell.slope[1],
        "tilt": shell.tilt,
        "tilt_sd": shell.tilt_sd,
        "tilt_azimuth_deg": np.degrees(shell.tilt_azimuth_rad),
        "residual_sd_m": np.sqrt(np.sum(residuals**2) / (len(residuals) - 3 * len(sections))),
        "points": len(shell.reason),
        "accepted": len(result.wall),
        "noise_sd_m": np.sqrt(result.covariance_m2.diagonal().mean()) if estimated else None,
        "noise_dof": result.noise.dof if estimated else None,
        "height_m": result.volume.height_m,
    }


def _points(result):
    job, shell = result.job, result.shell
    place = {}
    for section in result.sections:
        for member, residual in zip(section.group.members, section.circle.residuals_m, strict=True):
            place[result.wall[member]] = (section.group, residual, member)
    rows = []
    for index, name in enumerate(job.points.names):
        group, residual, member = place.get(index, (None, None, None))
        rows.append(
            {
                "point": name,
                **_coordinates(job.points.xyz_m[index]),
                "cov_m2": None if group is None else _covariance_of(result, member),
                "course": job.courses[group.course].name if group else None,
                "section": group.name if group else None,
                "residual_m": residual,
                "used": shell.reason[index] == "",
            }
        )
    return rows


def _covariance_of(result, member):
    block = result.covariance_m2[3 * member : 3 * member + 3][:, 3 * member : 3 * member + 3]
    return block if isinstance(block, np.ndarray) else block.toarray()


def _coordinates(xyz):
    return dict(zip(("x_m", "y_m", "z_m"), xyz, strict=True))


def _rejected(result):
    job, shell = result.job, result.shell
    return [
        {
            "point": job.points.names[i],
            **_coordinates(job.points.xyz_m[i]),
            "residual_m": shell.residual_m[i],
            "w": shell.w[i],
            "reason": shell.reason[i],
            "row": job.points.rows[i],
        }
        for i in np.flatnonzero(shell.reason != "")
    ]


def _section(result, section):
    circle, outline, group = section.circle, section.outline, section.group
    sd = np.sqrt(np.diag(circle.cofactor_m2))
    xyz = result.job.points.xyz_m[result.wall[group.members]]
    height = xyz[:, 2] - result.job.datum.bottom_z_m - group.height_m
    offset = xyz[:, :2] - np.outer(height, result.shell.slope) - (circle.x_m, circle.y_m)
    modes = outline.modes_m()
    return {
        "section": group.name,
        "course": result.job.courses[group.course].name,
        "height_m": group.height_m,
        "n": len(group.members),
        "x_m": circle.x_m,
        "y_m": circle.y_m,
        "x_sd_m": sd[0],
        "y_sd_m": sd[1],
        "radius_m": circle.radius_m,
        "radius_sd_m": sd[2],
        "variance_factor": circle.variance_factor,
        "shape": outline.kind,
        "points": [result.job.points.names[i] for i in result.wall[group.members]],
        "azimuth_deg": np.degrees(np.arctan2(offset[:, 0], offset[:, 1])) % 360,
        "residual_m": circle.residuals_m,
        "area_m2": outline.area_m2(),
        "area_sd_m2": _area_sd(result, section),
        "outline": {
            "azimuth_deg": np.arange(360.0),
            "radius_m": outline.radius_m(np.radians(np.arange(360.0))),
        },
        "modes": [
            {
                "k": k,
                "amplitude_m": np.hypot(*modes[k]),
                "azimuth_deg": np.degrees(np.arctan2(modes[k, 1], modes[k, 0])) / k % (360 / k),
            }
            for k in range(2, len(modes))
        ],
    }


def _area_sd(result, section):
    azimuth, weight = section.outline.nodes()
    gradient = (section.outline.radius_m(azimuth) * weight) @ section.outline.basis(azimuth)
    by_points = gradient @ section.parameters_by_points
    index = (3 * section.group.members[:, None] + np.arange(3)).ravel()
    form = gradient @ section.outline.form_factor_m
    return np.sqrt(by_points @ (result.covariance_m2[index][:, index] @ by_points) + form @ form)


def _courses(result):
    job, rows = result.job, []
    rejected = np.flatnonzero(np.isin(result.shell.reason, ("consensus", "snooping")))
    bottom = job.datum.bottom_z_m
    for index, (course, shape) in enumerate(zip(job.courses, result.volume.courses, strict=True)):
        own = [section for section in result.sections if section.group.course == index]
        height = shape.top_m - shape.bottom_m
        volume, u = _partial(result, shape.bottom_m, shape.top_m)
        in_course = [
            bottom + shape.bottom_m <= job.points.xyz_m[i, 2] < bottom + shape.top_m
            for i in rejected
        ]
        rows.append(
            {
                "course": course.name,
                "bottom_m": shape.bottom_m,
                "top_m": shape.top_m,
                "height_m": course.height_m,
                "thickness_m": course.thickness_m,
                "paint_m": course.paint_m,
                "sections": [section.group.name for section in own],
                "points": sum(len(section.group.members) for section in own),
                "rejected": sum(in_course),
                "radius_m": np.mean([section.circle.radius_m for section in own]),
                "radius_sd_m": _mean_radius_sd(own),
                "inside_radius_m": np.sqrt(volume / height / np.pi),
                "area_m2": volume / height,
                "area_sd_m2": u / height,
                "volume_m3": volume,
                "u_m3": u,
            }
        )
    return rows


def _mean_radius_sd(sections):
    return np.sqrt(sum(s.circle.cofactor_m2[2, 2] for s in sections)) / len(sections)


def _partial(result, low_m, high_m):
    """Volume between two heights above the bottom and its standard uncertainty, exactly."""
    volume = result.volume.volume_m3([low_m, high_m])
    sources = result.propagation.sources([low_m, high_m])
    variance = sum(np.sum(np.diff(source.columns_m3, axis=0) ** 2) for source in sources)
    return volume[1] - volume[0], np.sqrt(variance)


def _capacity(result):
    table = result.table
    kinds = [source.kind for source in table.sources for _ in range(source.columns_m3.shape[1])]
    counts = {kind: kinds.count(kind) for kind in kinds}
    numbers = [kinds[: i + 1].count(kind) for i, kind in enumerate(kinds)]
    return {
        "zero": "bottom" if result.job.datum.dip_plate_z_m is None else "dip_plate",
        "zero_m": result.zero_m,
        "height_m": table.height_m,
        "volume_m3": table.volume_m3,
        "u_m3": table.u_m3,
        "U_m3": table.U_m3,
        "k": table.k,
        "dof": table.dof,
        "area_m2": table.area_m2,
        "inputs": [
            kind if counts[kind] == 1 else f"{kind} {number}"
            for kind, number in zip(kinds, numbers, strict=True)
        ],
        "input_kind": kinds,
        "factor_m3": table.factor_m3,
    }


def _gross(result):
    volume = float(result.gross.volume_m3(result.gross.height_m)[0])
    return {"volume_m3": volume, "area_m2": volume / result.gross.height_m}


def _corrections(result):
    """Each correction with its size at full height: the volume with it less that without it."""
    job, shell = result.job, result.shell
    gross = _gross(result)["volume_m3"]

    def full(**switched_on):
        off = dict.fromkeys(("plate", "paint", "temperature"), False) | switched_on
        volume = shell_volume(
            job.courses, result.joints_m, result.sections, **corrections_of(job, **off)
        )
        return float(volume.volume_m3(volume.height_m)[0])

    plate = full(plate=True)
    both = full(plate=True, paint=True)
    outside = job.survey.side == "outside"
    tilt = gross * (1 - 1 / np.hypot(1.0, shell.tilt))
    rows = [
        (
            "plate",
            outside and any(course.thickness_m for course in job.courses),
            plate - gross,
            "r_inside = r - t, per course",
            "ISO 7507-1",
        ),
        (
            "paint",
            outside and any(course.paint_m for course in job.courses),
            both - plate,
            "r_inside = r - t - paint, per course",
            "ISO 7507-1",
        ),
        (
            "temperature",
            job.survey.shell_temperature_c is not None,
            full(plate=True, paint=True, temperature=True) - both,
            f"horizontal lengths times 1 + a (T_ref - T_shell) = {thermal_scale(job):.8f}",
            "ISO 7507-1",
        ),
        (
            "tilt",
            True,
            tilt,
            "horizontal cut: area of the cut square to the axis times sqrt(1 + m^2); contained",
            "ISO 7507-1",
        ),
    ]
    return [
        {
            "code": code,
            "applied": bool(applied),
            "size_m3": size,
            "size_percent": 100 * size / gross,
            "formula": formula,
            "source": source,
        }
        for code, applied, size, formula, source in rows
    ]


def _budget(result):
    table = result.table
    total = table.u_m3[-1] ** 2
    rows = []
    for source in table.sources:
        contribution = float(np.sqrt(np.sum(source.columns_m3[-1] ** 2)))
        declared = source.u is not None
        known = declared and source.u > 0
        rows.append(
            {
                "input": source.kind,
                "kind": source.kind,
                "u": source.u,
                "unit": source.unit,
                "type": source.type,
                "distribution": source.distribution,
                "dof": source.dof,
                "sensitivity": float(source.columns_m3[-1, 0]) / source.u if known else None,
                "sensitivity_unit": _sensitivity_unit(source.unit) if declared else None,
                "contribution_m3": contribution,
                "share": contribution**2 / total if total > 0 else 0.0,
                "note": source.note,
            }
        )
    return rows


def _sensitivity_unit(unit):
    return "m3 K" if unit == "1/K" else f"m3/{unit}"


def _choices(result):
    job = result.job
    values = {
        "zero": "bottom" if job.datum.dip_plate_z_m is None else "dip_plate",
        "bottom": "flat_level",
        "covariance": _covariance_choice(job),
        "course_of_points": "section" if any(job.points.section) else "height",
        "shape": _one_or_mixed(section.outline.kind for section in result.sections),
        "between_sections": _between_sections(result),
        "tilt": "horizontal_cut",
        "course_heights": "along_axis",
        "thickness": _thickness_choice(job),
        "temperature": "not_applied" if job.survey.shell_temperature_c is None else "applied",
        "height_expansion": "no",
        "head": "none",
        "deadwood": "none",
        "roof": "none",
        "interpolation": "linear",
        "coverage": job.table.coverage_probability,
        "k": "normal" if np.all(np.isinf(result.table.dof)) else "student",
        "expansion": "given" if job.material.expansion_given else "default",
        "snooping": CRITICAL_W if job.snooping else "off",
        "not_in_budget": [
            name for name in DECLARABLE if name not in {declared.name for declared in job.inputs}
        ],
    }
    if noise_is_estimated(job):
        values["covariance_sd_mm"] = 1000 * np.sqrt(result.covariance_m2.diagonal().mean())
    return [{"code": code, "value": value} for code, value in values.items()]


def _covariance_choice(job):
    if job.points.sd_m is None and job.points.covariance_m2 is None:
        return "estimated"
    given = "given_sd" if job.points.covariance_m2 is None else "given_full"
    return given + "_scaled" if job.scale == "a_posteriori" else given


def _thickness_choice(job):
    if job.survey.side == "inside":
        return "inside"
    return "subtracted" if any(c.thickness_m + c.paint_m for c in job.courses) else "none"


def _between_sections(result):
    degrees = {course.degree for course in result.volume.courses}
    return "constant" if degrees == {0} else "polynomial"


def _one_or_mixed(values):
    found = set(values)
    return found.pop() if len(found) == 1 else "mixed"


def _plain(value):
    """Plain Python data: arrays as lists, and null for what is not a finite number."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
