"""A tank of one solid: lying cylinder, sphere or mesh, from its sizes or its points."""

from dataclasses import replace
from functools import partial

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.pipeline.tanks.common import (
    deadwood_part,
    estimates_of,
    inside_end,
    is_warmed,
    thermal_scale,
)
from tankcal.pipeline.tanks.rings import ringed_part
from tankcal.tank.body import Body, SolidPart
from tankcal.tank.ellipsoids import Membrane, PressedSphere, Pressure
from tankcal.tank.meshes import mesh_part
from tankcal.tank.ships import Pipe, in_ship_frame, piped_mesh
from tankcal.tank.solids import LyingTank, Sphere

POISSON = 0.3  # of steel


def solid_body(job, survey, switches, heel=(0.0, 0.0)):
    """The `Body` of a solid; heel: tangents of trim and list of a tank of a ship."""
    part_of = ringed_part if job.rings else partial(_part, heel=heel)
    parts, zero = [part_of(job, survey, switches)], solid_zero(job)
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


def _part(job, survey, switches, heel):
    """`SolidPart` of a tank of declared sizes, of points, or of a mesh."""
    scale = thermal_scale(job, switches)
    job = sized_job(job, survey)
    given = job.horizontal or job.sphere
    plate = 0.0
    if given and job.survey.side == "outside" and switches.plate:
        plate = given.thickness_m
    unused, survey_says = () if plate else ("plate_thickness",), {}
    if job.great_circles is not None:
        solid = survey.solid(plate, scale)
        survey_says, unused = _of_circles(survey, plate, scale), (*unused, "offset")
    elif job.sphere is not None:
        solid = Sphere((job.sphere.diameter_m - 2 * plate) * scale)
    elif job.horizontal is not None:
        solid = _lying(job.horizontal, plate, scale)
    else:
        solid = _of_mesh(job, survey, scale, heel)
    if job.points is not None:
        survey_says = _of_scan(survey, scale)
    pressure = pressure_of(job)
    if switches.head and pressure.is_there and job.sphere.thickness_m:  # else nobody said how stiff
        solid = PressedSphere(solid, _membrane(job), pressure)
        unused = tuple(name for name in unused if name != "plate_thickness")
        given = {"pressure": pressure.gas_pa, "survey_pressure": pressure.survey_gas_pa}
        unused += tuple(name for name, pascals in given.items() if not pascals)
    return SolidPart(
        solid,
        scale,
        job.material.expansion_per_k,
        warmed=is_warmed(job, switches),
        **survey_says,
        unused=unused,
    )


def solid_zero(job):
    """Level of the table's zero: of the dip plate where it is given, above the solid's own zero.

    The levels of a mesh count from its dip plate already.
    """
    datum = job.datum
    if job.mesh is not None or datum.dip_plate_z_m is None:
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
    """The lying tank or sphere inside the plates, of sizes that points gave, at their warmth.

    Its dips are plumb ones through the axis, whatever tube the table is for.
    """
    sized = _with_sizes(job, names, values)
    given = sized.horizontal or sized.sphere
    plate = given.thickness_m if job.survey.side == "outside" and job.switches.plate else 0.0
    if sized.sphere is not None:
        return Sphere(sized.sphere.diameter_m - 2 * plate)
    by_depth = replace(sized.horizontal, tube_angle_rad=None, tube_offset_m=None)
    return _lying(by_depth, plate, 1.0)


def sized_job(job, scan):
    """The job with the sizes that its points gave."""
    return job if job.points is None else _with_sizes(job, scan.names, scan.values)


def _with_sizes(job, names, values):
    found = dict(zip(names, map(float, values), strict=True))
    if job.sphere is not None:
        return replace(job, sphere=replace(job.sphere, diameter_m=found["diameter"]))
    width = found["diameter"]
    lying = replace(job.horizontal, width_m=width, height_m=width, tilt=found["tilt"])
    return replace(job, horizontal=lying)


def _of_scan(scan, scale):
    """What the survey gives, as arguments of `SolidPart`; volumes are to scale."""
    factors = tuple(
        replace(factor, columns=scale**3 * factor.columns) for factor in scan.form.factors
    )
    return {"surveyed": scan.names, "form": replace(scan.form, factors=factors)}


def _of_circles(sphere, plate_m, scale):
    """What great circles give, as arguments of `SolidPart`; volumes are to scale."""
    form, read_with = sphere.part_of_volumes(plate_m)
    factors = tuple(replace(factor, columns=scale**3 * factor.columns) for factor in form.factors)
    return {
        "surveyed": ("diameter",),
        "form": replace(form, factors=factors),
        "read_with": {name: scale**3 * column for name, column in read_with.items()},
    }


def pressure_of(job):
    """`Pressure` of a sphere: of its table and of its survey; of another tank none."""
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


def _membrane(job):
    given = job.material.poisson
    ratio = POISSON if given is None else given
    return Membrane(job.sphere.thickness_m, job.material.e_pa, ratio)


def _of_mesh(job, mesh, scale, heel):
    """The part that a mesh encloses; levels count from the dip plate or from its lowest point, on
    a ship along the pipe from its lower end.
    """
    if job.ship is not None:
        return _on_ship(job.ship, mesh, scale, heel)
    warmed = replace(mesh, vertices_m=scale * mesh.vertices_m)
    zero = job.datum.dip_plate_z_m
    if zero is None:
        zero = job.datum.bottom_z_m
    return mesh_part(warmed, zero if zero is None else scale * zero)


def ship_pipe(ship):
    """The `Pipe` of a `Ship` in her own frame."""
    return Pipe(*in_ship_frame([ship.pipe_bottom_m, ship.pipe_top_m], ship.bow_azimuth_rad))


def _on_ship(ship, mesh, scale, heel):
    contracted = None if ship.contraction is None else 1 - ship.contraction
    return piped_mesh(
        replace(mesh, vertices_m=in_ship_frame(mesh.vertices_m, ship.bow_azimuth_rad)),
        ship_pipe(ship),
        *heel,
        scale=scale * (contracted or 1.0),
        contracted=contracted,
        marks_m=ship.length_between_marks_m,
    )


def _lying(tank, plate_m, scale):
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
