"""Tables of a strapped tank or sphere: readings and corrections, tapes, courses."""

from tankcal.report.tables.table import Column, Table

_STEPS = (
    *("certificate", "temperature", "tension", "tape_thickness", "rise", "sag", "out_of_level"),
)
_BOTH = "straps strap_corrections"

STRAPS = Table(
    "straps",
    (
        Column("circumference", sheet="circumference", width=14, csv="circumference"),
        Column("course", on="straps", sheet="course", width=9, csv="course"),
        Column("level_m", "m", decimals=3, on="straps", sheet="strap_level_m", csv="level_m"),
        Column("tape", on="straps", sheet="tape", width=12, csv="tape"),
        Column("reading_m", "m", decimals=4, on=_BOTH, sheet="strap_reading_m", csv="reading_m"),
        *(
            Column(f"{step}_m", "mm", decimals=2, heading=f"strap_{step}", on="strap_corrections",
                   sheet=f"strap_{step}_mm", csv=f"{step}_mm", csv_unit="mm")
            for step in _STEPS
        ),
        Column("circumference_m", "m", decimals=4, heading="strap_circumference_m", on=_BOTH,
               sheet="strap_circumference_m", csv="circumference_m"),
        Column("sd_m", "mm", decimals=2, heading="strap_sd", on="straps", sheet="strap_sd_mm",
               csv="s_mm", csv_unit="mm"),
        Column("difference_m", "mm", decimals=1, heading="strap_difference", on="straps",
               sheet="strap_difference_mm", csv="difference_mm", csv_unit="mm"),
        Column("w", decimals=1, on="straps", sheet="w", width=8, csv="w"),
        Column("mdb_m", "mm", decimals=1, heading="mdb", on="straps", sheet="strap_mdb_mm",
               csv="mdb_mm", csv_unit="mm"),
        Column("used", sheet="used", width=8, csv="used", on="straps"),
    ),
    rows=lambda record: record["strapping"]["readings"],
    csv_style="%.6f",
)  # fmt: skip


def convert_to_ppm(tape):
    """Return a tape with its scale in ppm; values of a missing comparison are None."""
    shown = {key: 1e6 * tape[key] for key in ("correction", "u_scale", "u_comparison")}
    shown["certificate"] = tape["certificate"] or None
    if not tape["master"]:
        shown |= dict.fromkeys(("u_comparison", "master", "comparisons"))
    return tape | shown


TAPES = Table(
    "tapes",
    (
        Column("tape", sheet="tape", width=12),
        Column("certificate", heading="tape_certificate", sheet="tape_certificate", width=18),
        Column("correction", "ppm", decimals=1, heading="tape_correction",
               sheet="tape_correction_ppm"),
        Column("u_scale", "ppm", decimals=1, heading="tape_u_scale", sheet="tape_u_scale_ppm"),
        Column("u_comparison", "ppm", decimals=1, heading="tape_u_comparison",
               sheet="tape_u_comparison_ppm"),
        Column("master", heading="tape_master", sheet="tape_master"),
        Column("comparisons", decimals=0, heading="tape_comparisons", sheet="tape_comparisons"),
    ),
    rows=lambda record: [convert_to_ppm(tape) for tape in record["strapping"]["tapes"]],
)  # fmt: skip

STRAPPED_COURSES = Table(
    "strapped_courses",
    (
        Column("course", sheet="course", width=9),
        Column("circumference_m", "m", decimals=4, heading="strap_circumference_m",
               sheet="strap_circumference_m"),
        Column("area_term_m", "mm", decimals=2, heading="strap_area_term",
               sheet="strap_area_term_mm"),
        Column("radius_m", "m", decimals=5, heading="outside_radius_m", sheet="outside_radius_m"),
        Column("radius_sd_m", "mm", decimals=2, sheet="u_radius_mm", width=10),
        Column("thickness_m", "mm", decimals=2, sheet="plate_mm", width=9),
        Column("paint_m", "mm", decimals=2, sheet="paint_mm", width=9),
        Column("inside_radius_m", "m", decimals=5, heading="strap_inside_radius_m",
               sheet="strap_inside_radius_m"),
    ),
    rows=lambda record: record["strapping"]["courses"],
)  # fmt: skip


def straps_of(record):
    """Return `STRAPS` with the headings for the tank; a horizontal tank has rings."""
    return _with_headings_of_tank(STRAPS, record)


def strapped_courses_of(record):
    """Return `STRAPPED_COURSES` with the headings for the tank."""
    return _with_headings_of_tank(STRAPPED_COURSES, record)


def _with_headings_of_tank(table, record):
    if record["job"]["tank"]["kind"] != "horizontal":
        return table
    return table.but(
        course={"heading": "ring", "sheet": "ring", "csv": "ring"},
        level_m={"heading": "from_a_m", "sheet": "strap_from_a_m", "csv": "from_a_m"},
    )


def certificates_of_tapes(tapes):
    """Return {tape or master tape: certificate or None} of saved tapes."""
    certificates = {}
    for tape in tapes:
        certificates[tape["tape"]] = tape["certificate"]
        if tape["master"]:
            certificates[tape["master"]] = tape["master_certificate"]
    return certificates
