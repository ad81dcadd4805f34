"""The part of the record that says what follows: the table, the tank's parts, choices."""

from math import degrees

import numpy as np

from tankcal.adjust import CRITICAL
from tankcal.pipeline.chain import PARTS
from tankcal.record.liquid import geometry_beside
from tankcal.record.schema import Finite, Saved, filled_from, key
from tankcal.record.statements import intervals_of
from tankcal.tank.dips import ProportionalParts, dip_label
from tankcal.tank.heads import torispherical_radii

LEAST_PART_M3 = 1e-4  # last place of a printed part: an error below it is not told apart

SIGHTS = {  # of a total station, a theodolite or a level: a tape beside photographs is none
    "direction", "horizontal angle", "vertical angle", "zenith angle", "azimuth",
    "height difference", "slope distance",
}  # fmt: skip


class CapacityTable(Saved):
    """The capacity table and its covariance: factor_m3 times its transpose."""

    zero: str = key("what heights count from, a code")
    zero_m: Finite = key("height of the zero above the bottom")
    height_m: list[Finite] = key("dips of the rows, above the zero")
    dip: list[str] = key("the same as text in the table's unit")
    volume_m3: list[Finite] = key("below the dip")
    u_m3: list[Finite] = key("standard uncertainty")
    U_m3: list[Finite] = key("expanded uncertainty")
    k: list[Finite] = key("coverage factor")
    dof: list[float] = key("degrees of freedom; null: infinite")
    area_m2: list[float] = key("derivative of the volume by the dip")
    for_use: list[bool] = key("false inside the critical zone of a floating roof")
    low_m3: list[Finite] = key("interval that counts")
    high_m3: list[Finite] = key("interval that counts")
    interval: list[str] = key('where it comes from: "gum", or "monte_carlo", which does not agree')
    stated_U_m3: list[Finite] = key("as printed: the larger distance of the ends from the volume")
    inputs: list[str] = key("name of each column of factor_m3")
    input_kind: list[str] = key("kind of input, see below")
    factor_m3: list[list[Finite]] = key("rows x inputs")


class InterpolationError(Saved):
    """The largest error of linear interpolation between two rows."""

    largest_m3: float = key("of a volume")
    at_m: float = key("dip where it is")


class PartsOfRows(Saved):
    """What 1 to 9 millimetres add to a row of a centimetre table."""

    parts: int = key("of a row")
    zones: list[ProportionalParts] = key("between joints and edges; only where the error is small")
    largest_m3: float | None = key("largest error, at least the last place that is printed")


class VolumesOfDensity(Saved):
    """The volumes of the same rows for a further density of the liquid."""

    density_kg_m3: float = key("of the liquid")
    volume_m3: list[Finite] = key("of each row")


class GrossShell(Saved):
    """The shell as surveyed, without any correction, over its full height."""

    volume_m3: float = key("of the shell")
    area_m2: float = key("mean")


class Choice(Saved):
    """Something that was assumed; the sentence is the template's, in its language."""

    code: str = key("see below")
    value: str | float | bool | list | None = key("of the choice")


class Detail(Saved):
    """What a part is made of."""

    code: str = key("what it is")
    value: str | float = key("a text where unit is null, else a number in SI")
    unit: str | None = key("that it is shown in")


def capacity_of(result):
    """The `CapacityTable` of a result, each column of the factor named."""
    table = result.table
    kinds = [source.kind for source in table.sources for _ in range(source.columns_m3.shape[1])]
    counts = {kind: kinds.count(kind) for kind in kinds}
    numbers = [kinds[: i + 1].count(kind) for i, kind in enumerate(kinds)]
    return filled_from(
        CapacityTable,
        table,
        zero=zero_of(result),
        zero_m=result.zero_m,
        dip=[dip_label(height, result.job.table.height_unit) for height in table.height_m],
        for_use=table.for_use(table.height_m),
        **intervals_of(result),
        inputs=[
            kind if counts[kind] == 1 else f"{kind} {number}"
            for kind, number in zip(kinds, numbers, strict=True)
        ],
        input_kind=kinds,
    )


def proportional_parts_of(result):
    """`PartsOfRows`: what the millimetres of a dip add to a row, zone by zone."""
    zones = result.proportional_parts
    largest_m3 = max((_printed_error_m3(zone) for zone in zones), default=None)
    return PartsOfRows(PARTS, zones, largest_m3)


def _printed_error_m3(zone):
    return max(abs(zone.deviation_m3), LEAST_PART_M3)


def densities_of(result):
    """The `VolumesOfDensity` of each further density of the liquid."""
    return [VolumesOfDensity(*one) for one in result.by_density.items()]


def zero_of(result):
    """What heights of the table count from, as a code."""
    if result.job.ship is not None:
        return "pipe_bottom"
    if result.job.datum.dip_plate_z_m is not None:
        return "dip_plate"
    return "bottom" if result.job.tank.kind == "vertical" else f"{result.job.tank.kind}_bottom"


def gross_of(result):
    """`GrossShell` of a tank; None for a tank without courses."""
    shell = result.gross
    if shell is None:
        return None
    top_row_m = result.table.height_m[-1] + result.zero_m
    over_m = top_row_m - result.body.highest_m  # as the corrections, so that they add up
    area = float(shell.area_m2(shell.height_m)[0])
    volume = float(shell.volume_m3(shell.height_m)[0]) + over_m * area
    return GrossShell(volume, volume / (shell.height_m + over_m))


def choices_of(result):
    """The `Choice`s of a result: everything that was assumed."""
    job = result.job
    values = {
        "zero": zero_of(result),
        **(_shell_choices(job, result) if result.wall is not None else {}),
        **(_strapped_choices(job) if result.strapped is not None else {}),
        **_liquid_choices(result),
        **_radii_choices(result),
        **_ring_choices(result),
        **({"form": "learned"} if result.scan is not None and job.horizontal is not None else {}),
        "thickness": _thickness_choice(job, result),
        "temperature": _temperature_choice(job),
        **_sphere_choices(job),
        "height_expansion": "yes" if job.table.height_expansion else "no",
        "head": _head_choice(job),
        "deadwood": _fitting_choice(job.switches.deadwood, job.deadwood),
        "interpolation": "linear",
        "coverage": job.table.coverage_probability,
        "k": "normal" if np.all(np.isinf(result.table.dof)) else "student",
        "expansion": "given" if job.material.expansion_given else "default",
        "not_in_budget": _not_in_budget(result),
    }
    if result.adjustment is not None:
        of_survey = _adjustment_values(result.adjustment, getattr(job, "measurements", None))
        values = of_survey | values
    return [Choice(*one) for one in values.items()]


def _not_in_budget(result):
    """Inputs without u, those of the table first, then what moves only corrections of a ship."""
    of_ship = () if result.ship is None else result.ship.undeclared
    return list(dict.fromkeys((*result.body.undeclared(), *of_ship)))


def adjustment_choices(adjustment, measurements):
    """Each `Choice` that was assumed when the survey was adjusted."""
    return [Choice(*one) for one in _adjustment_values(adjustment, measurements).items()]


def _adjustment_values(adjustment, measurements):
    settings = getattr(measurements, "settings", None)
    kinds = {group.kind for group in adjustment.groups}
    photographs = "image coordinate" in kinds
    others = kinds & SIGHTS
    test = "none"
    if adjustment.redundancy > 0:
        test = "passed" if adjustment.adjusted.test().passed else "failed"
    weights = getattr(settings, "image_weights", "measured")
    return {
        **({"image_weights": weights} if photographs else {}),
        "survey": "both" if photographs and others else "photographs" if photographs else "sights",
        "adjustment_datum": adjustment.datum.choice,
        "adjustment_snooping": CRITICAL if getattr(settings, "snooping", True) else "off",
        "adjustment_test": test,
        "adjustment_scale": getattr(settings, "scale", "a_priori"),
    }


def _shell_choices(job, result):
    """What was assumed about a shell of courses, and how its points were used."""
    wall = result.wall
    roof = job.roof and job.roof.weighing
    return {
        "bottom": _bottom_choice(job),
        **_measured_by(job, result),
        "course_of_points": "section" if any(job.points.section) else "height",
        "shape": _one_or_mixed(section.outline.kind for section in wall.sections),
        "between_sections": "field",
        "tilt": _tilt_choice(job, wall.shell),
        "course_heights": "along_axis",
        **_top_choice(job),
        "roof": _fitting_choice(job.switches.roof, roof, roof),
        "snooping": CRITICAL if job.snooping else "off",
        "form": "learned",
        "covariance_sd_mm": 1000 * np.sqrt(np.median(wall.covariance_m2.diagonal())),
    }


def _measured_by(job, result):
    """How the points came about, and what is known of them."""
    found = {"covariance": _covariance_choice(job) if result.adjustment is None else "adjusted"}
    if job.hits is not None:
        found = {"survey": "wall_hits", "covariance": "hits"}
    elif job.clouds is not None:
        found = {"survey": "clouds", "covariance": "clouds"}
    elif job.tangents is not None:
        found = {"survey": "tangents", "covariance": "tangents"}
    if result.straps is not None:
        found["straps"] = "beside_points"
    if job.lines is not None:
        found["lines"] = "beside_points"
    return found


def _strapped_choices(job):
    """What was assumed about a shell that a tape was put round."""
    roof = job.roof and job.roof.weighing
    return {
        "bottom": _bottom_choice(job),
        "survey": "strapping" if job.lines is None else "reference_line",
        "area_term": "none" if job.strapping.shape_sd_m == 0 else 1000 * job.strapping.shape_sd_m,
        **_top_choice(job),
        "between_sections": "cylinders" if job.lines is None else "revolution",
        "tilt": "not_measured" if job.lines is None else "not_applied",
        "course_heights": "along_axis",
        "roof": _fitting_choice(job.switches.roof, roof, roof),
        "form": "learned",
    }


def _ring_choices(result):
    """What was assumed about rings that a tape was put round."""
    if result.rings is None:
        return {}
    shape_mm = 1000 * result.rings.shape_sd_m
    return {
        "survey": "strapping_rings",
        "area_term": shape_mm or "none",
        "between_sections": "rings",
        "form": "learned",
    }


def _sphere_choices(job):
    """How a sphere was taken that great circles describe, and the pressure that it is for."""
    found = {}
    if job.great_circles is not None:
        found["survey"] = "great_circles"
    if job.sphere is not None and job.switches.head and job.table.pressure_pa:
        found["pressure"] = job.table.pressure_pa / 1e5
    return found


def _liquid_choices(result):
    """Whose table is printed where liquid was metered, and what stood beside the liquid."""
    if result.liquid is None:
        return {}
    job, beside = result.job, geometry_beside(result)
    found = {"liquid": result.liquid.certified, "liquid_beside": beside}
    if beside == "drawing":
        roof = job.roof and job.roof.weighing
        found |= {
            "bottom": _bottom_choice(job),
            **_top_choice(job),
            "tilt": "not_measured",
            "course_heights": "along_axis",
            "roof": _fitting_choice(job.switches.roof, roof, roof),
        }
    return found


def _radii_choices(result):
    """Where the radii of the courses come from."""
    if result.radii is None:
        return {}
    job = result.job
    roof = job.roof and job.roof.weighing
    return {
        "bottom": _bottom_choice(job),
        **_top_choice(job),
        "radii": job.radii.source,
        "radii_beside": "none" if result.radii.updated is None else "survey",
        "between_sections": "radii",
        "tilt": "not_known",
        "course_heights": "along_axis",
        "roof": _fitting_choice(job.switches.roof, roof, roof),
    }


def _bottom_choice(job):
    return job.bottom.form if job.switches.bottom else "off"


def _top_choice(job):
    """The head on top; nothing is said of a tank without one."""
    return {} if job.top is None else {"top": job.top.form if job.switches.top else "off"}


def _tilt_choice(job, shell):
    if not shell.tilt_known:
        return "not_determined"
    return "horizontal_cut" if job.switches.tilt else "off"


def _temperature_choice(job):
    if job.radii is not None:
        return _temperature_of_radii(job)
    if job.survey.shell_temperature_c is None:
        return "not_applied"
    return "applied" if job.switches.temperature else "off"


def _temperature_of_radii(job):
    if job.radii.temperature_c == job.table.reference_temperature_c:
        return "radii_as_they_are"
    return "radii_applied" if job.switches.temperature else "off"


def _head_choice(job):
    """Density that the table is loaded for; "unloaded" when only the survey's was taken off."""
    if not job.switches.head:
        return "off"
    if job.table.liquid_density_kg_m3:
        return job.table.liquid_density_kg_m3
    loaded = job.survey.liquid_density_kg_m3 and job.radii is None
    return "unloaded" if loaded else "none"


def _fitting_choice(switched_on, given, applied="declared"):
    if not given:
        return "none"
    return applied if switched_on else "off"


def _covariance_choice(job):
    if job.points.sd_m is None and job.points.covariance_m2 is None:
        return "estimated"
    given = "given_sd" if job.points.covariance_m2 is None else "given_full"
    return given + "_scaled" if job.scale == "a_posteriori" else given


def _thickness_choice(job, result):
    if result.liquid is not None and geometry_beside(result) == "drawing":
        return "drawing"
    if result.radii is not None:
        return "radii"
    if job.survey.side == "inside":
        return "inside"
    solid = job.horizontal or job.sphere
    parts = job.courses or job.rings
    given = any(c.thickness_m + c.paint_m for c in parts) or (solid and solid.thickness_m)
    if not given:
        return "none"
    return "subtracted" if job.switches.plate and job.switches.paint else "off"


def _one_or_mixed(values):
    found = set(values)
    return found.pop() if len(found) == 1 else "mixed"


def described(**values):
    """The `Detail` of each code=(value, unit), but for those whose value is None."""
    return [
        Detail(code, value, unit) for code, (value, unit) in values.items() if value is not None
    ]


def bottom_of(result):
    """How the bottom was taken, and what it adds; None where it is flat or there is none."""
    job = result.job
    bottom = job.bottom
    if job.tank.kind != "vertical" or bottom.form == "flat" or not job.switches.bottom:
        return None
    depth = None if bottom.centre_z_m is None else job.datum.bottom_z_m - bottom.centre_z_m
    if bottom.form == "torispherical" and depth is None:
        depth = -result.body.lowest_m
    surveyed = None if bottom.xyz_m is None else len(bottom.xyz_m)
    levels = None if bottom.level_m is None else len(bottom.level_m)
    return described(
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
    """The head on an upright tank, and what it holds; None without one."""
    top = result.job.top
    if top is None or not result.job.switches.top:
        return None
    body = result.body
    return described(
        top_form=(top.form, None),
        top_depth=(body.highest_m - body.shell.volume.height_m, "m"),
        top_dish_radius=(top.dish_radius_m, "m"),
        top_knuckle_radius=(top.knuckle_radius_m, "m"),
        top_standard=(top.standard, None),
        top_capacity=(_size_of(result, "top"), "m3"),
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
            **_of_ellipsoid(result),
            full_capacity=(result.body.parts[0].capacity_m3, "m3"),
        )
    if job.mesh is not None:
        return described(
            mesh_file=(job.mesh.file, None),
            mesh_faces=(result.body.parts[0].solid.face_count, ""),
            full_capacity=(result.body.parts[0].capacity_m3, "m3"),
        )
    return None


def _of_ellipsoid(result):
    """Semi-axes inside of a strapped sphere, as surveyed; nothing of another."""
    if result.circles is None:
        return {}
    job = result.job
    plate = job.sphere.thickness_m if job.switches.plate else 0.0
    inside = result.circles.solid(plate)
    return {
        "semi_axis_a": (inside.a_m, "m"),
        "semi_axis_b": (inside.b_m, "m"),
        "semi_axis_c": (inside.c_m, "m"),
    }


def _of_lying(result):
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
    return described(
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
        **_of_scan(result),
        full_capacity=(result.body.parts[0].capacity_m3, "m3"),
        **(_unread(tank, result.zero_m) if result.job.rings else {}),
    )


def _unread(tank, zero_m):
    """What no dip reads: room below dip 0, and above the highest dip."""
    below = float(tank.volume_m3([zero_m])[0])
    return {"below_zero": (below, "m3"), "left_at_full": (tank.left_m3, "m3")}


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
