"""From a result to its record, part by part."""

import platform
from dataclasses import asdict

import numpy as np
import scipy

import tankcal
from tankcal.messages import as_plain
from tankcal.record import FORMAT
from tankcal.record.adjustment import adjustment_of
from tankcal.record.parts import bottom_of, deadwood_of, roof_of, solid_of
from tankcal.record.plain_data import plain, plain_problems
from tankcal.record.statements import budget_of, budgets_of, deliveries_of, monte_carlo_of, rule_of
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
    return plain(
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
            "corrections": [_correction(one) for one in result.corrections],
            "solid": solid_of(result),
            "bottom": bottom_of(result),
            "deadwood": deadwood_of(result),
            "roof": roof_of(result),
            "budget": budget_of(result),
            "choices": choices_of(result),
            "warnings": plain_problems(result.warnings),
            "adjustment": adjustment and adjustment_of(adjustment, result.job.measurements),
            "budgets": budgets_of(result),
            "deliveries": deliveries_of(result),
            "rule": rule_of(result),
            "monte_carlo": monte_carlo_of(result),
        }
    )


def record_of_adjustment(job, adjustment):
    """The record of a survey that was only adjusted: what a tank has is null or empty."""
    measurements = getattr(job, "measurements", None)
    return plain(
        {
            **_beginning(job),
            **dict.fromkeys(_OF_A_TANK),
            **{key: [] for key in _LISTS_OF_A_TANK},
            "points": points_of_adjustment(adjustment),
            "choices": [
                {"code": code, "value": value}
                for code, value in adjustment_choices(adjustment, measurements).items()
            ],
            "warnings": plain_problems(dict.fromkeys((*job.warnings, *adjustment.warnings))),
            "adjustment": adjustment_of(adjustment, measurements),
        }
    )


_OF_A_TANK = (
    "shell", "capacity", "interpolation", "proportional_parts", "gross", "solid", "bottom", "roof",
    "rule", "monte_carlo",
)  # fmt: skip
_LISTS_OF_A_TANK = (
    "rejected", "sections", "courses", "densities", "corrections", "deadwood", "budget",
    "budgets", "deliveries",
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


def _correction(one):
    said = as_plain(one.formula)
    return {**asdict(one), "formula_code": said["code"], "formula_values": said["values"]}


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
