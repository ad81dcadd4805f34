"""A tank of one solid: lying cylinder, sphere or mesh, from its sizes or its points."""

from dataclasses import replace

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.pipeline.tanks.common import deadwood_part, estimates_of, is_warmed, thermal_scale
from tankcal.tank.body import Body, SolidPart
from tankcal.tank.heads import End, standard_end
from tankcal.tank.meshes import mesh_part
from tankcal.tank.solids import LyingTank, Sphere


def solid_body(job, survey, switches):
    scale = thermal_scale(job, switches)
    job = sized_job(job, survey)
    given = job.horizontal or job.sphere
    plate = 0.0
    if given and job.survey.side == "outside" and switches.plate:
        plate = given.thickness_m
    if job.sphere is not None:
        solid = Sphere((job.sphere.diameter_m - 2 * plate) * scale)
    elif job.horizontal is not None:
        solid = _lying(job.horizontal, plate, scale)
    else:
        solid = _of_mesh(job, survey, scale)
    part = SolidPart(
        solid,
        scale,
        job.material.expansion_per_k,
        warmed=is_warmed(job, switches),
        **(_of_scan(survey, scale) if job.points is not None else {}),
        unused=() if plate else ("plate_thickness",),
    )
    parts = [part]
    zero = solid_zero(job)
    if switches.deadwood and job.deadwood:
        parts.append(deadwood_part(job.deadwood, zero))
    return Body(
        tuple(parts),
        job.inputs,
        lowest_m=0.0,
        highest_m=part.top_m,
        correlations=job.correlations,
        estimates=estimates_of(job),
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
    factors = tuple(replace(one, columns=scale**3 * one.columns) for one in scan.form.factors)
    return {"surveyed": scan.names, "form": replace(scan.form, factors=factors)}


def _of_mesh(job, mesh, scale):
    """The part that a mesh encloses; levels count from the dip plate or from its lowest point."""
    warmed = replace(mesh, vertices_m=scale * mesh.vertices_m)
    zero = job.datum.dip_plate_z_m
    if zero is None:
        zero = job.datum.bottom_z_m
    return mesh_part(warmed, zero if zero is None else scale * zero)


def _lying(tank, plate_m, scale):
    return LyingTank(
        width_m=scale * (tank.width_m - 2 * plate_m),
        height_m=scale * (tank.height_m - 2 * plate_m),
        length_m=scale * tank.length_m,
        end_a=_end(tank.end_a, tank.width_m, plate_m, scale),
        end_b=_end(tank.end_b, tank.width_m, plate_m, scale),
        tilt=tank.tilt,
        roll_rad=tank.roll_rad,
        dip_from_a_m=scale * tank.dip_from_a_m,
        dip_direction=tank.dip_direction,
        tube_angle_rad=tank.tube_angle_rad or 0.0,
        tube_offset_m=scale * (tank.tube_offset_m or 0.0),
    )


def _end(end, diameter_m, plate_m, scale):
    """The inside of an end, from what was measured; radii of a standard follow the diameter."""
    measured = End(end.kind, end.depth_m, end.dish_radius_m, end.knuckle_radius_m)
    if end.standard is not None:
        measured = standard_end(measured, end.standard, diameter_m)
    lengths = (measured.depth_m, measured.dish_radius_m, measured.knuckle_radius_m)
    return End(end.kind, *(scale * (length - plate_m) if length else length for length in lengths))
