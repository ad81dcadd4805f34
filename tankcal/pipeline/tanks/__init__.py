"""From a checked job to the body of its tank, and the size of each correction."""

from dataclasses import dataclass, fields, replace

import numpy as np

from tankcal.job import Switches
from tankcal.messages import Message, message
from tankcal.pipeline.tanks.solid import as_surveyed, filled_with, thermal_scale
from tankcal.pipeline.tanks.vertical import (
    critical_zone,
    insets_of,
    shell_volume,
    shell_zero,
    vertical_body,
)
from tankcal.units import STANDARD_GRAVITY

__all__ = [
    "as_surveyed",
    "body_of",
    "critical_zone",
    "filled_with",
    "insets_of",
    "shell_volume",
    "thermal_scale",
    "zero_height",
]


def body_of(job, survey, switches=None, uncertain=True):
    """`Body` of the tank of a job.

    Parameters
    ----------
    job : Job
    survey : wall.Wall, meshes.Mesh, scan.Scan or None
        Survey: the wall of a vertical tank, the mesh of a tank given as a mesh, the scan of another
        tank with points, otherwise None.
    switches : optional
        Enabled corrections; None: those of the job.
    uncertain : bool
        Whether to propagate the covariance of the points; sizes of corrections do not need it.
    """
    switches = job.switches if switches is None else switches
    if job.tank.kind == "vertical":
        return vertical_body(job, survey, switches, uncertain)
    from tankcal.pipeline.tanks.solid import solid_body

    return solid_body(job, survey, switches)


def zero_height(job, survey):
    """Level of the table's zero (dip 0) in the frame of the parts, m."""
    if job.tank.kind == "vertical":
        return shell_zero(job, survey)
    from tankcal.pipeline.tanks.solid import solid_zero

    return solid_zero(job)


# Codes of the principle that a formula follows from: [sources_of_corrections] of the words. A
# standard is named in a certificate only if the laboratory declares it (`certificate.standard`).
GEOMETRY = "geometry"
EXPANSION = "expansion"
THIN_SHELL = "thin_shell"
BUOYANCY = "buoyancy"
DECLARED = "declared"
INSIDE_PLATE = message("inside_plate", "r_inside = r − t")
INSIDE_PAINT = message("inside_paint", "r_inside = r − t − paint")
# No correction, except tilt, which the surveyed sections include.
NONE = Switches(**{field.name: field.name == "tilt" for field in fields(Switches)})


@dataclass(frozen=True)
class Correction:
    """A correction: its code, whether the table includes it, its size, formula and source.

    Attributes
    ----------
    code : str
    applied : bool
    size_m3 : float
        Change of the capacity at the top row; for a correction switched off, its change if applied.
    size_percent : float
        The same in percent.
    formula : Message
    source : str
        Code of the principle that the formula follows from, such as "geometry".
    """

    code: str
    applied: bool
    size_m3: float
    size_percent: float
    formula: Message
    source: str


def corrections_of(job, survey, over_m=0.0):
    """Return every correction that applies to the job, in the order of application.

    The size of a correction is the volume with it and all previous corrections, less the volume
    with the previous corrections. The surveyed sections already include the tilt: its size is the
    error of sections square to the axis.

    Parameters
    ----------
    job : Job
    survey : object
        Survey of the job.
    over_m : float
        Height of the top row, a whole millimetre, above the top of the tank, m.

    Returns
    -------
    tuple of Correction
    """
    job = as_surveyed(job, survey)
    switches, volume = NONE, _volume_at_top(job, survey, NONE, over_m)
    corrections = []
    reference = volume
    for code, is_relevant, formula, source in _applicable_corrections(job, survey):
        if not is_relevant:
            continue
        if code == "tilt":
            corrections.append(_tilt_correction(job, survey, reference, formula, source))
            continue
        corrected = _volume_at_top(job, survey, replace(switches, **{code: True}), over_m)
        # A correction switched off leaves the volume for the next corrections unchanged.
        size = corrected - volume
        is_applied = getattr(job.switches, code)
        if is_applied:
            switches, volume = replace(switches, **{code: True}), corrected
        corrections.append(
            Correction(code, is_applied, size, 100 * size / reference, formula, source)
        )
    return tuple(corrections)


def gross_at_top(job, survey, over_m=0.0):
    """Return the volume at the top row without any correction, m3.

    Parameters
    ----------
    job : Job
    survey : object
        Survey of the job.
    over_m : float
        Height of the top row above the top of the tank, m.

    Returns
    -------
    float
    """
    return _volume_at_top(job, survey, NONE, over_m)


def _volume_at_top(job, survey, switches, over_m):
    """Volume at the top row with given switches, m3."""
    body = body_of(job, survey, switches, uncertain=False)
    return float(body.volume_m3(np.array([body.highest_m + over_m]))[0])


def _tilt_correction(job, wall, volume, formula, source):
    """Correction by tilt: horizontal sections against sections square to the axis."""
    share = float(1 - 1 / np.hypot(1.0, wall.shell.tilt))
    return Correction("tilt", job.switches.tilt, volume * share, 100 * share, formula, source)


def _applicable_corrections(job, survey):
    """(code, whether it applies to the job, formula, source) of each correction, in order."""
    shell_corrections = _shell_corrections(job, survey) if job.tank.kind == "vertical" else ()
    if job.tank.kind == "sphere":
        shell_corrections = (_pressure_correction(job),)
    declared = message("sum_of_volumes", "sum of the declared volumes")
    deadwood = ("deadwood", bool(job.deadwood), declared, DECLARED)
    return [*_length_corrections(job), *shell_corrections, deadwood]


def _length_corrections(job):
    """Corrections of lengths: plate, paint and temperature."""
    outside = job.survey.side == "outside"
    solid = job.horizontal or job.sphere
    parts = job.courses or job.rings
    plates = any(c.thickness_m for c in parts) or (solid and solid.thickness_m)
    return (
        ("plate", outside and bool(plates), INSIDE_PLATE, GEOMETRY),
        (
            "paint",
            outside and any(c.paint_m for c in parts),
            INSIDE_PAINT,
            GEOMETRY,
        ),
        (
            "temperature",
            job.survey.shell_temperature_c is not None,
            _thermal_formula(job),
            EXPANSION,
        ),
    )


def _thermal_formula(job):
    """Formula of the correction by shell temperature."""
    scale = thermal_scale(job, Switches())
    if job.table.height_expansion or not job.courses:
        template = "all lengths times 1 + α (T_ref − T_shell) = {scale:.8f}"
        return message("all_lengths", template, scale=scale)
    template = "horizontal lengths times 1 + α (T_ref − T_shell) = {scale:.8f}"
    return message("horizontal_lengths", template, scale=scale)


def _shell_corrections(job, wall):
    """Corrections of a vertical shell: tilt, liquid head, bottom, top and roof."""
    survey, table, roof = job.survey, job.table, job.roof
    head = message(
        "liquid_head_empty",
        "Δr = ρ g (h − z) r²/(E t), g = {g_m_s2:g} m/s²; table {table_kg_m3:g} kg/m³; survey: empty"
        " tank",
        g_m_s2=STANDARD_GRAVITY,
        table_kg_m3=table.liquid_density_kg_m3,
    )
    if survey.liquid_density_kg_m3 and survey.liquid_level_m:
        head = message(
            "liquid_head",
            "Δr = ρ g (h − z) r²/(E t), g = {g_m_s2:g} m/s²; table {table_kg_m3:g} kg/m³, survey"
            " {survey_kg_m3:g} kg/m³ to {level_m:g} m",
            g_m_s2=STANDARD_GRAVITY,
            table_kg_m3=table.liquid_density_kg_m3,
            survey_kg_m3=survey.liquid_density_kg_m3,
            level_m=survey.liquid_level_m,
        )
    return (
        (
            "tilt",
            bool(wall.shell.tilt),
            message(
                "horizontal_cut",
                "horizontal cut: area of the cut square to the axis times √(1 + m²); contained",
            ),
            GEOMETRY,
        ),
        (
            "head",
            bool(table.liquid_density_kg_m3 or survey.liquid_density_kg_m3),
            head,
            THIN_SHELL,
        ),
        ("bottom", job.bottom.form != "flat", BOTTOM_FORMULAS[job.bottom.form], GEOMETRY),
        ("top", job.top is not None, TOP_FORMULA, GEOMETRY),
        ("roof", roof is not None, _roof_formula(roof), BUOYANCY),
    )


def _pressure_correction(job):
    """Correction of a sphere by gas pressure and liquid head."""
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
    if not (load.survey_density_kg_m3 and load.survey_level_m):
        formula = message(
            "pressure_of_sphere_empty",
            "Δr = p r² (1 − ν)/(2 E t), p = p₀ + ρ g h²/(4 r); table {table_bar:g} bar and"
            " {table_kg_m3:g} kg/m³; survey: {survey_bar:g} bar, no liquid",
            table_bar=load.gas_pa / 1e5,
            table_kg_m3=load.density_kg_m3,
            survey_bar=load.survey_gas_pa / 1e5,
        )
    return ("head", load.is_there, formula, THIN_SHELL)


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
    """Formula of the correction by a floating roof; "" without a roof."""
    if roof is None:
        return ""
    if roof.weighing == "vacuum":
        return "-m/rho_ref"
    return message("roof_in_air", "−m (1 − 1.2/8000)/(ρ_ref − 1.2), weighed in air")
