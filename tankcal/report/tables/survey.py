"""Tables of an adjusted survey, its observations, and decisions against the outlier test."""

from dataclasses import replace

import numpy as np

from tankcal.record.columns import NO_INTEGER, ArrayColumns, Texts, as_columns
from tankcal.report import numbers
from tankcal.report.tables.table import Column, Table
from tankcal.text.digits import decimals_of, decimals_of_mantissa, fixed, format_significant
from tankcal.text.words import factor_text, group_name, observation_name, sentence

MOST_IN_SHEET = 5_000  # largest number of readings, or of points, in the workbook
# Verdicts on groups with enough redundancy to estimate the factor.
_JUDGED = ("as_declared", "better", "worse")


# ---- groups of observations


def group_rows(record):
    """Return the groups with standard deviations and rms in small units (list of dict).

    The factors of groups with too little redundancy are None.
    """
    rows = []
    for row in record["adjustment"]["groups"]:
        unit, factor = numbers.small_unit(row["unit"])
        in_small_unit = {
            key: None if row[key] is None else factor * row[key]
            for key in ("sd_smallest", "sd_largest", "rms")
        }
        judged = row["verdict"] in _JUDGED
        factors = {
            f"judged_{key}": row[key] if judged else None
            for key in ("factor", "factor_low", "factor_high")
        }
        units = {"small_unit": unit, "unit": numbers.spelled(unit) or row["unit"]}
        rows.append(row | in_small_unit | factors | units)
    return rows


def _number_join_unit(key):
    return lambda paper, row: paper.number(row[key], row["small_unit"], digits=2)


def _declared_sd(paper, row):
    smallest, largest = row["sd_smallest"], row["sd_largest"]
    if smallest is None or not largest > smallest * (1 + 1e-9):
        return _number_join_unit("sd_smallest")(paper, row)
    return f"{paper.number(smallest, digits=2)}–{_number_join_unit('sd_largest')(paper, row)}"


def _symbol(key):
    return lambda paper, row: numbers.unit(row[key]).symbol


def _interval(paper, row):
    low, high = (row[f"judged_factor_{end}"] for end in ("low", "high"))
    if row["verdict"] not in _JUDGED:
        return None
    return f"{factor_text(paper.words, low)}–{factor_text(paper.words, high)}"


def _factor(paper, row):
    return factor_text(paper.words, row["factor"]) if row["verdict"] in _JUDGED else None


def _two_digits(key):
    """Return a function of a row: decimals for two significant digits."""
    return lambda row: decimals_of(row[key]) if row[key] else 1


GROUPS = Table(
    "groups",
    (
        Column("kind", on="", csv="kind"),
        Column("name", on="", csv="name"),
        Column("unit", on="", csv="unit"),
        Column("group", text=lambda paper, row: group_name(paper.words, row),
               heading="observations", sheet="observations", width=34),
        Column("count", decimals=0, sheet="values", width=10, csv="count"),
        Column("removed", decimals=0, heading="set_aside", sheet="set_aside", width=10,
               csv="removed"),
        Column("declared_sd", text=_declared_sd, align="right"),
        *(Column(key, decimals=_two_digits(key), on="", sheet=key, width=11, csv=key)
          for key in ("sd_smallest", "sd_largest")),
        Column("rms", text=_number_join_unit("rms"), align="right",
               sheet="rms", width=11, csv="rms",
               in_sheet={"text": None, "decimals": _two_digits("rms")}),
        Column("small_unit", text=_symbol("small_unit"), on="", sheet="unit", width=8),
        Column("redundancy", decimals=1, sheet="redundancy", width=11, csv="redundancy"),
        Column("factor", text=_factor, align="right", csv="factor"),
        Column("factor_sd", on="", csv="factor_sd"),
        Column("interval", text=_interval, align="right"),
        Column("judged_factor", decimals=2, on="", sheet="factor"),
        *(Column(f"judged_factor_{end}", decimals=2, on="", sheet=f"factor_{end}", width=11)
          for end in ("low", "high")),
        *(Column(f"factor_{end}", on="", csv=f"factor_{end}") for end in ("low", "high")),
        Column("verdict", words="verdicts", sheet="verdict", width=16, csv="verdict"),
    ),
    rows=group_rows,
    last={"csv": "redundancy factor factor_sd rms sd_smallest sd_largest factor_low factor_high "
                 "verdict"},
)  # fmt: skip


# ---- readings


def convert_units(readings):
    """Convert readings to their printed units.

    The result contains the names of the units as further columns.

    Parameters
    ----------
    readings : ArrayColumns or dict
        Columns of n readings, {key: values}.

    Returns
    -------
    ArrayColumns
    """
    readings = as_columns(readings)
    units = readings.arrays["unit"] if readings.count else Texts.of([])
    large, small = (
        [unit_of(unit) for unit in units.texts]
        for unit_of in (numbers.large_unit, numbers.small_unit)
    )
    times_large, times_small = (
        np.array([factor for _, factor in shown], dtype=float)[units.codes]
        for shown in (large, small)
    )
    return readings | {
        "value": readings.arrays["value"] * times_large,
        **{key: readings.arrays[key] * times_small for key in _SMALL if key in readings},
        "large_unit": Texts(units.codes, tuple(unit for unit, _ in large)),
        "small_unit": Texts(units.codes, tuple(unit for unit, _ in small)),
        "value_unit": Texts(units.codes, _spell(large, units.texts)),
        "unit": Texts(units.codes, _spell(small, units.texts)),
    }


_SMALL = ("residual", "sd", "mdb", "change")


def _spell(units, names):
    return tuple(
        numbers.spelled(unit) or name for (unit, _), name in zip(units, names, strict=True)
    )


def _decimals(row):
    """Decimals of residuals in micrometres, millimetres or arc seconds."""
    return {"um": 1, "image mm": 2, "arcsec": 1}.get(row["small_unit"], 6)


def _small(key):
    """Return a function of (paper, row) that formats a residual or standard deviation."""

    def text(paper, row):
        if row[key] is None:
            return None
        if not row["small_unit"]:
            return format_significant(row[key], 2, paper.marks)
        return fixed(row[key], _decimals(row), paper.marks)

    return text


def _observed_text(paper, row):
    rule = {"decimals": 4} if row["large_unit"] else {"digits": 4}
    return paper.number(row["value"], row["large_unit"], **rule)


def _unit_of(key, other_key):
    return lambda paper, row: numbers.unit(row[key]).symbol or row[other_key]


def _ends(paper, row):
    return " – ".join(map(str, row["ids"]))


def _ends_and_element(paper, row):
    """Return the ends of an observation with its element, such as an angle or a scale."""
    words, code = paper.words, row["element"]
    element = words["elements"].get(code) or words["instrument_parts"].get(code, code)
    return f"{_ends(paper, row)}, {element}" if element else _ends(paper, row)


def _use(paper, row):
    code = "set_aside" if row["removed"] else "compared" if row["check"] else "adjusted"
    return paper.words["workbook"]["uses"][code]


_WITH_RESIDUAL = "removed_readings largest_w compared_readings weakest_readings"
READINGS = Table(
    "residuals",
    (
        Column("kind", on="", csv="kind"),
        Column("observation", text=lambda paper, row: observation_name(paper.words, row),
               sheet="observation", width=20),
        Column("between", text=_ends_and_element),
        Column("ids", text=_ends, on="", sheet="between", width=24, csv="id"),
        Column("element", words="elements", on="", sheet="element", width=9, csv="element"),
        Column("value", text=_observed_text, align="right", sheet="observed", csv="value",
               in_sheet={"text": None, "decimals": 4}),
        Column("value_unit", text=_unit_of("large_unit", "value_unit"), on="", sheet="unit",
               width=7, csv="value_unit"),
        Column("change", text=_small("change"), heading="released_change", align="right",
               on="held"),
        Column("sd", text=_small("sd"), heading="released_sd", align="right", on="held",
               sheet="sd", width=8, csv="sd", in_sheet={"text": None, "decimals": _decimals}),
        Column("residual", text=_small("residual"), align="right", on=_WITH_RESIDUAL,
               sheet="residual", width=10, csv="residual",
               in_sheet={"text": None, "decimals": _decimals}),
        Column("small_unit", text=lambda paper, row: numbers.unit(row["small_unit"]).symbol or None,
               heading="unit", on=f"held {_WITH_RESIDUAL}"),
        Column("declared_sd", text=lambda paper, row: paper.number(
               row["sd"], row["small_unit"], digits=2), align="right", on="uncontrolled"),
        Column("redundancy", digits=2, on="largest_w weakest_readings", sheet="redundancy",
               width=9, csv="redundancy", in_sheet={"digits": None, "decimals": 3}),
        Column("w", decimals=1, on="held removed_readings largest_w compared_readings", sheet="w",
               width=8, csv="w", in_sheet={"decimals": 2}),
        Column("tau", decimals=2, on="", sheet="tau", width=8, csv="tau"),
        Column("mdb", text=_small("mdb"), align="right", on="held weakest_readings", sheet="mdb",
               width=9, csv="mdb", in_sheet={"text": None, "decimals": _decimals}),
        Column("unit", text=_unit_of("small_unit", "unit"), on="", sheet="small_unit", width=7,
               csv="unit"),
        Column("effect_m", "mm", decimals=1, on="held weakest_readings", sheet="effect_mm",
               width=9, csv="effect_mm", csv_unit="mm", in_sheet={"decimals": 2}),
        *(Column(key, on="", csv=key) for key in ("controlled", "removed", "check")),
        Column("use", text=_use, on="", sheet="use", width=11),
        Column("repeats", decimals=0, on="", sheet="readings", width=9, csv="repeats"),
        Column("file", text=lambda paper, row: row["file"] or None,
               on=f"uncontrolled {_WITH_RESIDUAL}", sheet="file", width=22, csv="file",
               in_sheet={"text": None}),
        Column("row", decimals=0, sheet="row", width=7, csv="row", in_sheet={"nothing": ""}),
    ),
    rows=lambda record: list(convert_units(record["adjustment"]["residuals"]).rows()),
    last={
        "sheet": "residual sd mdb unit redundancy w tau effect_m use repeats file row",
        "csv": "residual sd mdb unit redundancy w tau effect_m controlled removed check repeats "
               "file row",
    },
)  # fmt: skip


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
        columns |= _results_of_points(points["point"], as_columns(adjusted))
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


def _results_of_points(names, adjusted):
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


LITRE = 3  # decimals of a change of volume in m3
NO_SOLUTION, REMOVED = "no_solution", "removed"


def _what(paper, row):
    return row["what"] if row["kind"] == "point" else _reading(paper, row)


def _reading(paper, row):
    table, _, number = row["what"].rpartition(" ")
    return paper.word("overrulings.reading", table=table, row=number)


def _outlier_text(paper, row):
    """Return the result of the outlier test without the decision; None: not computed."""
    code = row["searched"]
    if code is None:
        return None
    if code in ("", REMOVED, NO_SOLUTION):
        return paper.word(f"overrulings.searched_{code or 'used'}")
    return paper.word(f"reasons.{code}")


OVERRULINGS = Table(
    "overrulings",
    (
        Column("what", text=_what, heading="overruled"),
        Column("decision", words="overruling_decisions"),
        Column("reason", heading="overruling_reason"),
        Column("by", heading="decided_by"),
        Column("date", text=lambda paper, row: paper.day(row["date"]), heading="decided_on"),
        Column("searched", text=_outlier_text),
        Column("off_m", "mm", decimals=1, heading="residual_m"),
        Column("w", decimals=1),
        Column("moved_m3", "m3", decimals=LITRE),
    ),
    rows=lambda record: record["overrulings"]["each"],
)


def decisions_of(record):
    """Return the decisions of a record (list of dict)."""
    overrulings = record.get("overrulings")
    return overrulings["each"] if overrulings else []


def sentences(paper):
    """Return a sentence for each decision, and a sentence on their joint effect."""
    overrulings = paper.record.get("overrulings")
    if not overrulings:
        return []
    texts = [sentence_of(paper, row) for row in overrulings["each"]]
    if len(texts) > 1 and overrulings["moved_m3"] is not None:
        texts.append(
            paper.word("overrulings.together", moved=_litres(paper, overrulings["moved_m3"]))
        )
    if overrulings["others"]:
        texts.append(paper.word("overrulings.others", names=", ".join(overrulings["others"])))
    return texts


def sentence_of(paper, row):
    """Return a sentence on a decision: reason, person, result of the test, and effect."""
    parts = [paper.word(f"overrulings.{row['decision']}", what=_what(paper, row))]
    parts.append(paper.word("overrulings.reason", reason=row["reason"].rstrip(". ")))
    person, day = row["by"], paper.day(row["date"])
    if person:
        who = ", ".join(part for part in (person, day) if part)
        parts.append(paper.word("overrulings.by", who=who))
    elif day:
        parts.append(paper.word("overrulings.on", day=day))
    searched = _outlier_text(paper, row)
    if searched is not None:
        parts.append(
            paper.word("overrulings.search", searched=searched, numbers=_numbers(paper, row))
        )
    if row["moved_m3"] is not None:
        parts.append(paper.word("overrulings.moved", moved=_litres(paper, row["moved_m3"])))
    return " ".join(parts)


def _numbers(paper, row):
    """Return distance and w in brackets, such as " (12.3 mm from the wall; w = 5.1)", or ""."""
    parts = []
    if row["off_m"] is not None:
        off = paper.number(row["off_m"], "mm", decimals=1)
        parts.append(paper.word("overrulings.off", off=off))
    if row["w"] is not None:
        parts.append(f"w = {paper.number(row['w'], decimals=1)}")
    return f" ({'; '.join(parts)})" if parts else ""


def _litres(paper, moved_m3):
    text = paper.number(moved_m3, "m3", decimals=LITRE)
    return f"+{text}" if moved_m3 > 0 else text
