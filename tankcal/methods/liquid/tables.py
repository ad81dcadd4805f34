"""Calibration with liquid in the documents: facts and tables."""

from dataclasses import replace

from tankcal.report import numbers
from tankcal.report.tables.table import Column, Table

HIDDEN_U = 2.0  # change of a volume by an undetected error, in U, above which page 1 reports it
# Unit of a control in the record and unit in the documents.
SHOWN = {"1": "share ppm", "m3/h": "L/h", "m3": "L"}


def density_text(paper, liquid):
    """Return the density in words, such as "998.20(20) kg/m³ at 20.0 °C"."""
    density = with_u(paper, liquid, "density_kg_m3", "kg/m3")
    at = paper.number(liquid["density_c"], "degC", digits=3)
    return paper.word("texts.liquid_density", density=density, temperature=at)


def with_u(paper, liquid, key, unit):
    """Return a value with its standard uncertainty, such as "998.20(20) kg/m³".

    Parameters
    ----------
    paper : Paper
        Formatter.
    liquid : dict
        Part "liquid" of the record.
    key : str
        Key of the value; u_KEY is its standard uncertainty.
    unit : str
        Unit, a key of numbers.UNITS.

    Returns
    -------
    str
    """
    concise = numbers.concise(liquid[key], liquid[f"u_{key}"], paper.marks)
    return f"{concise}\N{NO-BREAK SPACE}{numbers.unit(unit).symbol}"


def hidden_errors(paper):
    """Return sentences on undetected errors that change a volume by more than 2 U."""
    liquid = paper.record.get("liquid") or {}
    # A proving after the runs detects errors of the meter factor.
    proved = {
        meter["meter"] for meter in liquid.get("meters", ()) if meter["factor_after"] is not None
    }
    return [
        control_text(paper, control)
        for control in liquid.get("controls") or ()
        if control["of"] not in proved
        and (control["undetected_U"] is None or control["undetected_U"] > HIDDEN_U)
    ]


def control_text(paper, control):
    """Return a sentence on the largest undetected error and its effect on the volumes."""
    name, given = f"texts.liquid_hidden_{control['kind']}", {"of": control["of"]}
    if control["detectable"] is None or control["undetected_U"] is None:
        return paper.word(f"{name}_any", **given)
    size = paper.number(control["detectable"], SHOWN[control["unit"]], digits=2)
    return paper.word(
        name, **given, size=size, times=paper.number(control["undetected_U"], decimals=1)
    )


def _liquid_sentence(paper, row):
    """Return a sentence on runs, steps and range of dips of a calibration by liquid, or None."""
    liquid = paper.record.get("liquid")
    if not liquid:
        return None
    low, high = (paper.height(liquid[f"{end}_dip_m"]) for end in ("lowest", "highest"))
    counts = {"runs": len(liquid["runs"]), "steps": len(liquid["steps"])}
    return paper.word("texts.liquid_metered", **counts, low=low, high=high)


def _liquid_properties(paper, row):
    """Return density and thermal expansion of the liquid, each with its u, in words, or None."""
    liquid = paper.record.get("liquid")
    return liquid and paper.word(
        "texts.liquid_liquid",
        density=density_text(paper, liquid),
        expansion=with_u(paper, liquid, "expansion_per_k", "1/K"),
    )


def _meter_sentence(paper, row):
    """Return the meters with their factors and provers in words, or None."""
    liquid = paper.record.get("liquid")
    return liquid and "; ".join(_meter(paper, meter) for meter in liquid["meters"])


def _meter(paper, meter):
    factor, u = (paper.number(meter[key], u=meter["u_factor"]) for key in ("factor", "u_factor"))
    text = paper.word("texts.liquid_meter", name=meter["meter"], factor=factor, u=u)
    if not meter["prover"]:
        return text
    return paper.word("texts.liquid_prover", meter=text, prover=meter["prover"])


FACTS = (  # of certificate and workbook
    Column("metered", text=_liquid_sentence, sheet=True),
    Column("metered_liquid", text=_liquid_properties, sheet=True),
    Column("metered_with", text=_meter_sentence, sheet=True),
    Column(
        "metered_table",
        text=lambda paper, row: (
            (liquid := paper.record.get("liquid"))
            and paper.word(f"liquid_tables.{liquid['certified']}")
        ),
        sheet=True,
    ),
)


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


def _dip_text(paper, dip_m):
    """Return the dip at the start of a run or step in words; None is an empty tank."""
    if dip_m is None:
        return paper.word("texts.liquid_dry")
    return paper.number(dip_m, decimals=DIP_DECIMALS)


_FROM = _column("from_dip_m", "from", "m", align="right",
               text=lambda paper, row: _dip_text(paper, row["from_dip_m"]),
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
    rows=lambda record: _convert_units(
        record["liquid"]["sizes"], ("change", "u_before", "u_after")
    ),
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
