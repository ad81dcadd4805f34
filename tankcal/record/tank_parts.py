"""The parts of a tank in the record: solid, bottom, top and floating roof."""

from math import degrees

from tankcal.methods.base import given_methods
from tankcal.record.schema import Saved, key
from tankcal.tank.heads import torispherical_radii


class Detail(Saved):
    """A size or another property of a part."""

    code: str = key("of the property")
    value: str | float = key("a text if unit is null, else a number in SI")
    unit: str | None = key("in which it is shown")


def list_details(**values):
    """Return the `Detail` of each code=(value, unit) whose value is not None."""
    return [
        Detail(code, value, unit) for code, (value, unit) in values.items() if value is not None
    ]


def bottom_of(result):
    """Return the details of the bottom of an upright tank; None for a flat bottom."""
    job = result.job
    bottom = job.bottom
    if job.tank.kind != "vertical" or bottom.form == "flat" or not job.switches.bottom:
        return None
    depth = None if bottom.centre_z_m is None else job.datum.bottom_z_m - bottom.centre_z_m
    if bottom.form == "torispherical" and depth is None:
        depth = -result.body.lowest_m
    surveyed = None if bottom.xyz_m is None else len(bottom.xyz_m)
    levels = None if bottom.level_m is None else len(bottom.level_m)
    return list_details(
        bottom_form=(bottom.form, None),
        bottom_depth=(depth, "m"),
        bottom_dish_radius=(bottom.dish_radius_m, "m"),
        bottom_knuckle_radius=(bottom.knuckle_radius_m, "m"),
        bottom_standard=(bottom.standard, None),
        bottom_points=(surveyed, ""),
        bottom_levels=(levels, ""),
        bottom_lowest=(result.body.lowest_m - result.zero_m, "m"),
    )


def top_of(result):
    """Return the details of the head on an upright tank; None without head."""
    top = result.job.top
    if top is None or not result.job.switches.top:
        return None
    body = result.body
    return list_details(
        top_form=(top.form, None),
        top_depth=(body.highest_m - body.shell.volume.height_m, "m"),
        top_dish_radius=(top.dish_radius_m, "m"),
        top_knuckle_radius=(top.knuckle_radius_m, "m"),
        top_standard=(top.standard, None),
        top_capacity=(_correction_m3(result, "top"), "m3"),
    )


def roof_of(result):
    """Return the details of the floating roof; None without roof."""
    roof = result.job.roof
    if roof is None:
        return None
    return list_details(
        roof_mass=(roof.mass_kg, "kg"),
        roof_weighing=(roof.weighing, None),
        roof_reference_density=(roof.reference_density_kg_m3, "kg/m3"),
        roof_displacement=(-_correction_m3(result, "roof"), "m3"),
        roof_critical_bottom=(roof.critical_bottom_m, "m"),
        roof_critical_top=(roof.critical_top_m, "m"),
    )


def _correction_m3(result, code):
    return next(item.size_m3 for item in result.corrections if item.code == code)


def solid_of(result):
    """Return the inside dimensions of a tank without courses; None for a shell of courses."""
    job = result.job
    if job.horizontal is not None:
        return _horizontal_details(result)
    if job.sphere is not None:
        return list_details(
            diameter=(result.body.parts[0].solid.diameter_m, "m"),
            **_scan_details(result),
            **_sizes_by_methods(result),
            full_capacity=(result.body.parts[0].capacity_m3, "m3"),
        )
    if job.mesh is not None:
        return list_details(
            mesh_file=(job.mesh.file, None),
            mesh_faces=(result.body.parts[0].solid.face_count, ""),
            full_capacity=(result.body.parts[0].capacity_m3, "m3"),
        )
    return None


def _sizes_by_methods(result):
    """Sizes as surveyed by the methods of the job: {name: (value, unit)}."""
    sizes = {}
    for method in given_methods(result.job):
        sizes |= method.sizes(result)
    return sizes


def _horizontal_details(result):
    lying, tank = result.job.horizontal, result.body.parts[0].solid
    ends = {}
    for name, end in (("a", tank.end_a), ("b", tank.end_b)):
        ends[f"end_{name}"] = (end.kind, None)
        dish, knuckle = end.dish_radius_m, end.knuckle_radius_m
        if end.kind == "torispherical":
            dish, knuckle = torispherical_radii(tank.height_m / 2, end.depth_m, dish, knuckle)
        ends[f"end_{name}_depth"] = (end.depth_m or None, "m")
        ends[f"end_{name}_dish_radius"] = (dish, "m")
        ends[f"end_{name}_knuckle_radius"] = (knuckle, "m")
    return list_details(
        section_width=(tank.width_m, "m"),
        section_height=(tank.height_m, "m"),
        cylinder_length=(tank.length_m, "m"),
        **ends,
        axis_tilt=(tank.tilt, "mm/m"),
        roll=(degrees(lying.roll_rad), "deg"),
        dip_from_a=(tank.dip_from_a_m, "m"),
        dip_direction=(tank.dip_direction, None),
        tube_angle=(lying.tube_angle_rad and degrees(lying.tube_angle_rad), "deg"),
        tube_offset=(lying.tube_offset_m and tank.tube_offset_m, "m"),
        **_scan_details(result),
        full_capacity=(result.body.parts[0].capacity_m3, "m3"),
        **(_unmeasured_volumes(tank, result.zero_m) if result.job.rings else {}),
    )


def _unmeasured_volumes(tank, zero_m):
    """Return the volumes below dip 0 and above the highest dip, which no dip measures."""
    below = float(tank.volume_m3([zero_m])[0])
    return {"below_zero": (below, "m3"), "left_at_full": (tank.left_m3, "m3")}


def _scan_details(result):
    """Return the number of points and their scatter; {} without points."""
    scan = result.scan
    if scan is None:
        return {}
    return {
        "points_surveyed": (len(scan.residuals_m), ""),
        "points_accepted": (len(scan.accepted), ""),
        "wall_noise": (scan.noise_m, "mm"),
    }
