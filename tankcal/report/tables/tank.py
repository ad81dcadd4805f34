"""Tables of a calibrated tank: courses, sections, corrections, deadwood, sources, radii."""

from tankcal.report.tables.table import Column, Table
from tankcal.text.digits import LITRE_DECIMALS
from tankcal.text.words import sentence

TO_ITS_SD = {"decimals": 4}  # values in the workbook if no row has a standard deviation
SD = {"decimals": 2, "most": 3}  # standard deviations in mm in the workbook

COURSES = Table(
    "courses",
    (
        Column("course", sheet="course", width=9),
        Column("bottom_m", "m", decimals=3, sheet="bottom_m", width=9),
        Column("height_m", "m", decimals=3, on="courses"),
        Column("top_m", "m", decimals=3, on="courses_surveyed", sheet="top_m", width=9),
        Column("thickness_m", "mm", decimals=2, on="courses", sheet="plate_mm", width=9),
        Column("paint_m", "mm", decimals=2, on="courses", sheet="paint_mm", width=9),
        Column("sections", on="courses_surveyed"),
        Column("points", decimals=0, on="courses_surveyed", sheet="points_used", width=9),
        Column("rejected", decimals=0, on="courses_surveyed", sheet="points_rejected", width=9),
        Column("radius_m", "m", u="radius_sd_m", on="courses_surveyed", sheet="radius_m",
               width=10, in_sheet=TO_ITS_SD),
        Column("radius_sd_m", "mm", u="radius_sd_m", on="courses_surveyed", sheet="u_radius_mm",
               width=10, in_sheet=SD),
        Column("inside_radius_m", "m", u="radius_sd_m", on="courses", sheet="inside_radius_m",
               width=10, in_sheet=TO_ITS_SD),
        Column("area_m2", "m2", u="area_sd_m2", heading="inside_area_m2", on="courses_surveyed",
               sheet="inside_area_m2", width=11, in_sheet=TO_ITS_SD),
        Column("area_sd_m2", "m2", u="area_sd_m2", on="courses_surveyed", sheet="u_area_m2",
               width=10, in_sheet=TO_ITS_SD),
        Column("volume_m3", "m3", u="u_m3", on="courses", sheet="volume_m3", width=11,
               in_sheet=TO_ITS_SD),
        Column("u_m3", "m3", u="u_m3", on="courses", sheet="u_volume_m3", width=11,
               in_sheet=TO_ITS_SD),
    ),
    rows=lambda record: record["courses"],
)  # fmt: skip

SECTIONS = Table(
    "sections",
    (
        Column("section", sheet="section", width=9, csv="section"),
        Column("course", on="section_areas", sheet="course", width=9, csv="course"),
        Column("height_m", "m", decimals=3, sheet="height_m", width=9, csv="height_m"),
        Column("n", decimals=0, on="sections", sheet="points", width=9, csv="n"),
        *(
            Column(f"{axis}_m", "m", u=f"{axis}_sd_m", on="sections", sheet="centre_m",
                   named={"axis": axis}, width=10, in_sheet=TO_ITS_SD, csv=f"{axis}_m")
            for axis in "xy"
        ),
        *(
            Column(f"{axis}_sd_m", "mm", u=f"{axis}_sd_m", on="sections", sheet="u_of_mm",
                   named={"axis": axis}, width=9, in_sheet=SD, csv=f"{axis}_sd_m")
            for axis in "xy"
        ),
        Column("radius_m", "m", u="radius_sd_m", on="sections", sheet="radius_m", width=10,
               in_sheet=TO_ITS_SD, csv="radius_m"),
        Column("radius_sd_m", "mm", u="radius_sd_m", on="sections", sheet="u_radius_mm", width=10,
               in_sheet=SD, csv="radius_sd_m"),
        Column("variance_factor", decimals=3, on="sections", sheet="variance_factor", width=10,
               in_sheet={"decimals": 2}, csv="variance_factor"),
        Column("shape", words="shapes", on="section_areas", sheet="shape", width=13, csv="shape"),
        Column("area_m2", "m2", u="area_sd_m2", on="section_areas", sheet="area_m2", width=11,
               in_sheet=TO_ITS_SD, csv="area_m2"),
        Column("area_sd_m2", "m2", u="area_sd_m2", on="section_areas", sheet="u_area_m2",
               width=10, in_sheet=TO_ITS_SD, csv="area_sd_m2"),
    ),
    rows=lambda record: record["sections"],
    last={"sheet": "variance_factor shape"},
    csv_style="%.6f",
)  # fmt: skip

HOMOGENEITY = Table(
    "homogeneity",
    (
        Column("statistic", decimals=2, sheet="bartlett_statistic"),
        Column("dof", decimals=0, sheet="degrees_of_freedom"),
        Column("p", decimals=5, heading="p_value", sheet="p_value"),
    ),
    rows=lambda record: [record["homogeneity"]],
)

SECTION_NOISE = Table(
    "section_noise",
    (
        Column("section", sheet="section", width=9),
        Column("noise_factor", decimals=2, sheet="noise_factor"),
        Column("noise_dof", decimals=1, sheet="noise_dof"),
        Column("noise_share", decimals=2, sheet="noise_share"),
        Column("compared", words="yes_no", heading="noise_compared", sheet="noise_compared"),
        Column("chi2", decimals=1, heading="circle_chi2", sheet="circle_chi2"),
        Column("chi2_dof", decimals=0, heading="dof", sheet="degrees_of_freedom"),
        Column("p", decimals=5, heading="p_stated", sheet="p_stated"),
    ),
    rows=lambda record: record["homogeneity"]["sections"],
)


def modes_table(record):
    """Return the Table of amplitudes per section: mode 2 is an ellipse, mode 3 has three lobes."""
    orders = sorted({mode["k"] for row in record["sections"] for mode in row["modes"]})
    return Table(
        "modes",
        (
            Column("section", sheet="section", width=9),
            *(
                Column(f"mode_{k}_m", "mm", decimals=1, sheet="mode_mm", named={"order": k},
                       width=9)
                for k in orders
            ),
        ),
        rows=lambda record: [
            row | {f"mode_{mode['k']}_m": mode["amplitude_m"] for mode in row["modes"]}
            for row in record["sections"]
        ],
    )  # fmt: skip


SHELL = Table(
    "shell",
    (
        Column("height_m", "m", decimals=3, sheet="shell_height_m"),
        Column("tilt", "mm/m", u="tilt_sd", sheet="tilt_mm_m"),
        Column("tilt_sd", "mm/m", u="tilt_sd", sheet="u_tilt_mm_m"),
        Column("tilt_azimuth_deg", "deg", decimals=1, sheet="tilt_azimuth_deg"),
        Column("residual_sd_m", "mm", decimals=2, sheet="residual_sd_mm"),
    ),
    rows=lambda record: [record["shell"]],
)

DEVIATIONS = Table(
    "deviations_of_points",
    (
        Column("point", sheet="point", width=20),
        Column("course", sheet="course", width=14, optional=True),
        Column("section", sheet="section", width=14, optional=True),
        Column("azimuth_deg", "deg", decimals=2, sheet="azimuth_deg", width=16, optional=True),
        Column("z_m", "m", decimals=3, sheet="of_m", named={"axis": "z"}, width=14, optional=True),
        Column("residual_mm", "image mm", decimals=1, sheet="residual_mm", width=16),
    ),
)

REJECTED = Table(
    "rejected",
    (
        Column("point"),
        *(Column(f"{axis}_m", "m", decimals=3) for axis in "xyz"),
        Column("residual_m", "mm", decimals=1),
        Column("w", decimals=1),
        Column("reason", words="reasons"),
        Column("row", decimals=0),
    ),
    rows=lambda record: record["rejected"],
)


def _correction(paper, row):
    return sentence(paper.words, "corrections", row["code"])


def _source_of_correction(paper, row):
    """Return the principle behind a formula; earlier versions saved a title in place of a code."""
    return paper.words["sources_of_corrections"].get(row["source"], row["source"])


CORRECTIONS = Table(
    "corrections",
    (
        Column("code", text=_correction, sheet="correction", width=34),
        Column("applied", sheet="applied", width=10),
        Column("size_m3", "m3", decimals=LITRE_DECIMALS, sheet="size_m3"),
        Column("size_percent", "percent", decimals=3, sheet="size_percent", width=10,
               in_sheet={"decimals": 4}),
        Column("formula", formulas=True, sheet="formula", width=40),
        Column("source", text=_source_of_correction, sheet="source", width=34),
    ),
    rows=lambda record: record["corrections"],
)  # fmt: skip


def _description(paper, row):
    """Return the description of a piece of equipment with its serial number."""
    if not row["serial_number"]:
        return row["description"]
    return f"{row['description']}, {paper.label('serial_number')} {row['serial_number']}"


EQUIPMENT = Table(
    "equipment",
    (
        Column("name", heading="item", sheet="item", width=20),
        Column("description", text=_description, sheet="description", width=50),
        Column("laboratory", sheet="laboratory", width=34),
        Column("certificate", sheet="certificate", width=16),
        Column("date", heading="calibrated", sheet="calibrated", width=12),
        Column("due", sheet="due", width=12),
        Column("uncertainty", sheet="uncertainty", width=30),
    ),
    rows=lambda record: record["job"].get("equipment") or [],
)


def _day_of_seal(paper, row):
    """Return the day on which a seal was attached; None if not given."""
    return paper.day(row["attached"]) if row["attached"] else None


SEALS = Table(
    "seals",
    (
        Column("name", heading="seal", sheet="seal", width=20),
        Column("place", heading="seal_place", sheet="seal_place", width=50),
        Column("mark", heading="seal_mark", sheet="seal_mark", width=20),
        Column("secures", heading="seal_secures", sheet="seal_secures", width=50),
        Column("attached", text=_day_of_seal, heading="seal_attached", sheet="seal_attached",
               width=18),
    ),
    rows=lambda record: record["job"].get("seals") or [],
)  # fmt: skip
DEADWOOD = Table(
    "deadwood",
    (
        Column("name", heading="item", sheet="item", width=50),
        Column("bottom_m", "m", decimals=3, sheet="bottom_m"),
        Column("top_m", "m", decimals=3, sheet="top_m"),
        Column("volume_m3", "m3", u="u_m3", decimals=LITRE_DECIMALS + 1, sheet="volume_m3",
               width=14),
        Column("u_m3", "m3", u="u_m3", decimals=LITRE_DECIMALS + 1, sheet="u_m3"),
    ),
    rows=lambda record: record["deadwood"],
)  # fmt: skip


# ---- warnings, files and programs


def _place_of_warning(paper, row):
    """Return row and column of a warning, if known."""
    row_text = row["row"] and paper.words["workbook"]["texts"]["row"].format(row=row["row"])
    return ", ".join(part for part in (row_text, row["column"]) if part)


WARNINGS = Table(
    "warnings",
    (
        Column("file", sheet="file", width=24),
        Column("row", decimals=0),
        Column("column"),
        Column("place", text=_place_of_warning, on="", sheet="place", width=24),
        Column("text", sheet="warning", width=80),
    ),
    rows=lambda record: record["warnings"],
)

FILES = Table(
    "files",
    (
        Column("file", sheet="file", width=24),
        Column("bytes", decimals=0, sheet="bytes", width=24),
        Column("sha256", sheet="sha256", width=80),
    ),
    rows=lambda record: record["files"],
)


def _programs(record):
    programs = {"tankcal": record["tankcal"], **record["versions"]}
    return [{"name": name, "version": version} for name, version in programs.items()]


PROGRAMS = Table(
    "versions",
    (
        Column("name", sheet="program", width=24),
        Column("version", sheet="version", width=24),
    ),
    rows=_programs,
)
