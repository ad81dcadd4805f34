"""Conversion of checked values to a `Job`: SI units, defaults, one dataclass for each part."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.gum.distributions import within
from tankcal.job.checking import has_rows
from tankcal.job.checks.bearing import useless_inputs
from tankcal.job.checks.extent import is_strapped
from tankcal.job.contract import INPUTS
from tankcal.job.contract.bottom import bottom_form
from tankcal.job.contract.ship import BOW_DEG, is_ship
from tankcal.job.contract.uncertainty import spreads, standard_u
from tankcal.job.model import (
    Bottom,
    Course,
    Datum,
    Deadwood,
    DeclaredInput,
    End,
    Horizontal,
    InputFile,
    Inspection,
    Job,
    Levels,
    Material,
    Roof,
    Ship,
    Sphere,
    StatedVolume,
    Survey,
    Switches,
    TableSpec,
    Tank,
    Top,
)
from tankcal.job.structure import structure, to_si
from tankcal.job.tables import fingerprint, read_beside
from tankcal.job.tapes import mean_plates
from tankcal.messages import message
from tankcal.tank.rules import Rule

# Files beside job.toml or the workbook. The geometry package parses the mesh.

MAX_MESH_BYTES = 200_000_000  # largest file of a mesh


@dataclass(frozen=True)
class Attached:
    """Content of the files beside the settings and tables of a job.

    Attributes
    ----------
    mesh : tuple or None
        ((name, SHA-256, size in bytes), content) of the mesh file; None: not given.
    rule : tuple or None
        (Rule, (name, SHA-256, size in bytes)); None in place of the second: the rule ships with
        tankcal; None in place of the pair: no rule given.
    next_verification : tuple
        (NextVerification or None, (name, SHA-256, size in bytes) of its rule or None).
    """

    mesh: tuple | None
    rule: tuple[Rule, tuple | None] | None
    next_verification: tuple = (None, None)

    @property
    def files(self):
        """(name, SHA-256, size in bytes) of each of these files."""
        given = (
            self.mesh and self.mesh[0],
            self.rule and self.rule[1],
            self.next_verification[1],
        )
        return tuple(dict.fromkeys(file for file in given if file))


def read_mesh_file(folder, name, log):
    """Read the file of a mesh.

    Parameters
    ----------
    folder : Path
        Folder of the job.
    name : str
        File name without a path, as checked by the field mesh.file.
    log : Log
        Receives the problems.

    Returns
    -------
    tuple or None
        ((name, SHA-256, size in bytes), content); None if the file cannot be used.
    """
    path = folder / name
    try:
        exists = path.exists()
    except (OSError, ValueError):
        exists = False
    if not exists:
        log.problem(
            name,
            message(
                "missing_mesh_file", "missing file; expected the mesh of mesh.file beside the job"
            ),
        )
        return None
    data = read_beside(folder, name, log, MAX_MESH_BYTES)
    if data is None:
        return None
    if not data.strip():
        log.problem(name, message("empty_mesh_file", "empty; expected a closed mesh"))
        return None
    return fingerprint(name, data), data


# Declared and assumed inputs of uncertainty.


def inputs_of(values, tables):
    """Inputs of uncertainty: declared rows, then assumed inputs in the order of INPUTS."""
    declared = _declared_inputs(tables["uncertainty"])
    return (*declared, *_assumed_inputs(values, tables, {item.name for item in declared}))


def correlations_of(table):
    """(name, name, correlation coefficient) of each row of correlations.csv."""
    if table is None:
        return ()
    return tuple(zip(*map(table.of, ("input", "with", "r")), strict=True))


def stated_of(table):
    """`StatedVolume` of each row of stated.csv."""
    if table is None:
        return ()
    return tuple(
        structure(StatedVolume, cells, row=row, file=table.file)
        for row, cells in zip(table.rows, table.records(), strict=True)
    )


def _declared_inputs(table):
    if table is None:
        return ()
    # A normal distribution of type B with infinite degrees of freedom is the default.
    columns = map(table.of, ("input", "unit", "type", "distribution", "dof", "note"))
    rows = zip(*columns, spreads(table), strict=True)
    return tuple(
        _input(
            name,
            standard_u(*spread),
            unit,
            type=type or "B",
            distribution=distribution or "normal",
            dof=np.inf if dof is None else dof,
            note=note or "",
            u_is="sd" if spread[1] == "sd" else "scale",
        )
        for name, unit, type, distribution, dof, note, spread in rows
    )


def _assumed_inputs(values, tables, declared):
    """Yield the assumed inputs that affect the job and are not declared."""
    useless = useless_inputs(values, tables, values["tank"]["kind"])
    values_of_job = {"roof_mass": values["roof"]["mass_kg"]}
    for name, declarable in INPUTS.items():
        if declarable.assumption and name not in declared and name not in useless:
            assumed = within(declarable.assumed_half_width(values_of_job.get(name)))
            yield _input(
                name, assumed.u, declarable.unit, distribution=assumed.name, is_default=True
            )


def _input(name, u, unit, **details):
    return DeclaredInput(name, float(u / INPUTS[name].per_si), unit, float(u), **details)


def make_job(raw, values, tables, attached, measurements, warnings):
    """Build the Job from values and tables without problems.

    Parameters
    ----------
    raw : RawJob
        Job as read.
    values : dict of {str: dict}
        {section: {key: value}} of the settings.
    tables : dict of {str: ColumnValues or None}
        Tables by name.
    attached : Attached
        Files beside the settings.
    measurements : Measurements or None
        Survey to be adjusted.
    warnings : tuple of Problem
        Warnings of all checks.
    """
    kind, within_mm = values["tank"]["kind"], values["checks"]["diameter_within_mm"]
    has_points = has_rows(tables["points"]) or measurements is not None
    frame = make_frame(raw, values, tables, measurements, warnings, has_points)
    return replace(
        frame,
        inputs=inputs_of(values, tables),
        correlations=correlations_of(tables["correlations"]),
        stated=stated_of(tables["stated"]),
        rule=attached.rule and attached.rule[0],
        next_verification=attached.next_verification[0],
        files=(*frame.files, *(InputFile(*file) for file in attached.files)),
        bottom=_bottom(values, tables["bottom"]),
        deadwood=_deadwood(tables["deadwood"]),
        roof=_part(Roof, values["roof"], "mass_kg"),
        top=_part(Top, values["top"], "form"),
        horizontal=_horizontal(values["horizontal"], has_points) if kind == "horizontal" else None,
        sphere=structure(Sphere, values["sphere"]) if kind == "sphere" else None,
        circumference_m=values["checks"]["circumference_m"],
        diameter_is=values["checks"]["diameter_is"],
        diameter_within_m=None if within_mm is None else within_mm / 1000,
        inspection=_optional(Inspection, values["inspection"]),
        levels=_optional(Levels, values["levels"]),
        ship=_ship(values["ship"]) if is_ship(values) else None,
    )


def _optional(kind, given):
    """Object of a section; None if all its keys are blank."""
    return structure(kind, given) if _drop_none(given) else None


def make_frame(raw, values, tables, measurements, warnings, has_points=True):
    """Build the Job without the parts of the tank, also from an incomplete job.

    Parameters
    ----------
    raw, values, tables, measurements, warnings
        As for `make_job`.
    has_points : bool, optional
        True if the job has points or a survey.
    """
    adjustment, kind = values["adjustment"], values["tank"]["kind"]
    return Job(
        tank=_tank(values["tank"]),
        survey=_survey(values["survey"]),
        datum=_datum(values["datum"], kind, has_points),
        table=_table(values["table"]),
        material=structure(
            Material,
            values["material"],
            expansion_given=values["material"]["expansion_per_k"] is not None,
        ),
        courses=_courses(tables) if kind == "vertical" else (),
        points=None,
        certificate=_drop_none(values["certificate"]),
        snooping=adjustment["snooping"] is not False,
        scale=adjustment["scale"] or "a_priori",
        files=tuple(InputFile(*file) for file in raw.files),
        warnings=warnings,
        source=raw.source,
        switches=Switches(**_drop_none(values["corrections"])),
        measurements=measurements,
    )


def _drop_none(values):
    """Items of a dict whose value is not None."""
    return {key: value for key, value in values.items() if value is not None}


def _tank(values):
    """`Tank`; None if its name or kind is not given."""
    if values["id"] is None or values["kind"] is None:
        return None
    sizes = [name for name in values if name.startswith("nominal_")]
    texts = {name: value for name, value in values.items() if name not in (*sizes, "id", "kind")}
    return structure(Tank, values, details=_drop_none(texts))


def _survey(values):
    if values["date"] is None:
        return None
    pressure = _pascals(values["pressure_bar"])
    return structure(Survey, values, side=values["side"] or "inside", pressure_pa=pressure)


def _pascals(pressure_bar):
    """Pressure in pascals; None if no pressure or zero was given."""
    return 1e5 * pressure_bar if pressure_bar else None


def _datum(values, kind, has_points):
    if kind is None and not _drop_none(values):
        return None
    # Without points, z counts from the inside bottom beneath the dip point.
    has_own_frame = kind in ("horizontal", "sphere") and not has_points
    return Datum(**{**values, "bottom_z_m": 0.0 if has_own_frame else values["bottom_z_m"]})


def _table(values):
    if values["reference_temperature_c"] is None:
        return None
    return structure(
        TableSpec,
        values,
        fine_zones=tuple(sorted(values["fine_zones"] or ())),
        pressure_pa=_pascals(values["pressure_bar"]),
    )


def _courses(tables):
    table, welds = tables["courses"], tables["welds"]
    gauge_means = mean_plates(tables["thickness"]) if is_strapped(tables) else {}
    if table is None:
        return ()
    azimuths = {}
    if welds is not None:
        for course, azimuth in zip(welds.of("course"), welds.of("azimuth_deg"), strict=True):
            azimuths.setdefault(course, []).append(float(np.radians(azimuth)))
    return tuple(
        structure(
            Course,
            cells | gauged_plate(gauge_means.get(cells["course"])),
            name=cells["course"],
            welds_rad=tuple(sorted(azimuths.get(cells["course"], ()))) or None,
        )
        for cells in table.records()
    )


def gauged_plate(gauge_mean):
    """Thickness of plate and paint by the gauge, m, which replaces the declared thickness."""
    if gauge_mean is None:
        return {}
    plate, _, paint = gauge_mean
    return {"thickness_m": plate} | ({} if paint is None else {"paint_m": paint})


def _bottom(values, table):
    form = bottom_form(values, table)
    if form == "points":
        return Bottom(
            form,
            xyz_m=np.column_stack([table.of(f"{axis}_m") for axis in "xyz"]).astype(float),
            sd_m=_column(table, "s_mm", 1000),
            rows=table.rows,
        )
    if form == "liquid":
        level, volume, u = (_column(table, name) for name in ("level_m", "volume_m3", "u_m3"))
        return Bottom(form, level_m=level, volume_m3=volume, u_m3=u, rows=table.rows)
    return Bottom(form, **{key: value for key, value in values["bottom"].items() if key != "form"})


def _column(table, name, per_si=1):
    """Column as an array (n,) in SI; None if the table has no such column."""
    return None if table.columns[name] is None else np.array(table.of(name)) / per_si


def _deadwood(table):
    if table is None:
        return ()
    rows = zip(table.rows, table.records(), strict=True)
    return tuple(structure(Deadwood, cells, row=row) for row, cells in rows)


def _part(cls, values, main_key):
    """Part of the tank described by one section; None if its main key is blank."""
    return None if values[main_key] is None else structure(cls, values)


def _horizontal(values, has_points):
    size = values["diameter_m"]  # of a round tank
    length, dip = values["length_m"], values["dip_from_a_m"]
    return structure(
        Horizontal,
        values,
        end_a=_end(values, "end_a"),
        end_b=_end(values, "end_b"),
        width_m=values["width_m"] or size,
        height_m=values["height_m"] or size,
        dip_from_a_m=length / 2 if dip is None else dip,
        **({"tilt": None} if has_points else {}),  # the points determine the tilt
    )


def _end(values, end):
    form, depth = values[end], values[f"{end}_depth_m"]
    if form == "flat":
        return End(form)
    radii = (values[f"{end}_dish_radius_m"], values[f"{end}_knuckle_radius_m"])
    return End(form, depth or 0.0, *radii, values[f"{end}_standard"])


def _ship(values):
    given = to_si(values)
    return structure(
        Ship,
        values,
        trim_m=tuple(sorted(given["trim_m"])),
        list_rad=tuple(sorted(given["list_rad"])),
        bow_azimuth_rad=float(np.radians(BOW_DEG))
        if given["bow_azimuth_rad"] is None
        else given["bow_azimuth_rad"],
    )
