"""Tables of a strapped sphere: readings with corrections, and tapes."""

from tankcal.methods.strapping.tables import TAPES, convert_to_ppm
from tankcal.report.tables.table import Column, Table

_STEPS = ("certificate", "temperature", "tension", "tape_thickness", "rise", "sag")
_BOTH = "circles circle_corrections"

CIRCLES = Table(
    "circles",
    (
        Column("circle", sheet="circle", width=12, csv="circle", on=_BOTH),
        Column("azimuth_deg", "deg", decimals=1, on="circles", heading="line_azimuth",
               sheet="circle_azimuth_deg", csv="azimuth_deg"),
        Column("tape", on="circles", sheet="tape", width=12, csv="tape"),
        Column("reading_m", "m", decimals=4, on=_BOTH, sheet="strap_reading_m", csv="reading_m"),
        *(
            Column(f"{step}_m", "mm", decimals=2, heading=f"strap_{step}", on="circle_corrections",
                   sheet=f"strap_{step}_mm", csv=f"{step}_mm", csv_unit="mm")
            for step in _STEPS
        ),
        Column("circumference_m", "m", decimals=4, heading="strap_circumference_m", on=_BOTH,
               sheet="strap_circumference_m", csv="circumference_m"),
        Column("sd_m", "mm", decimals=2, heading="strap_sd", on="circles", sheet="strap_sd_mm",
               csv="s_mm", csv_unit="mm"),
        Column("difference_m", "mm", decimals=1, heading="circle_difference", on="circles",
               sheet="circle_difference_mm", csv="difference_mm", csv_unit="mm"),
        Column("w", decimals=1, on="circles", sheet="w", width=8, csv="w"),
        Column("used", sheet="used", width=8, csv="used", on="circles"),
    ),
    rows=lambda record: record["great_circles"]["readings"],
    csv_style="%.6f",
)  # fmt: skip

TAPES_OF_SPHERE = Table(
    "tapes",
    TAPES.columns,
    rows=lambda record: [convert_to_ppm(tape) for tape in record["great_circles"]["tapes"]],
)
