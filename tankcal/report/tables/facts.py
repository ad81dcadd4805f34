"""Facts of a tank and its survey, and the dip point, for certificate, field sheet and sketch.

Each set of facts is a `Table` with a single row. `Column.key` is the label of the fact; `on` and
`sheet` select the papers that show it. `plain.PlainPaper.facts_of` and the sheet Certificate write
the facts.
"""

from dataclasses import dataclass
from math import atan2, degrees, hypot

from tankcal.methods.base import methods
from tankcal.report.tables.table import Column, Table
from tankcal.text.words import method_line


@dataclass(frozen=True)
class DipPoint:
    """A declared dip point.

    Attributes
    ----------
    share : float
        Relative position. Vertical tank: from the axis (0) to the wall (1). Horizontal tank: from
        the start (0) to the end (1) of the cylinder.
    off_m : float or None
        Distance from the axis, m; None for a horizontal tank.
    azimuth_deg : float or None
        Azimuth from the axis, clockwise from +y, degrees; None for a horizontal tank.
    along_m : float or None
        Distance along the axis of a horizontal tank, from the start of the cylinder at A, m; None
        for a vertical tank.
    """

    share: float
    off_m: float | None = None
    azimuth_deg: float | None = None
    along_m: float | None = None


def dip_point(record):
    """Return the DipPoint of a record, or None if no dip point is declared."""
    kind, datum = record["job"]["tank"]["kind"], record["job"]["datum"]
    if kind == "horizontal":
        sizes = {size["code"]: size["value"] for size in record["solid"]}
        along = sizes["dip_from_a"]
        share = along / sizes["cylinder_length"]
        return DipPoint(min(max(share, 0.0), 1.0), along_m=along)
    if kind != "vertical" or datum.get("dip_x_m") is None:
        return None
    axis_m = record["shell"] or {"x_m": 0.0, "y_m": 0.0}  # strapped tank: the axis is the origin
    east, north = (datum[f"dip_{axis}_m"] - axis_m[f"{axis}_m"] for axis in "xy")
    off = hypot(east, north)
    share = min(off / record["courses"][0]["inside_radius_m"], 1.0)
    return DipPoint(share, off, degrees(atan2(east, north)) % 360)


def dip_point_text(paper):
    """Return the position of the dip point in words; None for kinds of tank without dip point."""
    kind, datum = paper.record["job"]["tank"]["kind"], paper.record["job"]["datum"]
    if kind not in ("vertical", "horizontal"):
        return None
    point = dip_point(paper.record)
    if point is None:
        return paper.word("texts.dip_point_open")
    if point.along_m is not None:
        along = paper.number(point.along_m, "m", decimals=3)
        return paper.word("texts.dip_point_along", along=along)
    x, y = (paper.number(datum[key], "m", decimals=3) for key in ("dip_x_m", "dip_y_m"))
    off = paper.number(point.off_m, "m", decimals=3)
    azimuth = paper.number(point.azimuth_deg, "deg", decimals=0)
    return paper.word("texts.dip_point", x=x, y=y, off=off, azimuth=azimuth)


CERTIFICATE, FIELD_TABLE = "certificate", "field_table"
BOTH = f"{CERTIFICATE} {FIELD_TABLE}"
NOT_SURVEYED = {"drawing", "surface", "dimensions"}  # choices on the thickness without a survey


def _method(paper, row):
    adjustment = paper.record["adjustment"]
    return method_line(paper.words, adjustment) if adjustment else None


def tank_facts(record):
    """Return the Table of the tank: name, kind, additional details of the job, nominal sizes."""
    tank = record["job"]["tank"]
    details = tank["details"]
    sizes = {f"nominal_{key}": tank[f"nominal_{key}_{unit}"]
             for key, unit in (("diameter", "m"), ("height", "m"), ("volume", "m3"))}  # fmt: skip
    row = {"tank_id": tank["id"], "kind": tank["kind"], **details, **sizes}
    row["certificate_number"] = record["job"]["certificate"].get("number")
    return Table(
        "tank",
        (
            Column("tank_id", on=BOTH, sheet=True),
            Column("kind", words="kinds", on=CERTIFICATE, sheet=True),
            *(Column(key, on=BOTH if key == "location" else CERTIFICATE, sheet=True)
              for key in details),
            Column("certificate_number", on=FIELD_TABLE),
            *(Column(f"nominal_{key}", "m", decimals=3, on=CERTIFICATE, sheet=True)
              for key in ("diameter", "height")),
            Column("nominal_volume", on=CERTIFICATE, sheet=True,
                   text=lambda paper, row: paper.plain(row["nominal_volume"], "m³"),
                   in_sheet={"text": None, "unit": "m3", "decimals": 3}),
        ),
        rows=lambda record: [row],
    )  # fmt: skip


def _references(record):
    job = record["job"]
    return [
        {
            "zero": record["capacity"]["zero"],
            "reference_height": job["datum"]["reference_height_m"],
            "reference_temperature": job["table"]["reference_temperature_c"],
            "expansion": job["material"]["expansion_per_k"],
            "table_density": job["table"]["liquid_density_kg_m3"] or None,
            "table_pressure": job["table"].get("pressure_pa"),
        }
    ]


REFERENCES = Table(
    "references",  # reference conditions of the capacity table
    (
        Column("zero", words="zeros", on=BOTH, sheet=True),
        Column("dip_point", text=lambda paper, row: dip_point_text(paper), on=BOTH),
        Column("reference_height", "m", decimals=3, on=BOTH, sheet=True),
        Column("reference_temperature", "degC", digits=3, on=BOTH, sheet=True,
               in_sheet={"digits": None, "decimals": 1}),
        Column("expansion", on=CERTIFICATE,
               text=lambda paper, row: paper.plain(row["expansion"], "1/K")),
        Column("table_density", "kg/m3", digits=4, on=BOTH),
        Column("table_pressure", "bar", digits=4, on=BOTH),
    ),
    rows=_references,
    last={
        FIELD_TABLE: "dip_point reference_temperature table_density table_pressure",
        "sheet": "zero reference_height",
    },
)  # fmt: skip


def radii_source_text(paper, row=None):
    """Return the source of former radii with the note of the job; None without them."""
    radii = paper.record.get("radii")
    if not radii:
        return None
    text = paper.word(f"radii_sources.{radii['source']}")
    return f"{text}: {radii['note']}" if radii["note"] else text


def _survey(record):
    survey = record["job"]["survey"]
    radii = record.get("radii")
    dates = {key: record["job"]["certificate"].get(key) for key in ("survey_end",)}
    dates["survey_date"] = survey["date"]
    thickness = {row["value"] for row in record["choices"] if row["code"] == "thickness"}
    if radii and not radii["change"]:  # no survey: the date is the date of the radii
        return [dates]
    return [
        {
            **dates,
            # Drawings and declared dimensions are no survey.
            "survey_side": None if thickness & NOT_SURVEYED else survey["side"],
            "shell_temperature": survey["shell_temperature_c"],
            "liquid_level": survey["liquid_level_m"],
            "liquid_density": survey["liquid_density_kg_m3"],
            "survey_pressure": survey.get("pressure_pa"),
        }
    ]


SURVEY_DATE = Table(
    "survey_date",
    (
        Column("survey_date", sheet=True, in_sheet={"text": None},
               text=lambda paper, row: paper.day(row["survey_date"])),
        Column("survey_end", sheet=True, optional=True,
               text=lambda paper, row: paper.day(row.get("survey_end"))),
    ),
    rows=_survey,
)  # fmt: skip
SURVEY = Table(
    "survey",
    (
        Column("survey_method", text=_method, sheet=True),
        Column("radii_source", text=radii_source_text, sheet=True),
        *(column for method in methods() for column in method.facts()),
        Column("survey_side", words="sides", sheet=True),
        Column("shell_temperature", "degC", digits=3, sheet=True,
               in_sheet={"digits": None, "decimals": 1}),
        Column("liquid_level", "m", decimals=3),
        Column("liquid_density", "kg/m3", digits=4),
        Column("survey_pressure", "bar", digits=4),
    ),
    rows=_survey,
)  # fmt: skip
