"""Tables of an adjusted survey: points, groups, readings, cameras, photos, instruments, checks."""

from dataclasses import replace

from tankcal.record.plain_data import rows_of
from tankcal.report import numbers
from tankcal.report.tables.table import Column, Table
from tankcal.text.digits import decimals_of, decimals_of_mantissa, fixed, format_significant
from tankcal.text.words import factor_text, group_name, observation_name, sentence

ANGLES = (("ω", "omega"), ("φ", "phi"), ("κ", "kappa"))  # their signs, and keys of the record
_JUDGED = ("as_declared", "better", "worse")
_DECIMALS = {  # without an sd, and at most
    "m": {"decimals": 4, "most": 6},
    "mm": {"decimals": 2, "most": 3},
    "deg": {"decimals": 4, "most": 7},
    "deg arcsec": {"decimals": 1, "most": 3},
}
_DEG = {"decimals": 4, "most": 6}  # in the workbook
_ARCSEC = {"decimals": 2, "most": 3}


def _to_its_sd(key, unit, sd, **more):
    """A column of values, or of sds, to two digits of the sd."""
    return Column(key, unit, u=sd, **_DECIMALS[unit], **more)


def _of_axes(key, unit, sd, **more):
    """The same of x, y and z: "{axis}" in a key is one of them."""
    return [
        _to_its_sd(
            key.format(axis=axis), unit, sd.format(axis=axis), named={"axis": axis},
            **{name: one.format(axis=axis) if name == "csv" else one for name, one in more.items()},
        )
        for axis in "xyz"
    ]  # fmt: skip


# ---- points


def point_rows(record, points=None):
    """Points (None: all) with sds; what the adjustment and the wall of a tank say of them."""
    rejected = {row["point"]: row for row in record["rejected"]}
    adjusted = {row["point"]: row for row in (record["adjustment"] or {}).get("points", [])}
    of_tank = record["capacity"] is not None
    found = []
    for point in record["points"] if points is None else points:
        row = {key: point[key] for key in ("point", "x_m", "y_m", "z_m")} | _sds(point["cov_m2"])
        if adjusted:
            row |= _adjusted(adjusted.get(point["point"]))
        if of_tank:
            row |= _about_wall(point, rejected.get(point["point"], {}))
        found.append(row)
    return found


def _sds(covariance):
    if covariance is None:
        return {"sx_m": None, "sy_m": None, "sz_m": None}
    return {f"s{axis}_m": max(covariance[i][i], 0.0) ** 0.5 for i, axis in enumerate("xyz")}


def _adjusted(point):
    if point is None:
        return {}
    keys = ("kind", "rays", "spherical_sd_m", "quadratic_sd_m")
    return {
        **{key: point[key] for key in keys},
        **{f"e{i}_m": axis for i, axis in enumerate(point["ellipsoid_m"], 1)},
        "fixed": "".join(axis for axis, held in zip("xyz", point["fixed"], strict=True) if held),
        "azimuth_deg": point["ellipsoid_azimuth_deg"],
        "elevation_deg": point["ellipsoid_elevation_deg"],
    }


def _about_wall(point, rejected):
    keys = ("course", "section", "generatrix", "residual_m", "used")
    return {
        **{key: point[key] for key in keys},
        "residual_there_m": point["residual_m"] if point["used"] else rejected.get("residual_m"),
        "reason": rejected.get("reason", ""),
        "w": rejected.get("w"),
        "row": rejected.get("row"),
    }


def _reason(paper, row):
    return "" if row["used"] else sentence(paper.words, "reasons", row["reason"] or "not_wall")


def _kind_of_point(paper, row):
    return paper.words["plan"].get(row.get("kind"), row.get("kind", ""))


_OF_TANK = {"on": "", "optional": True}
POINTS = Table(
    "points",
    (
        Column("point", sheet="point", csv="point"),
        Column("rays", decimals=0, sheet="rays", width=7, csv="rays", optional=True),
        Column("course", sheet="course", width=9, csv="course", **_OF_TANK),
        Column("section", sheet="section", width=10, csv="section", **_OF_TANK),
        Column("generatrix", on="", csv="generatrix"),
        *_of_axes("{axis}_m", "m", "s{axis}_m", sheet="of_m", width=11, csv="{axis}_m"),
        Column("residual_m", on="", csv="residual_mm", csv_unit="mm"),
        Column("residual_there_m", "mm", decimals=1, sheet="residual_mm", width=10, **_OF_TANK),
        Column("used", sheet="used", width=8, csv="used", **_OF_TANK),
        Column("reason", text=_reason, sheet="reason", width=40, csv="reason", **_OF_TANK),
        Column("w", decimals=1, nothing="", sheet="w", width=8, **_OF_TANK),
        Column("row", decimals=0, nothing="", sheet="row_in_file", width=9, **_OF_TANK),
        *_of_axes("s{axis}_m", "mm", "s{axis}_m", sheet="sd_of_mm", width=9, csv="s{axis}_mm",
                  csv_unit="mm"),
        Column("kind", text=_kind_of_point, on="", sheet="kind", width=15, csv="kind",
               optional=True),
        Column("fixed", on="", csv="fixed"),
        *(Column(f"{key}_sd_m", on="", csv=f"{key}_sd_mm", csv_unit="mm")
          for key in ("spherical", "quadratic")),
        *(_to_its_sd(f"e{i}_m", "mm", f"e{i}_m", sheet="ellipsoid_mm", named={"axis": axis},
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


# ---- groups of observations


def group_rows(record):
    """Groups with their sds and rms in a small unit; factors of those that can be judged."""
    found = []
    for row in record["adjustment"]["groups"]:
        unit, factor = numbers.small_unit(row["unit"])
        small = {
            key: None if row[key] is None else factor * row[key]
            for key in ("sd_smallest", "sd_largest", "rms")
        }
        judged = row["verdict"] in _JUDGED
        factors = {
            f"judged_{key}": row[key] if judged else None
            for key in ("factor", "factor_low", "factor_high")
        }
        named = {"small_unit": unit, "unit": numbers.spelled(unit) or row["unit"]}
        found.append(row | small | factors | named)
    return found


def _with_unit(key):
    return lambda paper, row: paper.number(row[key], row["small_unit"], digits=2)


def _declared_sd(paper, row):
    smallest, largest = row["sd_smallest"], row["sd_largest"]
    if smallest is None or not largest > smallest * (1 + 1e-9):
        return _with_unit("sd_smallest")(paper, row)
    return f"{paper.number(smallest, digits=2)}–{_with_unit('sd_largest')(paper, row)}"


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
    """Decimals of what has no sd of its own, row by row."""
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
        Column("rms", text=_with_unit("rms"), align="right",
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


def in_their_units(found):
    """Readings, {key: values}, in the units that they are shown in, named beside them."""
    large, small = (
        [of(unit) for unit in found["unit"]] for of in (numbers.large_unit, numbers.small_unit)
    )
    return found | {
        "value": _times(found["value"], large),
        **{key: _times(found[key], small) for key in _SMALL if key in found},
        "large_unit": [unit for unit, _ in large],
        "small_unit": [unit for unit, _ in small],
        "value_unit": _spelled(large, found["unit"]),
        "unit": _spelled(small, found["unit"]),
    }


_SMALL = ("residual", "sd", "mdb", "change")


def _times(values, units):
    return [
        None if value is None else value * factor
        for value, (_, factor) in zip(values, units, strict=True)
    ]


def _spelled(units, own):
    return [numbers.spelled(unit) or name for (unit, _), name in zip(units, own, strict=True)]


def _decimals(row):
    """Of residuals in micrometres, millimetres and seconds."""
    return {"um": 1, "image mm": 2, "arcsec": 1}.get(row["small_unit"], 6)


def _small(key):
    """The text of a residual or an sd: it has decimals by its unit."""

    def text(paper, row):
        if row[key] is None:
            return None
        if not row["small_unit"]:
            return format_significant(row[key], 2, paper.marks)
        return fixed(row[key], _decimals(row), paper.marks)

    return text


def _observed(paper, row):
    rule = {"decimals": 4} if row["large_unit"] else {"digits": 4}
    return paper.number(row["value"], row["large_unit"], **rule)


def _unit_of(key, own):
    return lambda paper, row: numbers.unit(row[key]).symbol or row[own]


def _ends(paper, row):
    return " – ".join(map(str, row["ids"]))


def _ends_and_element(paper, row):
    """What was observed of it, too: an angle, or the scale of an instrument."""
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
        Column("value", text=_observed, align="right", sheet="observed", csv="value",
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
    rows=lambda record: rows_of(in_their_units(record["adjustment"]["residuals"])),
    last={
        "sheet": "residual sd mdb unit redundancy w tau effect_m use repeats file row",
        "csv": "residual sd mdb unit redundancy w tau effect_m controlled removed check repeats "
               "file row",
    },
)  # fmt: skip


# ---- cameras and photographs


def camera_rows(camera):
    """The parameters of a set, with the correlations of those that are free."""
    rows = []
    for i, name in enumerate(camera["parameters"]):
        row = {"camera": camera["camera"], "photos": " ".join(camera["photos"] or [])}
        row |= {one: camera[many][i] for one, many in _OF_PARAMETERS.items()}
        row["known_sd"] = row["sd"] or None
        if name in camera["free"]:
            its = camera["correlation"][camera["free"].index(name)]
            row |= {f"r_{other}": r for other, r in zip(camera["free"], its, strict=True)}
        rows.append(row)
    return rows


_OF_PARAMETERS = {
    "parameter": "parameters", "value": "values", "sd": "sds", "unit": "units", "scope": "scopes",
    "state": "states", "edge_um": "edge_um",
}  # fmt: skip


def _format(key):
    """The number format of a value or an sd: lengths plain, all else with powers of ten."""

    def form(row):
        if row["parameter"].startswith(("c", "x0", "y0")):
            return decimals_of(row["sd"])
        digits = decimals_of_mantissa(row[key], row["sd"])
        return f"0{'.' if digits else ''}{'0' * digits}E+00"

    return form


def _sd_of_parameter(paper, row):
    return paper.number(row["sd"], digits=2) if row["sd"] else None


def camera_table(free, words=None):
    """The Table of the parameters of cameras, with a column of r for each of these parameters.

    words  of the language of the workbook, in which they have names; None: they are codes
    """
    names = words["parameters"] if words else {}
    correlations = tuple(
        Column(f"r_{name}", decimals=2, on="", sheet="r_with",
               named={"name": names.get(name, name)}, width=10, csv=f"r_{name}")
        for name in free
    )  # fmt: skip
    keys = " ".join(one.key for one in correlations)
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
        *_of_axes("{axis}_m", "m", "s{axis}_m", on="photos", sheet="of_m", csv="{axis}_m"),
        *(_to_its_sd(f"{key}_deg", "deg", f"s_{key}_deg", on="photo_angles", sheet="of_deg",
                     named={"axis": sign}, in_sheet=_DEG, csv=f"{key}_deg")
          for sign, key in ANGLES),
        *_of_axes("s{axis}_m", "mm", "s{axis}_m", on="photos", sheet="sd_of_mm", width=10,
                  csv="s{axis}_m"),
        *(_to_its_sd(f"s_{key}_deg", "deg arcsec", f"s_{key}_deg", on="photo_angles",
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
    """Instruments with the name of their kind still to be looked up, and their certificates."""
    return [
        row | {"certificate": row["details"].get("certificate", "")}
        for row in record["adjustment"]["instruments"]
    ]


def estimate_rows(record):
    """Scales and offsets that were estimated, a row each."""
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


def _beside_sd(code, key, unit):
    """A column of values and one of their sds for the workbook, both to two digits of the sd."""
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
        *_beside_sd("scale_declared", "declared_scale", "ppm"),
        *_beside_sd("scale_estimated", "scale", "ppm"),
        *_beside_sd("offset_declared", "declared_offset", "mm"),
        *_beside_sd("offset_estimated", "offset", "mm"),
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
        *_of_axes("d{axis}_m", "mm", "s{axis}_m", sheet="difference_mm"),
        Column("size_m", "mm", decimals=2, sheet="magnitude_mm"),
        *_of_axes("s{axis}_m", "mm", "s{axis}_m", sheet="sd_of_mm"),
        Column("largest_w", decimals=1, sheet="largest_w"),
    ),
    rows=lambda record: (record["adjustment"]["check_points"] or {"points": []})["points"],
)
