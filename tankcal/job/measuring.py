"""From the checked tables of a survey to `Measurements`: SI units, one array for each column."""

import numpy as np

from tankcal.errors import SHEET
from tankcal.job.cameras import AXES, datum_point, imagery_of, make_camera
from tankcal.job.checks.survey.readings import bars_of, bars_used, is_bar
from tankcal.job.contract.observations import ANGLES, READINGS
from tankcal.job.contract.registers import FREE, INSTRUMENT_KINDS
from tankcal.job.structure import angle_in_rad, structure
from tankcal.survey.measurements import (
    AdjustmentSettings,
    CorrelatedReadings,
    ImageReadings,
    Instrument,
    KnownPoints,
    Measurements,
    NominalTank,
    Photo,
    Readings,
    Setup,
    Targets,
    distance_of_angle_m,
    distance_sd_m,
)
from tankcal.units import ARCSEC

PRINTED = ("certificate", "tension_n")  # keys of instruments that the report shows


def make_measurements(values, tables, registers):
    """Build the `Measurements` of a survey without problems.

    Parameters
    ----------
    values : dict
        {section: {key: value}} of the settings.
    tables : dict of {str: ColumnValues or None}
        Tables by name.
    registers : dict
        {"cameras" or "instruments": {name: {key: value}}}.
    """
    weights = values["adjustment"]["image_weights"] or "measured"
    cameras = tuple(
        make_camera(name, given, values["adjustment.camera"], weights)
        for name, given in registers["cameras"].items()
    )
    images, fits = _image_points(tables, registers["cameras"], values["adjustment"])
    datum_points = tuple(map(datum_point, values["adjustment"]["datum_points"] or ()))
    return Measurements(
        settings=structure(AdjustmentSettings, values["adjustment"], datum_points=datum_points),
        cameras=cameras,
        photos=_photos(tables["photos"], images),
        image_points=images,
        control=_known_points(tables["control"]),
        check=_known_points(tables["check"], check=True),
        targets=_targets(tables["targets"]),
        instruments=tuple(
            _instrument(name, given) for name, given in registers["instruments"].items()
        ),
        setups=setups_of(tables["setups"]),
        readings=(
            *(_readings(name, tables[name]) for name in READINGS if _has_rows(tables[name])),
            *_stadia_readings(tables, registers),
        ),
        nominal=_nominal(values),
        fiducials=fits,
        correlated=_correlated_readings(tables["correlated_readings"]),
    )


def _has_rows(table):
    return table is not None and len(table.rows) > 0


def _nominal(values):
    """`NominalTank` of a vertical tank; None without nominal diameter and height."""
    tank, sizes = values["tank"], ("nominal_diameter_m", "nominal_height_m")
    if tank["kind"] != "vertical" or None in (tank[name] for name in sizes):
        return None
    diameter, height = (tank[name] for name in sizes)
    return NominalTank(diameter / 2, height, values["datum"]["bottom_z_m"])


def _check(table):
    """True for each row that is used only as a check, shape (n,)."""
    return np.array([use == "check" for use in table.of("use")], dtype=bool)


def _photos(table, images):
    """Photos with image points; the checks report photos without image points."""
    if not _has_rows(table):
        return ()
    photos_with_points = set() if images is None else set(images.photo)
    angles = ("omega", "phi", "kappa")
    values = np.column_stack(
        [table.numbers(f"{axis}_m") for axis in AXES] + [angle_in_rad(table, a) for a in angles]
    )
    sd = np.column_stack(
        [table.numbers(f"s{axis}_m") for axis in AXES]
        + [angle_in_rad(table, f"s_{a}") for a in angles]
    )
    named = zip(table.of("photo"), table.of("camera"), values, sd, table.rows, strict=True)
    return tuple(Photo(*row) for row in named if row[0] in photos_with_points)


def _image_points(tables, cameras, adjustment):
    """(ImageReadings or None, FiducialFit of each photo with image points)."""
    table = tables["image_points"]
    if not _has_rows(table):
        return None, ()
    imagery = imagery_of(tables, cameras, adjustment)
    photos = tuple(table.of("photo"))
    images = ImageReadings(
        photo=photos,
        point=tuple(table.of("point")),
        xy_mm=imagery.xy_mm,
        sd_mm=imagery.sd_mm,
        check=_check(table),
        rows=table.rows,
        file=table.file,
        shared_sd_mm=imagery.shared_sd_mm,
    )
    return images, tuple(fit for photo, fit in imagery.fits.items() if photo in set(photos))


def _known_points(table, check=False):
    if not _has_rows(table):
        return None
    return KnownPoints(
        point=tuple(table.of("point")),
        xyz_m=np.column_stack([table.numbers(f"{axis}_m") for axis in AXES]),
        sd_m=np.column_stack([table.numbers(f"s{axis}_mm") for axis in AXES]) / 1000,
        system=tuple(table.of("system")),
        check=np.ones(len(table.rows), dtype=bool) if check else _check(table),
        rows=table.rows,
        file=table.file,
    )


def _targets(table):
    if not _has_rows(table):
        return None
    return Targets(
        point=tuple(table.of("point")),
        section=tuple(table.of("section")),
        generatrix=tuple(table.of("generatrix")),
        z_m=table.numbers("z_m"),
        offset_m=np.nan_to_num(table.numbers("offset_mm")) / 1000,
        rows=table.rows,
    )


def _instrument(name, given):
    kind = given["kind"].lower().replace(" ", "_").replace("-", "_")
    scale, offset = given["u_scale_ppm"], given["u_offset_mm"]
    if is_bar(kind) and given["length_m"] and given["u_mm"] is not None:
        scale = 1e3 * given["u_mm"] / given["length_m"]  # ppm
    details = {key: given[key] for key in PRINTED if given[key] is not None}
    is_known = kind in INSTRUMENT_KINDS
    return structure(
        Instrument,
        given,
        name=name,
        kind=kind if is_known else "other",
        u_scale=np.nan if scale == FREE else (scale or 0.0) / 1e6,
        u_offset_m=np.nan if offset == FREE else (offset or 0.0) / 1000,
        details=details if is_known else {"kind": given["kind"]} | details,
    )


def setups_of(table):
    """`Setup`s of setups.csv, in the order of the file."""
    if not _has_rows(table):
        return ()
    rows = zip(table.rows, table.records(), strict=True)
    return tuple(
        structure(
            Setup, cells, name=cells["setup"], height_m=cells["instrument_height_m"] or 0.0, row=row
        )
        for row, cells in rows
    )


def _readings(name, table):
    """`Readings` of one table; columns that the table lacks keep the defaults of `Readings`."""
    value, sd = _readings_in_si(name, table)
    columns, optional = table.columns, {}
    start = "at" if "at" in columns else "from"
    if start == "at":
        optional["origin"] = tuple(table.of("from"))
    for column in ("setup", "set", "instrument"):
        if column in columns:
            optional[column] = tuple(table.of(column))
    if "kind" in columns:
        optional["horizontal"] = np.array([kind == "horizontal" for kind in table.of("kind")])
    if "temperature_c" in columns:
        optional["temperature_c"] = table.numbers("temperature_c")
    if "r_xy" in columns:
        pairs = [table.numbers(f"r_{pair}") for pair in ("xy", "xz", "yz")]
        optional["correlation"] = np.nan_to_num(np.column_stack(pairs))
    if "target_height_m" in columns:
        optional["target_height_m"] = np.nan_to_num(table.numbers("target_height_m"))
    return Readings(
        table=name,
        value=value,
        sd=sd,
        start=tuple(table.of(start) if start in columns else [None] * len(value)),
        end=tuple(table.of("to")),
        check=_check(table),
        rows=table.rows,
        sheet=table.file if table.file.startswith(SHEET) else "",
        **optional,
    )


def _stadia_readings(tables, registers):
    """Distances computed from the angles subtended by stadia bars.

    The error of the length of a bar is a common scale error of its distances.
    """
    table = tables["stadia"]
    if not _has_rows(table):
        return ()
    bars = bars_of(registers)
    used = bars_used(table, bars)
    stations = {setup.name: setup.station for setup in setups_of(tables["setups"])}
    length = np.array([bars[name]["length_m"] for name in used])
    angle, angle_sd = angle_in_rad(table, "angle"), table.numbers("s_arcsec") * ARCSEC
    return (
        Readings(
            table="distances",
            value=distance_of_angle_m(angle, length),
            sd=distance_sd_m(angle, length, angle_sd),
            start=tuple(stations[name] for name in table.of("setup")),
            end=tuple(table.of("to")),
            check=_check(table),
            instrument=tuple(used),
            horizontal=np.ones(len(table.rows), dtype=bool),
            temperature_c=np.full(len(table.rows), np.nan),
            rows=table.rows,
            sheet=table.file,
        ),
    )


def _correlated_readings(table):
    """`CorrelatedReadings`; None without rows."""
    if not _has_rows(table):
        return None
    axes = [[AXES.index(value or "x") for value in table.of(f"value_{i}")] for i in "12"]
    return CorrelatedReadings(
        tables=tuple(zip(table.of("table_1"), table.of("table_2"), strict=True)),
        at=np.column_stack([table.numbers("row_1"), table.numbers("row_2")]).astype(int),
        axis=np.array(axes).T,
        r=table.numbers("r"),
        rows=table.rows,
        file=table.file,
    )


def _readings_in_si(name, table):
    """(values, standard deviations) of a table of readings, in m or rad."""
    if name in ANGLES:
        return angle_in_rad(table, ANGLES[name]), table.numbers("s_arcsec") * ARCSEC
    if "dx_m" in table.columns:
        return tuple(
            np.column_stack([table.numbers(f"{kind}{axis}_{unit}") for axis in AXES]) * factor
            for kind, unit, factor in (("d", "m", 1.0), ("s", "mm", 1e-3))
        )
    sd = table.numbers("s_mm") / 1000
    lengths = [name for name in ("distance_m", "dz_m") if name in table.columns]
    return table.numbers(lengths[0]) if lengths else np.zeros(len(sd)), sd
