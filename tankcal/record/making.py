"""From a result to its record, part by part."""

import platform
from dataclasses import asdict

import numpy as np
import scipy

import tankcal
from tankcal.record import FORMAT
from tankcal.record.adjustment import adjustment_of
from tankcal.record.parts import bottom_of, deadwood_of, roof_of, solid_of
from tankcal.record.survey import (
    adjustment_in,
    courses_of,
    points_of,
    points_of_adjustment,
    rejected_of,
    sections_of,
    shell_of,
)
from tankcal.record.table import (
    adjustment_choices,
    budget_of,
    capacity_of,
    choices_of,
    densities_of,
    gross_of,
    interpolation_of,
    proportional_parts_of,
)


def record_of(result):
    """The record of a `chain.Result`: a dict of plain numbers, texts and lists."""
    adjustment = adjustment_in(result)
    return _plain(
        {
            **_beginning(result.job),
            "shell": shell_of(result),
            "points": points_of(result),
            "rejected": rejected_of(result),
            "sections": sections_of(result),
            "courses": courses_of(result),
            "capacity": capacity_of(result),
            "interpolation": interpolation_of(result),
            "proportional_parts": proportional_parts_of(result),
            "densities": densities_of(result),
            "gross": gross_of(result),
            "corrections": [asdict(correction) for correction in result.corrections],
            "solid": solid_of(result),
            "bottom": bottom_of(result),
            "deadwood": deadwood_of(result),
            "roof": roof_of(result),
            "budget": budget_of(result),
            "choices": choices_of(result),
            "warnings": _warnings(result.warnings),
            "adjustment": adjustment and adjustment_of(adjustment, result.job.measurements),
            "deliveries": None,
            "monte_carlo": None,
        }
    )


def record_of_adjustment(job, adjustment):
    """The record of a survey that was only adjusted: what a tank has is null or empty."""
    measurements = getattr(job, "measurements", None)
    return _plain(
        {
            **_beginning(job),
            **dict.fromkeys(_OF_A_TANK),
            **{key: [] for key in _LISTS_OF_A_TANK},
            "points": points_of_adjustment(adjustment),
            "choices": [
                {"code": code, "value": value}
                for code, value in adjustment_choices(adjustment, measurements).items()
            ],
            "warnings": _warnings(dict.fromkeys((*job.warnings, *adjustment.warnings))),
            "adjustment": adjustment_of(adjustment, measurements),
        }
    )


_OF_A_TANK = (
    "shell", "capacity", "interpolation", "proportional_parts", "gross", "solid", "bottom", "roof",
    "deliveries", "monte_carlo",
)  # fmt: skip
_LISTS_OF_A_TANK = (
    "rejected", "sections", "courses", "densities", "corrections", "deadwood", "budget",
)  # fmt: skip


def _beginning(job):
    return {
        "format": FORMAT,
        "tankcal": tankcal.__version__,
        "versions": {
            "python": platform.python_version(),
            "numpy": np.__version__,
            "scipy": scipy.__version__,
        },
        "files": [asdict(file) for file in job.files],
        "job": _job(job),
    }


def _warnings(problems):
    return [
        {"file": w.file, "row": w.row, "column": w.column, "text": w.expected} for w in problems
    ]


def _job(job):
    parts = {
        "tank": job.tank,
        "survey": job.survey,
        "datum": job.datum,
        "table": job.table,
        "material": job.material,
        "corrections": job.switches,
    }
    return {
        **{name: None if part is None else asdict(part) for name, part in parts.items()},
        "courses": [asdict(course) for course in job.courses],
        "certificate": job.certificate,
        "source": job.source,
    }


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
