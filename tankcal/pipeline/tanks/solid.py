"""Tank of one solid: horizontal cylinder or sphere, from its sizes, points or another survey."""

from dataclasses import replace

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.methods.base import given_methods, method_of
from tankcal.pipeline.tanks.common import (
    deadwood_part,
    estimates_of,
    inside_end,
    is_warmed,
    thermal_scale,
)
from tankcal.tank.body import Body, SolidPart
from tankcal.tank.ellipsoids import Membrane, PressedSphere, Pressure
from tankcal.tank.solids import LyingTank, Sphere

POISSON = 0.3  # default Poisson's ratio, of steel


def solid_body(job, survey, switches, part=None):
    """`Body` of a solid; part: its `SolidPart`, None: from the survey and the declared sizes."""
    method = method_of(survey)
    if part is None and method is not None:
        part = method.part(job, survey, switches)
    if part is None:
        part = _part(job, survey, switches)
    parts, zero = [part], solid_zero(job)
    if switches.deadwood and job.deadwood:
        parts.append(deadwood_part(job.deadwood, zero))
    return Body(
        tuple(parts),
        job.inputs,
        lowest_m=0.0,
        highest_m=parts[0].top_m,
        correlations=job.correlations,
        estimates=estimates_of(sized_job(job, survey)),
    )


def _part(job, survey, switches):
    """`SolidPart` of a tank with declared sizes or with points."""
    scale = thermal_scale(job, switches)
    job = sized_job(job, survey)
    declared = job.horizontal or job.sphere
    plate = 0.0
    if declared and job.survey.side == "outside" and switches.plate:
        plate = declared.thickness_m
    unused, survey_results = () if plate else ("plate_thickness",), {}
    method = method_of(survey)
    if method is not None:
        solid, survey_results, without_effect = method.solid_part(survey, plate, scale)
        unused = (*unused, *without_effect)
    elif job.sphere is not None:
        solid = Sphere((job.sphere.diameter_m - 2 * plate) * scale)
    else:
        solid = _lying(job.horizontal, plate, scale)
    if job.points is not None:
        factors = tuple(
            replace(factor, columns=scale**3 * factor.columns) for factor in survey.form.factors
        )
        survey_results = {"surveyed": survey.names, "form": replace(survey.form, factors=factors)}
        # Offsets of instruments are among the factors of the points.
        if any(method.has_own_offset for method in given_methods(job)):
            unused = (*unused, "offset")
    pressure = pressure_of(job)
    if (
        switches.head and pressure.is_there and job.sphere.thickness_m
    ):  # otherwise the stiffness is unknown
        poisson = job.material.poisson
        ratio = POISSON if poisson is None else poisson
        solid = PressedSphere(
            solid, Membrane(job.sphere.thickness_m, job.material.e_pa, ratio), pressure
        )
        unused = tuple(name for name in unused if name != "plate_thickness")
        declared = {"pressure": pressure.gas_pa, "survey_pressure": pressure.survey_gas_pa}
        unused += tuple(name for name, pascals in declared.items() if not pascals)
    return SolidPart(
        solid,
        scale,
        job.material.expansion_per_k,
        warmed=is_warmed(job, switches),
        **survey_results,
        unused=unused,
    )


def solid_zero(job):
    """Level of the table's zero above the solid's zero: that of the dip plate, if given, m."""
    datum = job.datum
    counts_from_plate = any(method.counts_from_plate for method in given_methods(job))
    if counts_from_plate or datum.dip_plate_z_m is None:
        return 0.0
    if datum.bottom_z_m is None:
        expected = message(
            "plate_beside_scan",
            "cannot be given with a scan, whose dips count from the inside bottom; expected "
            "a blank",
        )
        raise InputError(Problem("job.toml", expected, column="datum.dip_plate_z_m"))
    zero = datum.dip_plate_z_m - datum.bottom_z_m
    if zero < 0:
        expected = message(
            "plate_below_solid",
            "found {plate_m:g}; expected a plate inside the tank, 0 or above",
            plate_m=datum.dip_plate_z_m,
        )
        raise InputError(Problem("job.toml", expected, column="datum.dip_plate_z_m"))
    return zero


def solid_as_surveyed(job, names, values):
    """Horizontal tank or sphere inside the plates, with measured sizes, at the survey temperature.

    Its dips are vertical through the axis, for any sounding tube of the table.
    """
    sized = _with_sizes(job, names, values)
    solid = sized.horizontal or sized.sphere
    plate = solid.thickness_m if job.survey.side == "outside" and job.switches.plate else 0.0
    if sized.sphere is not None:
        return Sphere(sized.sphere.diameter_m - 2 * plate)
    by_depth = replace(sized.horizontal, tube_angle_rad=None, tube_offset_m=None)
    return _lying(by_depth, plate, 1.0)


def sized_job(job, scan):
    """Job with the sizes determined by its points."""
    return job if job.points is None else _with_sizes(job, scan.names, scan.values)


def _with_sizes(job, names, values):
    """Job with the given sizes in place of its declared sizes."""
    sizes = dict(zip(names, map(float, values), strict=True))
    if job.sphere is not None:
        return replace(job, sphere=replace(job.sphere, diameter_m=sizes["diameter"]))
    width = sizes["diameter"]
    lying = replace(job.horizontal, width_m=width, height_m=width, tilt=sizes["tilt"])
    return replace(job, horizontal=lying)


def pressure_of(job):
    """`Pressure` of the table and of the survey of a sphere; zero for other tanks."""
    if job.sphere is None:
        return Pressure()
    table, survey = job.table, job.survey
    return Pressure(
        gas_pa=table.pressure_pa or 0.0,
        density_kg_m3=table.liquid_density_kg_m3,
        survey_gas_pa=survey.pressure_pa or 0.0,
        survey_density_kg_m3=survey.liquid_density_kg_m3 or 0.0,
        survey_level_m=(survey.liquid_level_m or 0.0) + solid_zero(job),
    )


def _lying(tank, plate_m, scale):
    """`LyingTank` inside the plates, with scaled lengths."""
    return LyingTank(
        width_m=scale * (tank.width_m - 2 * plate_m),
        height_m=scale * (tank.height_m - 2 * plate_m),
        length_m=scale * tank.length_m,
        end_a=inside_end(tank.end_a, tank.width_m, plate_m, scale),
        end_b=inside_end(tank.end_b, tank.width_m, plate_m, scale),
        tilt=tank.tilt,
        roll_rad=tank.roll_rad,
        dip_from_a_m=scale * tank.dip_from_a_m,
        dip_direction=tank.dip_direction,
        tube_angle_rad=tank.tube_angle_rad or 0.0,
        tube_offset_m=scale * (tank.tube_offset_m or 0.0),
    )
