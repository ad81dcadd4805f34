"""From a result to its record, part by part."""

import platform
from dataclasses import asdict

import numpy as np
import scipy

import tankcal
from tankcal.record import FORMAT
from tankcal.record.parts import bottom_of, deadwood_of, roof_of, solid_of
from tankcal.record.survey import courses_of, points_of, rejected_of, sections_of, shell_of
from tankcal.record.table import (
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
            "warnings": [
                {"file": w.file, "row": w.row, "column": w.column, "text": w.expected}
                for w in result.warnings
            ],
            "adjustment": None,
            "deliveries": None,
            "monte_carlo": None,
        }
    )


def _job(job):
    return {
        "tank": asdict(job.tank),
        "survey": asdict(job.survey),
        "datum": asdict(job.datum),
        "table": asdict(job.table),
        "material": asdict(job.material),
        "courses": [asdict(course) for course in job.courses],
        "corrections": asdict(job.switches),
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
