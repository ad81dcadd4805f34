"""The capacity table and its proportional parts, in the units of the job."""

from tankcal.record.columns import rows_of
from tankcal.report import numbers
from tankcal.report.tables.table import Column, Table
from tankcal.report.uncertainty.stated import MARK, flag_simulated, k_of_rows, stated_U_m3
from tankcal.text.digits import LITRE_DECIMALS, decimals_of_height, round_u

# Names of the capacity tables in the report.
PRINTED = "capacity capacity_marked capacity_k capacity_k_marked capacity_monte_carlo"
NOT_FOR_USE = "†"  # mark of rows that must not be used


def capacity_columns(record):
    """Return the columns of the table, {key: values}: volumes in m3 with the stated U.

    U_m3 contains None for rows without uncertainty. by_monte_carlo is present if only some of the
    intervals are results of Monte Carlo. dip, in_unit and U_in_unit are present if the table is in
    feet and inches, litres or barrels.
    """
    capacity, spec = record["capacity"], record["job"]["table"]
    U_m3, simulated = stated_U_m3(capacity), flag_simulated(capacity)
    columns = {key: capacity[key] for key in ("height_m", "volume_m3", "u_m3", "area_m2")}
    columns |= {
        "stated_U_m3": U_m3,
        "U_m3": [U or None for U in U_m3],
        "k": k_of_rows(capacity),
    }
    if "interval" in capacity:  # absent in records of earlier versions
        columns |= {key: capacity[key] for key in ("low_m3", "high_m3", "interval")}
    if len(set(simulated)) > 1:
        columns["by_monte_carlo"] = [MARK if is_simulated else None for is_simulated in simulated]
    if not all(capacity["for_use"]):
        columns["for_use"] = capacity["for_use"]
    if spec.get("ullage"):
        reference = record["job"]["datum"]["reference_height_m"]
        columns["ullage_m"] = [round(reference - height, 6) for height in capacity["height_m"]]
    if spec["height_unit"] != "m":
        columns["dip"] = capacity["dip"]
    if spec["volume_unit"] != "m3":
        factor = numbers.unit(spec["volume_unit"]).factor
        columns["in_unit"] = capacity["volume_m3"]
        columns["exact_in_unit"] = [factor * U for U in U_m3]
        columns["U_in_unit"] = [round_u(U) for U in columns["exact_in_unit"]]
    for density in record["densities"]:
        columns[_key_at_density(density)] = density["volume_m3"]
    return columns


def height_column(spec, key, **more):
    """Return a column of heights of the printed table, in metres or centimetres.

    Whole centimetres have no decimals in a table of centimetres. The workbook keeps metres.
    """
    if spec.get("heights_in") != "cm":
        return Column(key, "m", height=True, **more)
    in_sheet = {"unit": "m", "decimals": None, "height": True}
    return Column(key, "cm", decimals=lambda row: _decimals_of_cm(row[key]), in_sheet=in_sheet,
                  **more)  # fmt: skip


def _decimals_of_cm(height_m):
    """Return the decimals of a height in centimetres: 0 for whole centimetres, else 1 to 3."""
    is_whole = round(100 * height_m, 3) == round(100 * height_m)
    return 0 if is_whole else decimals_of_height(height_m) - 2


def _key_at_density(density):
    """Return the key of the volumes at another density of the liquid."""
    return f"volume_m3_at_{density['density_kg_m3']:g}_kg_m3"


def capacity_rows(record):
    """Return the rows of `capacity_columns` (list of dict)."""
    return rows_of(capacity_columns(record))


def _mark(paper, row):
    return None if row["for_use"] else NOT_FOR_USE


def _use(paper, row):
    return "" if row["for_use"] else paper.words["texts"]["not_for_use"]


def capacity_table(record):
    """Return the Table of the capacity, in the units of height and volume of the job."""
    spec = record["job"]["table"]
    unit, in_feet = spec["volume_unit"], spec["height_unit"] != "m"
    least, named = numbers.unit(unit).least, {"unit": unit}
    with_volume = f"{PRINTED} capacity_density"
    everywhere = f"{with_volume} field_table uneven"
    ullage = "" if in_feet else f"{with_volume} field_table"
    cubic = {"unit": "m3", "u": "stated_U_m3", "least": LITRE_DECIMALS, "decimals": None}
    densities = [_key_at_density(density) for density in record["densities"]]
    return Table(
        "capacity",
        (
            Column("dip", on=everywhere, sheet="dip_ft_in", width=16, csv="dip", optional=True),
            Column("in_unit", unit, u="stated_U_m3", least=least, on="", sheet="volume_in",
                   named=named, width=18, optional=True),
            height_column(spec, "height_m", on="" if in_feet else everywhere,
                          sheet="dip_height_m", width=10, csv="height_m"),
            height_column(spec, "ullage_m", on=ullage, sheet="ullage_m", width=10,
                          csv="ullage_m", optional=True),
            Column("volume_m3", unit, u="U_m3", least=least, decimals=least, on=with_volume,
                   sheet="volume_m3", width=11, csv="volume_m3", in_sheet=cubic),
            Column("volume_m3", unit, decimals=least, on="field_table"),
            Column("volume_m3", unit, u="stated_U_m3", least=least, on="uneven"),
            Column("U_m3", unit, u="U_m3", on=PRINTED),
            Column("stated_U_m3", "m3", u="stated_U_m3", on="", sheet="expanded_m3", csv="U_m3"),
            Column("by_monte_carlo", nothing="", on=PRINTED, optional=True),
            Column("k", decimals=2, nothing="", on=PRINTED, csv="k", optional=True),
            Column("k", decimals=2, nothing="", on="", sheet="k", width=11),
            Column("u_m3", "m3", u="u_m3", on="", sheet="standard_m3", csv="u_m3"),
            Column("area_m2", "L/cm", decimals=1, on="", sheet="litres_per_cm", width=11),
            Column("for_use", text=_mark, nothing="", heading="by_monte_carlo",
                   on=f"{with_volume} field_table", sheet="use", width=14, csv="for_use",
                   in_sheet={"text": _use}, optional=True),
            Column("U_in_unit", u="exact_in_unit", on="", sheet="expanded_in", named=named,
                   optional=True),
            *(Column(f"{end}_m3", unit, u="stated_U_m3", least=least, on="uneven", sheet=code,
                     width=11, csv=f"{end}_m3", in_sheet=cubic, optional=True)
              for end, code in (("low", "from_m3"), ("high", "to_m3"))),
            Column("interval", words="intervals", on="", sheet="interval", csv="interval",
                   optional=True),
            *(Column(key, on="", csv=key) for key in densities),
        ),
        rows=capacity_rows,
        last={"csv": f"k stated_U_m3 low_m3 high_m3 interval dip {' '.join(densities)} for_use"},
        csv_style="%.6f",
    )  # fmt: skip


def high_legs_table(record):
    """Return the Table of the rows with the roof on high legs, in the units of the job."""
    spec = record["job"]["table"]
    least = numbers.unit(spec["volume_unit"]).least
    return Table(
        "on_high_legs",
        (
            height_column(spec, "height_m", sheet="dip_height_m", width=13),
            Column("volume_m3", spec["volume_unit"], u="U_m3", least=least, sheet="volume_m3",
                   width=14, in_sheet={"unit": "m3", "least": LITRE_DECIMALS}),
            Column("U_m3", spec["volume_unit"], u="U_m3", sheet="expanded_m3",
                   in_sheet={"unit": "m3"}),
            Column("for_use", text=_mark, nothing="", heading="by_monte_carlo", sheet="use",
                   width=14, in_sheet={"text": _use}),
        ),
        rows=lambda record: record.get("on_high_legs") or [],
    )  # fmt: skip


def roof_corrections_table(record):
    """Return the Table of the corrections for the density of the liquid on which a roof floats."""
    unit = record["job"]["table"]["volume_unit"]
    least = numbers.unit(unit).least
    return Table(
        "roof_corrections",
        (
            Column("density_kg_m3", "kg/m3", decimals=0, sheet="roof_density", width=16),
            Column("correction_m3", unit, decimals=least, sheet="roof_correction", width=16,
                   in_sheet={"unit": "m3", "decimals": LITRE_DECIMALS}),
        ),
        rows=lambda record: record.get("roof_corrections") or [],
    )  # fmt: skip


# ---- proportional parts: volume of additional millimetres in a centimetre table


def part_rows(record):
    """Return the zones of constant proportional parts, with the volumes of 1 mm to 9 mm."""
    return [
        zone | {f"part_{n}": part for n, part in enumerate(zone["part_m3"], 1)}
        for zone in record["proportional_parts"]["zones"]
    ]


def parts_table(record):
    """Return the Table of the proportional parts of a record."""
    spec = record["job"]["table"]
    unit = spec["volume_unit"]
    ends = (("bottom_m", "from_m"), ("top_m", "to_m"))
    return Table(
        "proportional_parts",
        (
            *(height_column(spec, key, sheet=code, width=10) for key, code in ends),
            *(
                Column(f"part_{n}", unit, digits=4, sheet="part_l", named={"millimetres": n},
                       width=11, in_sheet={"unit": "L", "digits": None, "decimals": 1})
                for n in range(1, record["proportional_parts"]["parts"])
            ),
        ),
        rows=part_rows,
    )  # fmt: skip
