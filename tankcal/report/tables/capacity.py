"""The capacity table, and the proportional parts beside it: in the units that a job asks for."""

from tankcal.record.plain_data import rows_of
from tankcal.report import numbers
from tankcal.report.tables.table import Column, Table
from tankcal.report.uncertainty.stated import MARK, by_monte_carlo, k_of_rows, stated_U_m3
from tankcal.text.digits import LITRE_DECIMALS, round_u

PRINTED = "capacity capacity_marked capacity_k capacity_k_marked capacity_monte_carlo"
NOT_FOR_USE = "†"


def capacity_columns(record):
    """The rows of the table as {key: values}: volumes in m3, U as it is stated.

    Some are there only where they say something: U_m3 where an input was uncertain,
    by_monte_carlo where some intervals are the simulation's and others not, dip, in_unit and
    U_in_unit where the table is in feet and inches, litres or barrels.
    """
    capacity, spec = record["capacity"], record["job"]["table"]
    U_m3, simulated = stated_U_m3(capacity), by_monte_carlo(capacity)
    found = {key: capacity[key] for key in ("height_m", "volume_m3", "u_m3", "area_m2")}
    found |= {
        "stated_U_m3": U_m3,
        "U_m3": U_m3 if any(U_m3) else [None] * len(U_m3),
        "k_of_gum": capacity["k"],
        "k": k_of_rows(capacity),
    }
    if "interval" in capacity:  # none in a record from before
        found |= {key: capacity[key] for key in ("low_m3", "high_m3", "interval")}
    if len(set(simulated)) > 1:
        found["by_monte_carlo"] = [MARK if one else None for one in simulated]
    if not all(capacity["for_use"]):
        found["for_use"] = capacity["for_use"]
    if spec["height_unit"] != "m":
        found["dip"] = capacity["dip"]
    if spec["volume_unit"] != "m3":
        factor = numbers.unit(spec["volume_unit"]).factor
        found["in_unit"] = capacity["volume_m3"]
        found["exact_in_unit"] = [factor * U for U in U_m3]
        found["U_in_unit"] = [round_u(U) for U in found["exact_in_unit"]]
    for other in record["densities"]:
        found[_at(other)] = other["volume_m3"]
    return found


def _at(other):
    """The key of the volumes at a further density of the liquid."""
    return f"volume_m3_at_{other['density_kg_m3']:g}_kg_m3"


def capacity_rows(record):
    """The rows of `capacity_columns`, a dict each."""
    return rows_of(capacity_columns(record))


def _mark(paper, row):
    return None if row["for_use"] else NOT_FOR_USE


def _use(paper, row):
    return "" if row["for_use"] else paper.words["texts"]["not_for_use"]


def capacity_table(record):
    """The Table of a record's capacity, by the units of height and volume of its job."""
    spec = record["job"]["table"]
    unit, in_feet = spec["volume_unit"], spec["height_unit"] != "m"
    least, named = numbers.unit(unit).least, {"unit": unit}
    with_volume = f"{PRINTED} capacity_density"
    everywhere = f"{with_volume} field_table uneven"
    cubic = {"unit": "m3", "u": "stated_U_m3", "least": LITRE_DECIMALS, "decimals": None}
    densities = [_at(other) for other in record["densities"]]
    return Table(
        "capacity",
        (
            Column("dip", on=everywhere, sheet="dip_ft_in", width=16, csv="dip", optional=True),
            Column("in_unit", unit, u="stated_U_m3", least=least, on="", sheet="volume_in",
                   named=named, width=18, optional=True),
            Column("height_m", "m", height=True, on="" if in_feet else everywhere,
                   sheet="dip_height_m", width=10, csv="height_m"),
            Column("volume_m3", unit, u="U_m3", least=least, decimals=least, on=with_volume,
                   sheet="volume_m3", width=11, csv="volume_m3", in_sheet=cubic),
            Column("volume_m3", unit, decimals=least, on="field_table"),
            Column("volume_m3", unit, u="stated_U_m3", least=least, on="uneven"),
            Column("U_m3", unit, u="U_m3", on=PRINTED),
            Column("stated_U_m3", "m3", u="stated_U_m3", on="", sheet="expanded_m3", csv="U_m3"),
            Column("by_monte_carlo", nothing="", on=PRINTED, optional=True),
            Column("k", decimals=2, nothing="", on=PRINTED, csv="k", optional=True),
            Column("k_of_gum", decimals=2, on="", sheet="k_of_gum", width=11),
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


# ---- what millimetres add to a row of a centimetre table


def part_rows(record):
    """Zones of the table in which millimetres add the same, with what 1 mm to 9 mm add."""
    return [
        zone | {f"part_{n}": part for n, part in enumerate(zone["part_m3"], 1)}
        for zone in record["proportional_parts"]["zones"]
    ]


def parts_table(record):
    """The Table of the proportional parts of a record."""
    unit = record["job"]["table"]["volume_unit"]
    ends = (("bottom_m", "from_m"), ("top_m", "to_m"))
    return Table(
        "proportional_parts",
        (
            *(Column(key, "m", height=True, sheet=code, width=10) for key, code in ends),
            *(
                Column(f"part_{n}", unit, digits=4, sheet="part_l", named={"millimetres": n},
                       width=11, in_sheet={"unit": "L", "digits": None, "decimals": 1})
                for n in range(1, record["proportional_parts"]["parts"])
            ),
        ),
        rows=part_rows,
    )  # fmt: skip
