"""Tables of an adjusted survey: points, cameras, photos, instruments, systems, check points."""

from dataclasses import replace

import numpy as np

from tankcal.record.columns import NO_INTEGER, ArrayColumns, Texts, as_columns
from tankcal.report import numbers
from tankcal.report.tables.table import Column, Table
from tankcal.text.digits import decimals_of, decimals_of_mantissa
from tankcal.text.words import sentence

ANGLES = (("ω", "omega"), ("φ", "phi"), ("κ", "kappa"))  # symbols, and keys of the record
_DECIMALS = {  # decimals without a standard deviation, and largest number of decimals
    "m": {"decimals": 4, "most": 6},
    "mm": {"decimals": 2, "most": 3},
    "deg": {"decimals": 4, "most": 7},
    "deg arcsec": {"decimals": 1, "most": 3},
}
_DEG = {"decimals": 4, "most": 6}  # decimals in the workbook
_ARCSEC = {"decimals": 2, "most": 3}


def _rounded_column(key, unit, sd, **more):
    """Return a column of values, or standard deviations, rounded to two digits of the latter."""
    return Column(key, unit, u=sd, **_DECIMALS[unit], **more)


def _axis_columns(key, unit, sd, **more):
    """Return three columns of `_rounded_column`; x, y and z replace "{axis}" in the keys."""
    return [
        _rounded_column(
            key.format(axis=axis), unit, sd.format(axis=axis), named={"axis": axis},
            **{field: value.format(axis=axis) if field == "csv" else value
               for field, value in more.items()},
        )
        for axis in "xyz"
    ]  # fmt: skip


# ---- points


def point_columns(record, points=None):
    """Return the columns of points with standard deviations and results of adjustment and wall.

    Parameters
    ----------
    record : dict
        Record of a job.
    points : ArrayColumns or list of dict, optional
        Points of the record; None: all points.

    Returns
    -------
    ArrayColumns
    """
    points = as_columns(record["points"] if points is None else points)
    if not points.count:
        return points
    columns = {key: points.arrays[key] for key in ("point", "x_m", "y_m", "z_m")}
    columns |= _sds(points.arrays["cov_m2"])
    adjusted = (record["adjustment"] or {}).get("points", [])
    if len(adjusted):
        columns |= _adjusted(points["point"], as_columns(adjusted))
    if record["capacity"] is not None:
        columns |= _wall_columns(points, record["rejected"])
    return ArrayColumns(columns)


def point_rows(record, points=None):
    """Return the rows of `point_columns` (list of dict)."""
    return list(point_columns(record, points).rows())


def _sds(covariance):
    """Return the standard deviations of the coordinates, m, from covariances (n, 3, 3)."""
    if covariance.ndim < 3:  # no covariance is known
        return {f"s{axis}_m": covariance for axis in "xyz"}
    return {f"s{axis}_m": np.sqrt(np.maximum(covariance[:, i, i], 0.0))
            for i, axis in enumerate("xyz")}  # fmt: skip


def _adjusted(names, adjusted):
    """Return the results of the adjustment for points; other points have missing values."""
    place = {name: i for i, name in enumerate(adjusted["point"])}
    rows = np.array([place.get(name, -1) for name in names])
    unknown, results = rows < 0, adjusted.take(rows).arrays
    floats = {key: results[key] for key in ("spherical_sd_m", "quadratic_sd_m")}
    floats |= {f"e{i}_m": axis for i, axis in enumerate(results["ellipsoid_m"].T, 1)}
    floats["azimuth_deg"] = results["ellipsoid_azimuth_deg"]
    floats["elevation_deg"] = results["ellipsoid_elevation_deg"]
    # The fixed coordinates x, y, z form a binary number from 0 to 7.
    held = results["fixed"] @ (1, 2, 4)
    return {
        "kind": Texts(np.where(unknown, -1, results["kind"].codes), results["kind"].texts),
        "rays": np.where(unknown, NO_INTEGER, results["rays"]),
        **{key: np.where(unknown, np.nan, values) for key, values in floats.items()},
        "fixed": Texts(np.where(unknown, -1, held), ("", "x", "y", "xy", "z", "xz", "yz", "xyz")),
    }


def _wall_columns(points, rejected):
    """Return position and residual at the wall, or the reason of rejection, for points."""
    rejected = {row["point"]: row for row in rejected}
    rejections = [rejected.get(name, {}) for name in points["point"]]
    residuals = [
        residual if used else row.get("residual_m")
        for residual, used, row in zip(
            points["residual_m"], points["used"], rejections, strict=True
        )
    ]
    return {
        **{key: points.arrays[key]
           for key in ("course", "section", "generatrix", "residual_m", "used")},
        "residual_there_m": residuals,
        "reason": [row.get("reason", "") for row in rejections],
        **{key: [row.get(key) for row in rejections] for key in ("w", "row")},
    }  # fmt: skip


def _reason(paper, row):
    return "" if row["used"] else sentence(paper.words, "reasons", row["reason"] or "not_wall")


def _kind_of_point(paper, row):
    return paper.words["plan"].get(row["kind"], row["kind"] or "")


_OF_TANK = {"on": "", "optional": True}
POINTS = Table(
    "points",
    (
        Column("point", sheet="point", csv="point"),
        Column("rays", decimals=0, sheet="rays", width=7, csv="rays", optional=True),
        Column("course", sheet="course", width=9, csv="course", **_OF_TANK),
        Column("section", sheet="section", width=10, csv="section", **_OF_TANK),
        Column("generatrix", on="", csv="generatrix"),
        *_axis_columns("{axis}_m", "m", "s{axis}_m", sheet="of_m", width=11, csv="{axis}_m"),
        Column("residual_m", on="", csv="residual_mm", csv_unit="mm"),
        Column("residual_there_m", "mm", decimals=1, sheet="residual_mm", width=10, **_OF_TANK),
        Column("used", sheet="used", width=8, csv="used", **_OF_TANK),
        Column("reason", text=_reason, sheet="reason", width=40, csv="reason", **_OF_TANK),
        Column("w", decimals=1, nothing="", sheet="w", width=8, **_OF_TANK),
        Column("row", decimals=0, nothing="", sheet="row_in_file", width=9, **_OF_TANK),
        *_axis_columns("s{axis}_m", "mm", "s{axis}_m", sheet="sd_of_mm", width=9, csv="s{axis}_mm",
                  csv_unit="mm"),
        Column("kind", text=_kind_of_point, on="", sheet="kind", width=15, csv="kind",
               optional=True),
        Column("fixed", on="", csv="fixed"),
        *(Column(f"{key}_sd_m", on="", csv=f"{key}_sd_mm", csv_unit="mm")
          for key in ("spherical", "quadratic")),
        *(_rounded_column(f"e{i}_m", "mm", f"e{i}_m", sheet="ellipsoid_mm", named={"axis": axis},
                     width=11, csv=f"ellipsoid95_{axis}_mm", csv_unit="mm", optional=True)
          for i, axis in enumerate("abc", 1)),
        Column("azimuth_deg", on="", csv="ellipsoid95_azimuth_deg"),
        Column("elevation_deg", on="", csv="ellipsoid95_elevation_deg"),
    ),
    rows=point_rows,
    last={
        "sheet": "kind rays sx_m sy_m sz_m e1_m e2_m e3_m",
        "csv": "kind rays fixed spherical_sd_m quadratic_sd_m e1_m e2_m e3_m azimuth_deg "
               "elevation_deg course section generatrix residual_m used reason",
    },
    csv_style="%.6f",
)  # fmt: skip


# ---- cameras and photographs


def camera_rows(camera):
    """Return the parameters of a camera, with the correlations of the free parameters."""
    rows = []
    for i, name in enumerate(camera["parameters"]):
        row = {"camera": camera["camera"], "photos": " ".join(camera["photos"] or [])}
        row |= {key: camera[keys][i] for key, keys in _OF_PARAMETERS.items()}
        row["known_sd"] = row["sd"] or None
        if name in camera["free"]:
            correlations = camera["correlation"][camera["free"].index(name)]
            row |= {f"r_{other}": r for other, r in zip(camera["free"], correlations, strict=True)}
        rows.append(row)
    return rows


_OF_PARAMETERS = {
    "parameter": "parameters", "value": "values", "sd": "sds", "unit": "units", "scope": "scopes",
    "state": "states", "edge_um": "edge_um",
}  # fmt: skip


def _format(key):
    """Return a function of a row: number format; only lengths have no power of ten."""

    def form(row):
        if row["parameter"].startswith(("c", "x0", "y0")):
            return decimals_of(row["sd"])
        digits = decimals_of_mantissa(row[key], row["sd"])
        return f"0{'.' if digits else ''}{'0' * digits}E+00"

    return form


def _sd_of_parameter(paper, row):
    return paper.number(row["sd"], digits=2) if row["sd"] else None


def camera_table(free, words=None):
    """Return the Table of camera parameters, with a column of correlations per free parameter.

    Parameters
    ----------
    free : iterable of str
        Codes of the free parameters.
    words : dict, optional
        Words of the language of the workbook; None: the headings are codes.
    """
    names = words["parameters"] if words else {}
    correlations = tuple(
        Column(f"r_{name}", decimals=2, on="", sheet="r_with",
               named={"name": names.get(name, name)}, width=10, csv=f"r_{name}")
        for name in free
    )  # fmt: skip
    keys = " ".join(column.key for column in correlations)
    last = {"sheet": f"{CAMERA.last['sheet']} {keys}"}
    return replace(CAMERA, columns=CAMERA.columns + correlations, last=last)


CAMERA = Table(
    "camera",
    (
        Column("camera", on="", csv="camera"),
        Column("photos", on="", csv="photos"),
        Column("parameter", words="parameters", sheet="parameter", csv="parameter"),
        Column("value", text=lambda paper, row: numbers.like_its_sd(
               row["value"], row["sd"], paper.marks), align="right", heading="estimated",
               sheet="estimated", width=14, csv="value",
               in_sheet={"text": None, "decimals": _format("value")}),
        Column("sd", text=_sd_of_parameter, align="right", sheet="sd", csv="sd",
               in_sheet={"key": "known_sd", "text": None, "decimals": _format("sd")}),
        Column("unit", text=lambda paper, row: numbers.powers(row["unit"]) or None, nothing="",
               sheet="unit", width=8, csv="unit",
               in_sheet={"text": lambda paper, row: numbers.powers(row["unit"])}),
        Column("scope", words="scopes", sheet="one_value_for", width=14, csv="scope"),
        Column("state", words="states", sheet="state", width=10, csv="state"),
        Column("edge_um", "um", decimals=1, heading="edge_effect", sheet="edge_um",
               csv="edge_um"),
    ),
    rows=lambda record: [
        row for camera in record["adjustment"]["cameras"] for row in camera_rows(camera)
    ],
    last={"sheet": "value known_sd scope state edge_um"},
)  # fmt: skip

PHOTOS = Table(
    "photos",
    (
        Column("photo", sheet="photo", width=16, csv="photo"),
        Column("camera", on="photos", sheet="camera", width=16, csv="camera"),
        *_axis_columns("{axis}_m", "m", "s{axis}_m", on="photos", sheet="of_m", csv="{axis}_m"),
        *(_rounded_column(f"{key}_deg", "deg", f"s_{key}_deg", on="photo_angles", sheet="of_deg",
                     named={"axis": sign}, in_sheet=_DEG, csv=f"{key}_deg")
          for sign, key in ANGLES),
        *_axis_columns("s{axis}_m", "mm", "s{axis}_m", on="photos", sheet="sd_of_mm", width=10,
                  csv="s{axis}_m"),
        *(_rounded_column(f"s_{key}_deg", "deg arcsec", f"s_{key}_deg", on="photo_angles",
                     sheet="sd_of_arcsec", named={"axis": sign}, width=10, in_sheet=_ARCSEC,
                     csv=f"s_{key}_deg")
          for sign, key in ANGLES),
        Column("points", decimals=0, on="photos", sheet="points", width=9, csv="points"),
        Column("rms_mm", "image um", decimals=1, on="photos", sheet="rms_um", width=9,
               csv="rms_mm"),
    ),
    rows=lambda record: record["adjustment"]["photos"],
)  # fmt: skip


# ---- instruments, systems, check points


def instrument_rows(record):
    """Return the instruments of the adjustment with their certificates (list of dict)."""
    return [
        row | {"certificate": row["details"].get("certificate", "")}
        for row in record["adjustment"]["instruments"]
    ]


def estimate_rows(record):
    """Return a row for each estimated scale or offset (list of dict)."""
    return [
        {
            **{key: row[key] for key in ("instrument", "kind")},
            "certificate": row["certificate"] or None,
            "what": what,
            "declared": 0.0 + row[f"declared_{what}_{unit}"],
            "declared_sd": row[f"declared_{what}_sd_{unit}"],
            "value": row[f"{what}_{unit}"],
            "sd": row[f"{what}_sd_{unit}"],
            "unit": unit,
        }
        for row in instrument_rows(record)
        for what, unit in (("scale", "ppm"), ("offset", "mm"))
        if row[f"declared_{what}_sd_{unit}"] != 0  # exact: not estimated
    ]


def _columns_with_sd(code, key, unit):
    """Return columns of values and standard deviations, to two digits of the latter."""
    rule = {"u": f"{key}_sd_{unit}", "decimals": 2, "most": 3}
    return [
        Column(f"{key}_{unit}", sheet=code, **rule),
        Column(f"{key}_sd_{unit}", sheet=f"sd_{code}", **rule),
    ]


INSTRUMENTS = Table(
    "instruments",
    (
        Column("instrument", sheet="instrument", width=34),
        Column("kind", words="instruments", sheet="kind"),
        Column("certificate", sheet="certificate"),
        *_columns_with_sd("scale_declared", "declared_scale", "ppm"),
        *_columns_with_sd("scale_estimated", "scale", "ppm"),
        *_columns_with_sd("offset_declared", "declared_offset", "mm"),
        *_columns_with_sd("offset_estimated", "offset", "mm"),
    ),
    rows=instrument_rows,
)
ESTIMATES = Table(
    "instruments",
    (
        Column("instrument"),
        Column("kind", words="instruments"),
        Column("certificate"),
        Column("what", words="instrument_parts"),
        Column("declared", u="declared_sd", decimals=2),
        Column("declared_sd", u="declared_sd", decimals=2, nothing="∞"),
        Column("value", u="sd", decimals=2, heading="estimated"),
        Column("sd", u="sd", decimals=2),
        Column("unit"),
    ),
    rows=estimate_rows,
)

SYSTEMS = Table(
    "systems",
    (
        Column("system", sheet="system", width=34),
        *(Column(f"{axis}_m", "m", decimals=4, sheet="of_m", named={"axis": axis})
          for axis in "xyz"),
        *(Column(f"{key}_deg", "deg", decimals=5, sheet="of_deg", named={"axis": sign})
          for sign, key in ANGLES),
        *(Column(key, "ppm", u="scale_sd_ppm", decimals=1, heading=name, sheet=code,
                 in_sheet={"decimals": 2, "most": 3})
          for key, name, code in (("scale_ppm", "scale", "scale"),
                                  ("scale_sd_ppm", "sd", "sd_scale"))),
    ),
    rows=lambda record: record["adjustment"]["systems"],
)  # fmt: skip

CHECK_POINTS = Table(
    "check_points",
    (
        Column("point", sheet="check_point", width=34),
        *_axis_columns("d{axis}_m", "mm", "s{axis}_m", sheet="difference_mm"),
        Column("size_m", "mm", decimals=2, sheet="magnitude_mm"),
        *_axis_columns("s{axis}_m", "mm", "s{axis}_m", sheet="sd_of_mm"),
        Column("largest_w", decimals=1, sheet="largest_w"),
    ),
    rows=lambda record: (record["adjustment"]["check_points"] or {"points": []})["points"],
)
