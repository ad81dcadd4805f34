"""Tables of metered runs: meters, runs, steps, dips, sizes, causes, and compared volumes."""

from dataclasses import replace

from tankcal.report import numbers
from tankcal.report.tables.table import Column, Table

DIP_DECIMALS = 4  # decimals of a dip reading in m
# Unit of a size in the record and printed unit.
_SHOWN = {"m": "mm", "m/m": "mm/m", "1": "share ppm", "m3": "L", "m3/h": "L/h", "": ""}


def _column(key, heading, unit="", **more):
    """Return a column with equal headings in paper and workbook; the workbook adds the unit."""
    return Column(key, unit, heading=f"liquid_{heading}", sheet=True, **more)


_ROW = _column("row", "row", decimals=0, width=8)
_RUN = _column("run", "run", width=8)
_METER = _column("meter", "meter", width=10)
_TO = _column("to_dip_m", "to", "m", decimals=DIP_DECIMALS)


def _dip_before_step(paper, row):
    return _dip_text(paper, row["from_dip_m"])


def _dip_text(paper, dip_m):
    """Return the dip at the start of a run or step in words; None is an empty tank."""
    if dip_m is None:
        return paper.word("texts.liquid_dry")
    return paper.number(dip_m, decimals=DIP_DECIMALS)


_FROM = _column("from_dip_m", "from", "m", text=_dip_before_step, align="right",
               in_sheet={"text": None, "decimals": DIP_DECIMALS})  # fmt: skip
_W = Column("w", decimals=2, heading="liquid_w", sheet=True, width=8)
_REDUNDANCY = _column("redundancy", "redundancy", decimals=2, width=10)

METERS = Table(
    "liquid_meters",
    (
        _METER,
        _column("certificate", "certificate", width=14),
        _column("prover", "prover", width=14),
        _column("factor", "factor", u="u_factor", width=11),
        _column("u_factor", "u", u="u_factor", width=11),
        _column("factor_found", "factor_found", u="u_factor_found", width=11),
        _column("u_factor_found", "u_found", u="u_factor_found", width=11),
        _column("factor_after", "factor_after", u="u_factor", width=11),
        _column("repeatability", "repeatability", "share ppm", digits=3),
        _column("fixed_m3", "fixed", "L", digits=2),
        *(_column(f"flow_{end}_m3_h", f"flow_{end}", "m3/h", digits=3, on="")
          for end in ("lowest", "highest", "min", "max")),
    ),
    rows=lambda record: [
        meter | {key: meter[key] or None for key in ("certificate", "prover")}
        for meter in record["liquid"]["meters"]
    ],
)  # fmt: skip

RUNS = Table(
    "liquid_runs",
    (
        _RUN,
        _column("steps", "steps", decimals=0, width=8),
        _FROM,
        _TO,
        _column("indicated_m3", "indicated", "m3", decimals=3),
        _column("effect", "effect", "share ppm", decimals=0),
        _column("u_effect", "u", "share ppm", decimals=0),
    ),
    rows=lambda record: record["liquid"]["runs"],
)


def _step(key, heading, unit="", **more):
    """Return a column of the steps whose name in the CSV file is its key in the record."""
    return _column(key, heading, unit, csv=key, **more)


STEPS = Table(
    "liquid_steps",
    (
        _step("row", "row", decimals=0, width=8),
        _step("run", "run", width=8),
        _step("meter", "meter", width=10, on=""),
        replace(_FROM, csv="from_dip_m"),
        replace(_TO, csv="to_dip_m"),
        _step("indicated_m3", "indicated", "m3", u="sd_m3", on="liquid_steps"),
        *(_step(f"by_{name}_m3", name, "L", u="sd_m3", on="liquid_steps")
          for name in ("factor", "meter_temperature", "tank_temperature", "shell", "head")),
        _step("reference_m3", "reference", "m3", u="sd_m3"),
        _step("geometry_m3", "geometry", "m3", u="sd_m3", on="liquid_misclosures"),
        _step("misclosure_m3", "misclosure", "L", u="misclosure_u_m3", on="liquid_misclosures"),
        _step("misclosure_U_m3", "U", "L", u="misclosure_u_m3", on="liquid_misclosures"),
        replace(_step("misclosure_w", "misclosure_w", decimals=2, on="liquid_misclosures"),
                sheet="liquid_of_misclosure"),
        _step("residual_m3", "residual", "L", u="sd_m3", on="liquid_residuals"),
        _step("sd_m3", "sd", "L", u="sd_m3", on="liquid_residuals"),
        _step("redundancy", "redundancy", decimals=3, width=10, on="liquid_residuals"),
        _step("w", "w", decimals=2, width=8, on="liquid_residuals"),
        _step("detectable_m3", "detectable", "L", digits=2, on="liquid_residuals"),
    ),
    rows=lambda record: record["liquid"]["steps"],
)  # fmt: skip

DIPS = Table(
    "liquid_dips",
    (
        _ROW,
        _RUN,
        _column("dip_m", "dip", "m", decimals=DIP_DECIMALS),
        _column("residual_m", "residual", "mm", u="sd_m"),
        _column("sd_m", "sd", "mm", u="sd_m"),
        _REDUNDANCY,
        _W,
    ),
    rows=lambda record: record["liquid"]["dips"],
)


# ---- quantities of several units, converted to their printed units


def _convert_units(rows, keys):
    """Return the rows with the values of `keys` in printed units, and the key "shown_unit"."""
    converted = []
    for row in rows:
        unit = numbers.unit(_SHOWN[row["unit"]])
        values = {key: None if row[key] is None else unit.factor * row[key] for key in keys}
        converted.append(row | values | {"shown_unit": unit.symbol})
    return converted


def _sizes(record):
    rows = record["liquid"]["sizes"]
    return _convert_units(rows, ("change", "u_before", "u_after"))


_UNIT = _column("shown_unit", "unit", width=8)

SIZES = Table(
    "liquid_sizes",
    (
        Column("input", words="inputs", heading="liquid_input", sheet=True, width=30),
        _column("change", "change", u="u_after"),
        _column("u_after", "u_after", u="u_after"),
        _column("u_before", "u_before", digits=2),
        _UNIT,
    ),
    rows=_sizes,
)


def _causes(record):
    """Return the causes in printed units; a cause that is not detectable has no size."""
    rows = [
        cause if cause["detectable"] is not None else cause | dict.fromkeys(("size", "sd"))
        for cause in record["liquid"]["causes"]
    ]
    return _convert_units(rows, ("size", "sd", "detectable"))


def _cause(paper, row):
    """Return a possible cause with its place, such as "dip, row 12"."""
    name = paper.word(f"liquid_causes.{row['kind']}")
    if row["row"] is not None:
        return paper.word("texts.liquid_cause_row", cause=name, row=row["row"])
    if row["of"]:
        return paper.word("texts.liquid_cause_of", cause=name, of=row["of"])
    return name


CAUSES = Table(
    "liquid_causes",
    (
        Column("kind", text=_cause, heading="liquid_cause", sheet=True, width=44),
        _column("size", "size", u="sd"),
        _column("sd", "sd", u="sd"),
        _W,
        _column("detectable", "detectable", digits=2),
        _UNIT,
        Column("named", words="yes_no", heading="liquid_named", sheet=True, width=10),
    ),
    rows=_causes,
)


# ---- the three tables of volumes

KINDS = ("geometry", "liquid", "joint")
_KEYS = {"geometry": "by_geometry", "liquid": "by_liquid", "joint": "joint"}


def rows_beside(record):
    """Return the rows with volumes and U by geometry, by liquid and by both (list of dict)."""
    liquid, capacity = record["liquid"], record["capacity"]
    rows = [{"height_m": height} for height in capacity["height_m"]]
    for kind in KINDS:
        columns = liquid[_KEYS[kind]] or {}
        for key in ("volume_m3", "U_m3"):
            values = columns.get(key) or [None] * len(rows)
            for row, value in zip(rows, values, strict=True):
                row[f"{kind}_{key}"] = value
    return rows


def volumes_table(record):
    """Return the Table that compares the volumes, in the unit of the capacity table."""
    unit = record["job"]["table"]["volume_unit"]
    least = numbers.unit(unit).least
    columns = [_column("height_m", "dip", "m", height=True)]
    for kind in KINDS:
        U = f"{kind}_U_m3"
        columns += [
            _column(f"{kind}_volume_m3", f"by_{kind}", unit, u=U, least=least, width=16),
            Column(U, unit, u=U, heading=f"liquid_U_{kind}", sheet=f"liquid_U_{kind}",
                   named={"unit": numbers.unit(unit).symbol}, width=14),
        ]  # fmt: skip
    return Table("liquid_volumes", tuple(columns), rows=rows_beside)
