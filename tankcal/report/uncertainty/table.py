"""The capacity table of the certificate, each row with the interval that counts."""

from tankcal.report.numbers import unit
from tankcal.report.paper import Column
from tankcal.report.uncertainty.stated import (
    MARK,
    by_monte_carlo,
    k_of_rows,
    stated_U_m3,
    uneven_rows,
)

MOST_ACROSS, MOST_ACROSS_OF_DENSITIES = 4, 5
NOT_FOR_USE = "†"
LETTERS_OF_A_LINE = 114  # of the small print of the table, gaps between its columns left out


def capacity_rows(paper):
    """The rows of the table: dip, volume, the U that is stated, k, mark, use.

    U is None where no row has any, since no input was uncertain.
    """
    capacity = paper.record["capacity"]
    U_m3 = stated_U_m3(capacity)
    columns = {
        **{key: capacity[key] for key in ("height_m", "dip", "volume_m3")},
        "U_m3": U_m3 if any(U_m3) else [None] * len(U_m3),
        "k": k_of_rows(capacity),
        "by_monte_carlo": [MARK if one else None for one in by_monte_carlo(capacity)],
        "for_use": [None if good else NOT_FOR_USE for good in capacity["for_use"]],
    }
    return paper.rows(columns, list(columns))


def capacity_blocks(paper):
    """The rows whose interval is not even about the volume, then the whole table."""
    rows = capacity_rows(paper)
    columns = volume_columns(paper)
    simulated = {row["by_monte_carlo"] for row in rows}
    if len(simulated) > 1:
        columns.append(Column("by_monte_carlo", nothing=""))
    k_column = Column("k", decimals=2, nothing="")
    k_printed = set(paper.column_texts([row for row in rows if row["k"] is not None], k_column))
    if len(k_printed) > 1:
        columns.append(k_column)
    refused = use_columns(rows)
    columns += refused
    table = paper.table(
        _caption(simulated, k_printed),
        rows,
        columns,
        across=times_across(paper, rows, columns),
        coverage=paper.coverage(),
        k=min(k_printed, default=None),
    )
    note = [paper.paragraph("not_for_use_marked", mark=NOT_FOR_USE)] if refused else []
    return [*_uneven(paper), *note, table]


def density_blocks(paper):
    """The table for each further density of the liquid."""
    blocks = []
    of_table = capacity_rows(paper)
    columns = [*volume_columns(paper)[:2], *use_columns(of_table)]
    for other in paper.record["densities"]:
        volumes = zip(of_table, other["volume_m3"], strict=True)
        rows = [row | {"volume_m3": volume} for row, volume in volumes]
        density = paper.number(other["density_kg_m3"], "kg/m3", digits=4)
        across = times_across(paper, rows, columns, most=MOST_ACROSS_OF_DENSITIES)
        blocks.append(
            paper.table("capacity_density", rows, columns, across=across, density=density)
        )
    return blocks


def use_columns(rows):
    """The column of the marks of rows that are not for use, where there are any."""
    if not any(row["for_use"] for row in rows):
        return []
    return [Column("for_use", nothing="", heading="by_monte_carlo")]


def times_across(paper, rows, columns, most=MOST_ACROSS):
    """How many times the columns stand side by side on a page: as often as they have room."""
    longest = [max(map(len, paper.column_texts(rows, column))) for column in columns]
    return max(1, min(most, LETTERS_OF_A_LINE // sum(1 + length for length in longest)))


def volume_columns(paper):
    """Height, volume and U in the units of the table."""
    spec = paper.record["job"]["table"]
    volume_unit, least = spec["volume_unit"], unit(spec["volume_unit"]).least
    return [
        Column("dip") if spec["height_unit"] != "m" else Column("height_m", "m", height=True),
        Column("volume_m3", volume_unit, u="U_m3", least=least, decimals=least),
        Column("U_m3", volume_unit, u="U_m3"),
    ]


def _caption(simulated, k_printed):
    if simulated == {MARK}:
        return "capacity_monte_carlo"
    name = "capacity_k" if len(k_printed) == 1 else "capacity"
    return f"{name}_marked" if MARK in simulated else name


def _uneven(paper):
    capacity = paper.record["capacity"]
    places = uneven_rows(capacity)
    if not places:
        return []
    keys = ("height_m", "dip", "volume_m3", "low_m3", "high_m3", "stated_U_m3")
    rows = [{key: capacity[key][place] for key in keys} for place in places]
    height, volume, _ = volume_columns(paper)
    of_ends = {"u": "stated_U_m3", "least": volume.least}
    columns = [
        height,
        *(Column(key, volume.unit, **of_ends) for key in ("volume_m3", "low_m3", "high_m3")),
    ]
    return [paper.table("uneven", rows, columns, across=3, coverage=paper.coverage())]
