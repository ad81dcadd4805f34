"""What each correction is worth: the tank with it less the tank without it, at the top row."""

from dataclasses import dataclass, fields, replace

import numpy as np

from tankcal.job import Switches
from tankcal.messages import Message, message
from tankcal.pipeline.tanks import as_declared, body_of, thermal_scale
from tankcal.tank.hydrostatics import STANDARD_GRAVITY

# Named by title and edition alone: the bodies of paid standards were not read, so no clause is.
ISO_7507 = "ISO 7507-1:2003"
ISO_4269 = "ISO 4269:2001"
TIMOSHENKO = "Timoshenko & Woinowsky-Krieger, Theory of Plates and Shells"
INSIDE_PLATE = message("inside_plate", "r_inside = r − t")
INSIDE_PAINT = message("inside_paint", "r_inside = r − t − paint")
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
    formula: Message
    source: str


def corrections_of(job, survey, over_m=0.0):
    """Every correction that bears on the job, in the order in which they are made.

    over_m  how far the top row, a whole millimetre, stands above the top of the tank

    Each size is that of the tank with this correction and those before it, less the tank without
    it. The tilt is in the surveyed sections already: its size is what a cut square to the axis
    would lack.
    """
    job = as_declared(job)
    made, volume = NONE, _at_top(job, survey, NONE, over_m)
    found = []
    reference = volume
    for code, bears, formula, source in _known(job, survey):
        if not bears:
            continue
        if code == "tilt":
            found.append(_tilt(job, survey, reference, formula, source))
            continue
        with_it = _at_top(job, survey, replace(made, **{code: True}), over_m)
        size = with_it - volume
        on = getattr(job.switches, code)
        if on:
            made, volume = replace(made, **{code: True}), with_it
        found.append(Correction(code, on, size, 100 * size / reference, formula, source))
    return tuple(found)


def correction_by_liquid(corrections, gross_m3, top_m3):
    """The `Correction` that metered runs make at the top row: what is left of the others' sum.

    Parameters
    ----------
    corrections : tuple of Correction
    gross_m3, top_m3 : float
        At the top row: without any correction, and of the table.
    """
    made = sum(one.size_m3 for one in corrections if one.applied and one.code != "tilt")
    size = top_m3 - gross_m3 - made
    formula = message("by_liquid", "adjusted together with the metered volumes")
    return Correction("liquid", True, size, 100 * size / gross_m3, formula, ISO_4269)


def gross_at_top(job, survey, over_m=0.0):
    """Volume at the top row without any correction, m3."""
    return _at_top(job, survey, NONE, over_m)


def _at_top(job, survey, switches, over_m):
    body = body_of(job, survey, switches, uncertain=False)
    return float(body.volume_m3(np.array([body.highest_m + over_m]))[0])


def _tilt(job, wall, volume, formula, source):
    share = float(1 - 1 / np.hypot(1.0, wall.shell.tilt))
    return Correction("tilt", job.switches.tilt, volume * share, 100 * share, formula, source)


def _known(job, survey):
    """(code, whether it bears on the job, formula, source) of each correction, in their order."""
    of_shell = _of_shell(job, survey) if job.tank.kind == "vertical" else ()
    if job.tank.kind == "sphere":
        of_shell = (_of_pressure(job),)
    declared = message("sum_of_volumes", "sum of the declared volumes")
    deadwood = ("deadwood", bool(job.deadwood), declared, ISO_7507)
    return [*_of_lengths(job), *of_shell, deadwood]


def _of_lengths(job):
    outside = job.survey.side == "outside"
    solid = job.horizontal or job.sphere
    parts = job.courses or job.rings
    plates = any(c.thickness_m for c in parts) or (solid and solid.thickness_m)
    return (
        ("plate", outside and bool(plates), INSIDE_PLATE, ISO_7507),
        (
            "paint",
            outside and any(c.paint_m for c in parts),
            INSIDE_PAINT,
            ISO_7507,
        ),
        (
            "temperature",
            job.survey.shell_temperature_c is not None,
            _thermal_formula(job),
            ISO_7507,
        ),
    )


def _thermal_formula(job):
    scale = thermal_scale(job, Switches())
    if job.table.height_expansion or not job.courses:
        template = "all lengths times 1 + α (T_ref − T_shell) = {scale:.8f}"
        return message("all_lengths", template, scale=scale)
    template = "horizontal lengths times 1 + α (T_ref − T_shell) = {scale:.8f}"
    return message("horizontal_lengths", template, scale=scale)


def _of_shell(job, wall):
    survey, table, roof = job.survey, job.table, job.roof
    head = message(
        "liquid_head",
        "Δr = ρ g (h − z) r²/(E t), g = {g_m_s2:g} m/s²; table {table_kg_m3:g} kg/m³, survey"
        " {survey_kg_m3:g} kg/m³ to {level_m:g} m",
        g_m_s2=STANDARD_GRAVITY,
        table_kg_m3=table.liquid_density_kg_m3,
        survey_kg_m3=survey.liquid_density_kg_m3 or 0,
        level_m=survey.liquid_level_m or 0,
    )
    return (
        (
            "tilt",
            bool(wall.shell.tilt),
            message(
                "horizontal_cut",
                "horizontal cut: area of the cut square to the axis times √(1 + m²); contained",
            ),
            ISO_7507,
        ),
        (
            "head",
            bool(table.liquid_density_kg_m3 or survey.liquid_density_kg_m3),
            head,
            f"{ISO_7507}; API MPMS 2.2A",
        ),
        ("bottom", job.bottom.form != "flat", BOTTOM_FORMULAS[job.bottom.form], ISO_7507),
        ("top", job.top is not None, TOP_FORMULA, ISO_7507),
        ("roof", roof is not None, _roof_formula(roof), f"{ISO_7507}; API MPMS 2.2A"),
    )


def _of_pressure(job):
    from tankcal.pipeline.tanks.solid import pressure_of

    load = pressure_of(job)
    formula = message(
        "pressure_of_sphere",
        "Δr = p r² (1 − ν)/(2 E t), p = p₀ + ρ g h²/(4 r); table {table_bar:g} bar and"
        " {table_kg_m3:g} kg/m³, survey {survey_bar:g} bar and {survey_kg_m3:g} kg/m³ to"
        " {level_m:g} m",
        table_bar=load.gas_pa / 1e5,
        table_kg_m3=load.density_kg_m3,
        survey_bar=load.survey_gas_pa / 1e5,
        survey_kg_m3=load.survey_density_kg_m3,
        level_m=load.survey_level_m,
    )
    return ("head", load.is_there, formula, TIMOSHENKO)


SURVEYED_BOTTOM = message(
    "surveyed_bottom",
    "volume between the surveyed surface and the plane of the bottom of the shell",
)
BOTTOM_FORMULAS = {
    "flat": "",
    "leaning": message("leaning_bottom", "plane square to the leaning axis of the shell"),
    "cone": message(
        "cone_bottom", "π r² H/3 for a round shell; computed with the shell's own outline"
    ),
    "dish": message(
        "dish_bottom", "π H (3 r² + H²)/6 for a round shell; computed with the shell's own outline"
    ),
    "ellipsoidal": message(
        "ellipsoidal_bottom", "2 π r² H/3 for a round shell; computed with the shell's own outline"
    ),
    "torispherical": message(
        "torispherical_bottom",
        "dish and knuckle turned about the axis; computed with the shell's own outline",
    ),
    "points": SURVEYED_BOTTOM,
    "cloud": SURVEYED_BOTTOM,
    "liquid": message(
        "measured_bottom",
        "measured volumes up to the highest measured level, increments of the shell above it",
    ),
}


TOP_FORMULA = message("head_on_top", "volume of the head over the area of the last course")


def _roof_formula(roof):
    if roof is None:
        return ""
    if roof.weighing == "vacuum":
        return "-m/rho_ref"
    return message("roof_in_air", "−m (1 − 1.2/8000)/(ρ_ref − 1.2), weighed in air")
