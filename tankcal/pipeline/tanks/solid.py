"""Tank of one solid from its sizes, points or straps, and the parts common to all tanks."""

from dataclasses import replace

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.methods.base import given_methods, method_of
from tankcal.tank.body import Body, SolidPart
from tankcal.tank.budgets import Factor
from tankcal.tank.fittings import deadwood
from tankcal.tank.heads import End, standard_end
from tankcal.tank.solids import LyingTank, Membrane, PressedSphere, Pressure, Sphere
from tankcal.uncertainty import factor_of

# Largest assumed share of the logarithm of a variance, to count as estimated or partly estimated.
LEARNED, HALF_LEARNED = 0.1, 0.5


def factor_of_unseen(kind, parts, sizes, assumed):
    """`Factor` of the form that the readings do not determine, for components of one kind.

    Parameters
    ----------
    kind : str
        Name of the cause.
    parts : list of ndarray, shape (f, f)
        Covariance of the features due to each of k components.
    sizes : sequence of float, length k
        Weight of each component in the uncertainty.
    assumed : sequence of float, length k
        Share of each amplitude that is assumed.
    """
    sizes = np.maximum(sizes, 1e-30)
    origin = origin_of_amplitude(float(sizes @ assumed / sizes.sum()))
    return Factor(kind, factor_of(sum(parts)), note=origin)


def origin_of_amplitude(assumed):
    """Code of the origin of an amplitude, from the share of it that is assumed."""
    if assumed < LEARNED:
        return "learned"
    return "half_learned" if assumed < HALF_LEARNED else "assumed"


def estimates_of(job):
    """{name of an input: its declared value}; 0 for a scale, an offset and similar inputs.

    The temperature is that of the shell, in degrees Celsius. Inputs that the job does not give have
    no value, nor have plates or paint that differ between courses.
    """
    survey, table, material = job.survey, job.table, job.material
    parts, solids = job.courses or job.rings, list(filter(None, (job.horizontal, job.sphere)))
    values_of_inputs = {
        **dict.fromkeys(("scale", "datum", "offset", "bottom", "barrel", "taper", "deadwood"), 0.0),
        "surface": 0.0,
        "plate_thickness": _only([1000 * part.thickness_m for part in parts or solids]),
        "paint": _only([1000 * part.paint_m for part in parts]),
        "shell_temperature": survey.shell_temperature_c,
        "expansion": material.expansion_per_k,
        "youngs_modulus": material.e_pa / 1e9,
        "liquid_density": table.liquid_density_kg_m3,
        "survey_level": _thousand(survey.liquid_level_m),
        "survey_density": survey.liquid_density_kg_m3,
        "roof_mass": job.roof and job.roof.mass_kg,
        **_sizes_of_solid(job),
        **_sizes_of_heads(job),
    }
    for method in given_methods(job):
        values_of_inputs |= method.input_values(job)
    return {name: value for name, value in values_of_inputs.items() if value is not None}


def _sizes_of_heads(job):
    """Declared sizes of the bottom of an upright tank and of the head on it."""
    if job.tank.kind != "vertical":
        return {}
    centre, top = job.bottom.centre_z_m, job.top
    heads = [head for head in (job.bottom, top) if head is not None]
    dishes, knuckles = (
        [1000 * getattr(head, key) for head in heads if getattr(head, key)]
        for key in ("dish_radius_m", "knuckle_radius_m")
    )
    return {
        "bottom_depth": None if centre is None else 1000 * abs(centre - job.datum.bottom_z_m),
        "top_depth": top and _thousand(top.depth_m),
        "dish": _only(dishes),
        "knuckle": _only(knuckles),
    }


def _sizes_of_solid(job):
    """Declared sizes of a horizontal cylinder or a sphere."""
    lying, solid = job.horizontal, job.horizontal or job.sphere
    if solid is None:
        return {}
    if lying is None:
        return {"diameter": _thousand(solid.diameter_m)}
    round_m = lying.width_m if lying.width_m == lying.height_m else None
    ends = (lying.end_a, lying.end_b)
    depths, dishes, knuckles = (
        [1000 * getattr(end, key) for end in ends if getattr(end, key)]
        for key in ("depth_m", "dish_radius_m", "knuckle_radius_m")
    )
    return {
        "diameter": _thousand(round_m),
        "length": _thousand(lying.length_m),
        "end_depth": _only(depths),
        "dish": _only(dishes),
        "knuckle": _only(knuckles),
        "tilt": _thousand(lying.tilt),
        "dip_position": _thousand(lying.dip_from_a_m),
        "tube_angle": lying.tube_angle_rad and float(np.degrees(lying.tube_angle_rad)),
        "tube_offset": _thousand(lying.tube_offset_m),
    }


def _only(values):
    """Value common to all entries; None if they differ or if there are none."""
    return values[0] if len(set(values)) == 1 else None


def _thousand(value):
    return None if value is None else 1000 * value


def deadwood_part(items, zero_m):
    """Declared deadwood as a part; heights are dips, and `zero_m` is the level of dip 0."""
    return deadwood(
        [item.name for item in items],
        [item.bottom_m + zero_m for item in items],
        [item.top_m + zero_m for item in items],
        [item.volume_m3 for item in items],
        [item.u_m3 for item in items],
    )


def as_surveyed(job, survey):
    """Job in the state of its surveyed wall (`Method.job_as_surveyed`)."""
    method = method_of(survey)
    return job if method is None else method.job_as_surveyed(job)


def filled_with(job, density_kg_m3):
    """Return the job with another liquid, which also supports the floating roof."""
    if density_kg_m3 is None:
        return job
    density = float(density_kg_m3)
    roof = job.roof and replace(job.roof, reference_density_kg_m3=density)
    return replace(job, table=replace(job.table, liquid_density_kg_m3=density), roof=roof)


def thermal_scale(job, switches):
    """Lengths at reference temperature over those of the survey; 1 if unknown or disabled."""
    if not is_warmed(job, switches):
        return 1.0
    warmer = job.table.reference_temperature_c - job.survey.shell_temperature_c
    return 1.0 + job.material.expansion_per_k * warmer


def is_warmed(job, switches):
    """Whether lengths are corrected for temperature: enabled, with a known shell temperature."""
    return switches.temperature and job.survey.shell_temperature_c is not None


def inside_end(end, diameter_m, plate_m, scale):
    """Inside of an end from its measured sizes; radii of a standard follow from the diameter."""
    measured = End(end.kind, end.depth_m, end.dish_radius_m, end.knuckle_radius_m)
    if end.standard is not None:
        measured = standard_end(measured, end.standard, diameter_m)
    lengths = (measured.depth_m, measured.dish_radius_m, measured.knuckle_radius_m)
    return End(end.kind, *(scale * (length - plate_m) if length else length for length in lengths))


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
