"""The part of the record that says what follows: table, corrections, budget, choices."""

import numpy as np

from tankcal.chain import corrections_of, shell_volume, thermal_scale
from tankcal.doubts import undeclared_inputs
from tankcal.shell import CRITICAL_W


def capacity_of(result):
    """The table and the factor of its covariance, each column named."""
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


def gross_of(result):
    """Volume and mean area of the shell as surveyed."""
    volume = float(result.gross.volume_m3(result.gross.height_m)[0])
    return {"volume_m3": volume, "area_m2": volume / result.gross.height_m}


def corrections_with_sizes(result):
    """Each correction with its size at full height: the volume with it less that without it."""
    job, shell = result.job, result.shell
    gross = gross_of(result)["volume_m3"]

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


def budget_of(result):
    """What contributes to the uncertainty of the top row."""
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


def choices_of(result):
    """Everything that was assumed, as codes and values."""
    job = result.job
    values = {
        "zero": "bottom" if job.datum.dip_plate_z_m is None else "dip_plate",
        "bottom": "flat_level",
        "covariance": _covariance_choice(job),
        "course_of_points": "section" if any(job.points.section) else "height",
        "shape": _one_or_mixed(section.outline.kind for section in result.sections),
        "between_sections": _between_sections(result),
        "tilt": "horizontal_cut" if result.shell.tilt_known else "not_determined",
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
        "form": "common",
        "not_in_budget": list(undeclared_inputs(job)),
        "covariance_sd_mm": 1000 * np.sqrt(np.median(result.covariance_m2.diagonal())),
    }
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
    constant = [course.degree == 0 for course in result.volume.courses]
    return "constant" if all(constant) else "mixed" if any(constant) else "polynomial"


def _one_or_mixed(values):
    found = set(values)
    return found.pop() if len(found) == 1 else "mixed"
