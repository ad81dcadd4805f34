"""The part of the record that says what the tank is beside its shell."""

from math import degrees

from tankcal.record.schema import Saved, key


class Detail(Saved):
    """What a part is made of."""

    code: str = key("what it is")
    value: str | float = key("a text where unit is null, else a number in SI")
    unit: str | None = key("that it is shown in")


def described(**values):
    """The `Detail` of each code=(value, unit), but for those whose value is None."""
    return [
        Detail(code, value, unit) for code, (value, unit) in values.items() if value is not None
    ]


def bottom_of(result):
    """How the bottom was taken, and what it adds; None where it is flat or there is none."""
    job = result.job
    bottom = job.bottom
    if result.wall is None or bottom.form == "flat" or not job.switches.bottom:
        return None
    depth = None if bottom.centre_z_m is None else job.datum.bottom_z_m - bottom.centre_z_m
    surveyed = None if bottom.xyz_m is None else len(bottom.xyz_m)
    levels = None if bottom.level_m is None else len(bottom.level_m)
    return described(
        bottom_form=(bottom.form, None),
        bottom_depth=(depth, "m"),
        bottom_points=(surveyed, ""),
        bottom_levels=(levels, ""),
        bottom_lowest=(result.body.lowest_m - result.zero_m, "m"),
    )


def roof_of(result):
    """The floating roof and what it displaces; None without one."""
    roof = result.job.roof
    if roof is None:
        return None
    return described(
        roof_mass=(roof.mass_kg, "kg"),
        roof_weighing=(roof.weighing, None),
        roof_reference_density=(roof.reference_density_kg_m3, "kg/m3"),
        roof_displacement=(-_size_of(result, "roof"), "m3"),
        roof_critical_bottom=(roof.critical_bottom_m, "m"),
        roof_critical_top=(roof.critical_top_m, "m"),
    )


def _size_of(result, code):
    return next(one.size_m3 for one in result.corrections if one.code == code)


def solid_of(result):
    """Dimensions of a tank that is one solid, inside, as they entered; None for a shell."""
    job = result.job
    if job.horizontal is not None:
        return _of_lying(result)
    if job.sphere is not None:
        return described(
            diameter=(result.body.parts[0].solid.diameter_m, "m"),
            **_of_scan(result),
            full_capacity=(result.body.parts[0].solid.capacity_m3, "m3"),
        )
    if job.mesh is not None:
        return described(
            mesh_file=(job.mesh.file, None),
            mesh_faces=(len(result.body.parts[0].solid.plan_m2), ""),
            full_capacity=(result.body.parts[0].solid.capacity_m3, "m3"),
        )
    return None


def _of_lying(result):
    lying, tank = result.job.horizontal, result.body.parts[0].solid
    ends = {}
    for name, end in (("a", tank.end_a), ("b", tank.end_b)):
        ends[f"end_{name}"] = (end.kind, None)
        ends[f"end_{name}_depth"] = (end.depth_m or None, "m")
        ends[f"end_{name}_dish_radius"] = (end.dish_radius_m, "m")
        ends[f"end_{name}_knuckle_radius"] = (end.knuckle_radius_m, "m")
    return described(
        section_width=(tank.width_m, "m"),
        section_height=(tank.height_m, "m"),
        cylinder_length=(tank.length_m, "m"),
        **ends,
        axis_tilt=(tank.tilt, "mm/m"),
        roll=(degrees(lying.roll_rad), "deg"),
        dip_from_a=(tank.dip_from_a_m, "m"),
        dip_direction=(tank.dip_direction, None),
        **_of_scan(result),
        full_capacity=(tank.capacity_m3, "m3"),
    )


def _of_scan(result):
    """How many points gave the sizes, and how they scatter; nothing without points."""
    scan = result.scan
    if scan is None:
        return {}
    return {
        "points_surveyed": (len(scan.residuals_m), ""),
        "points_accepted": (len(scan.accepted), ""),
        "wall_noise": (scan.noise_m, "mm"),
    }
