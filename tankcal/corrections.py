"""What each correction is worth: the tank with it less the tank without it, at the top row."""

from dataclasses import dataclass, fields, replace

import numpy as np

from tankcal.hydrostatics import STANDARD_GRAVITY
from tankcal.job import Switches
from tankcal.tanks import body_of, thermal_scale

NONE = Switches(**{field.name: field.name == "tilt" for field in fields(Switches)})


@dataclass(frozen=True)
class Correction:
    """One correction: its code, whether the table has it, its size, formula and source.

    size_m3  change of the capacity at the top row; of one that is switched off, what it would be
    """

    code: str
    applied: bool
    size_m3: float
    size_percent: float
    formula: str
    source: str


def corrections_of(job, survey):
    """Every correction that bears on the job, in the order in which they are made.

    Each size is that of the tank with this correction and those before it, less the tank without
    it. The tilt is in the surveyed sections already: its size is what a cut square to the axis
    would lack.
    """
    made, volume = NONE, _at_top(job, survey, NONE)
    found = []
    reference = volume
    for code, bears, formula, source in _known(job, survey):
        if not bears:
            continue
        if code == "tilt":
            found.append(_tilt(job, survey, reference, formula, source))
            continue
        with_it = _at_top(job, survey, replace(made, **{code: True}))
        size = with_it - volume
        on = getattr(job.switches, code)
        if on:
            made, volume = replace(made, **{code: True}), with_it
        found.append(Correction(code, on, size, 100 * size / reference, formula, source))
    return tuple(found)


def _at_top(job, survey, switches):
    body = body_of(job, survey, switches, uncertain=False)
    return float(body.volume_m3(np.array([body.highest_m]))[0])


def _tilt(job, wall, volume, formula, source):
    share = float(1 - 1 / np.hypot(1.0, wall.shell.tilt))
    return Correction("tilt", job.switches.tilt, volume * share, 100 * share, formula, source)


def _known(job, survey):
    """(code, whether it bears on the job, formula, source) of each correction, in their order."""
    of_shell = _of_shell(job, survey) if job.tank.kind == "vertical" else ()
    deadwood = ("deadwood", bool(job.deadwood), "sum of the declared volumes", "ISO 7507-1")
    return [*_of_lengths(job), *of_shell, deadwood]


def _of_lengths(job):
    outside = job.survey.side == "outside"
    solid = job.horizontal or job.sphere
    plates = any(c.thickness_m for c in job.courses) or (solid and solid.thickness_m)
    scale = thermal_scale(job, Switches())
    lengths = (
        "all lengths" if job.table.height_expansion or not job.courses else "horizontal lengths"
    )
    return (
        ("plate", outside and bool(plates), "r_inside = r - t", "ISO 7507-1"),
        (
            "paint",
            outside and any(c.paint_m for c in job.courses),
            "r_inside = r - t - paint",
            "ISO 7507-1",
        ),
        (
            "temperature",
            job.survey.shell_temperature_c is not None,
            f"{lengths} times 1 + a (T_ref - T_shell) = {scale:.8f}",
            "ISO 7507-1",
        ),
    )


def _of_shell(job, wall):
    survey, table, roof = job.survey, job.table, job.roof
    head = (
        f"dr = rho g (h - z) r^2/(E t), g = {STANDARD_GRAVITY} m/s2; "
        f"table {table.liquid_density_kg_m3:g} kg/m3, survey "
        f"{survey.liquid_density_kg_m3 or 0:g} kg/m3 to {survey.liquid_level_m or 0:g} m"
    )
    return (
        (
            "tilt",
            bool(wall.shell.tilt),
            "horizontal cut: area of the cut square to the axis times sqrt(1 + m^2); contained",
            "ISO 7507-1",
        ),
        (
            "head",
            bool(table.liquid_density_kg_m3 or survey.liquid_density_kg_m3),
            head,
            "ISO 7507-1; API MPMS 2.2",
        ),
        ("bottom", job.bottom.form != "flat", BOTTOM_FORMULAS[job.bottom.form], "ISO 7507-1"),
        ("roof", roof is not None, _roof_formula(roof), "ISO 7507-1; API MPMS 2.2"),
    )


BOTTOM_FORMULAS = {
    "flat": "none",
    "leaning": "plane square to the leaning axis of the shell",
    "cone": "pi r^2 H/3 for a round shell; the shell's own outline is taken",
    "dish": "pi H (3 r^2 + H^2)/6 for a round shell; the shell's own outline is taken",
    "points": "volume between the surveyed surface and the plane of the bottom of the shell",
    "liquid": "measured volumes up to the highest measured level, increments of the shell above it",
}


def _roof_formula(roof):
    if roof is None:
        return ""
    if roof.weighing == "vacuum":
        return "-m/rho_ref"
    return "-m (1 - 1.2/8000)/(rho_ref - 1.2), weighed in air"
