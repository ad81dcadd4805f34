"""Plausibility of single numbers: ranges and cross-checks of `tankcal.job.plausibility`."""

from tankcal.job.checks.plausible.shell import (
    check_dates,
    check_levels,
    check_material,
    check_plates,
)
from tankcal.job.checks.plausible.sizes import check_rings, check_sizes, check_targets

__all__ = ["check_plausible"]


def check_plausible(values, tables, extent, kind, raw, log):
    """Run every plausibility check; parameters as for `checks.check_tank`."""
    check_dates(values, raw, log)
    check_material(values, kind, raw, log)
    check_sizes(values, kind, raw, log)
    check_plates(values, tables, kind, raw, log)
    check_levels(values, tables, extent, kind, raw, log)
    check_targets(values, tables, log)
    if kind == "vertical":
        check_rings(values, tables["points"], tables["courses"], log)
