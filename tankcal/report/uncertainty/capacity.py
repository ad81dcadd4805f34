"""The capacity table of the certificate, with the coverage interval of each row."""

from functools import partial

from tankcal.report.tables.capacity import (
    NOT_FOR_USE,
    capacity_rows,
    capacity_table,
    high_legs_table,
    roof_corrections_table,
)
from tankcal.report.uncertainty.stated import flag_simulated, uneven_rows

MOST_ACROSS, MOST_ACROSS_OF_DENSITIES = 4, 5  # largest number of parts side by side
LETTERS_OF_A_LINE = 114  # letters of a line of the table, without gaps between columns


def capacity_blocks(paper):
    """Tables of the rows with asymmetric interval, and of all rows."""
    record = paper.record
    table, rows = capacity_table(record), capacity_rows(record)
    column_of_k = next(column for column in table.columns if column.key == "k")
    k_printed = set(paper.column_texts([row for row in rows if row["k"] is not None], column_of_k))
    if len(k_printed) < 2:  # the caption states a common k
        rows = [{key: value for key, value in row.items() if key != "k"} for row in rows]
    name = _caption(set(flag_simulated(record["capacity"])), k_printed)
    block = paper.show(
        table,
        rows,
        on=name,
        across=times_across,
        coverage=paper.coverage(),
        k=min(k_printed, default=None),
    )
    return [*_uneven(paper, table, rows), *note_on_use(paper, rows), block]


def note_on_use(paper, rows):
    """Paragraph on the mark of rows that must not be used; [] if all rows may be used."""
    if "for_use" not in rows[0]:
        return []
    return [paper.paragraph("not_for_use_marked", mark=NOT_FOR_USE)]


def density_blocks(paper):
    """Table for each additional density of the liquid."""
    blocks, name = [], "capacity_density"
    table, table_rows = capacity_table(paper.record), capacity_rows(paper.record)
    for entry in paper.record["densities"]:
        volumes = zip(table_rows, entry["volume_m3"], strict=True)
        rows = [row | {"volume_m3": volume} for row, volume in volumes]
        density = paper.number(entry["density_kg_m3"], "kg/m3", digits=4)
        across = partial(times_across, most=MOST_ACROSS_OF_DENSITIES)
        blocks.append(paper.show(table, rows, on=name, across=across, density=density))
    return blocks


def ends_of_high_legs(paper):
    """Return the lowest and the highest dip of the table with the roof on high legs, as texts."""
    rows = paper.record["on_high_legs"]
    return {"low": paper.height(rows[0]["height_m"]), "high": paper.height(rows[-1]["height_m"])}


def roof_blocks(paper):
    """Tables of the roof on high legs, and of its corrections by density; [] without a roof."""
    record, shown = paper.record, []
    if rows := record.get("on_high_legs"):
        table = high_legs_table(record)
        ends = ends_of_high_legs(paper) | {"coverage": paper.coverage()}
        shown.append(paper.paragraph("not_for_use_marked", mark=NOT_FOR_USE))
        shown.append(paper.show(table, rows, across=times_across, **ends))
    if record.get("roof_corrections"):
        details = {size["code"]: size["value"] for size in record["roof"]}
        density = paper.number(details["roof_reference_density"], "kg/m3", digits=4)
        table = roof_corrections_table(record)
        shown.append(paper.show(table, table.rows(record), across=4, density=density))
    return shown


def times_across(texts, most=MOST_ACROSS):
    """Return how often columns fit side by side on a page, at most `most`.

    Parameters
    ----------
    texts : list of list of str
        Cells of each column.
    most : int, optional
        Largest result.

    Returns
    -------
    int
    """
    longest = [max(map(len, column)) for column in texts]
    return max(1, min(most, LETTERS_OF_A_LINE // sum(1 + length for length in longest)))


def _caption(simulated, k_printed):
    if simulated == {True}:
        return "capacity_monte_carlo"
    name = "capacity_k" if len(k_printed) == 1 else "capacity"
    return f"{name}_marked" if True in simulated else name


def _uneven(paper, table, rows):
    indices = uneven_rows(paper.record["capacity"])
    if not indices:
        return []
    shown = [rows[index] for index in indices]
    return [paper.show(table, shown, on="uneven", across=3, coverage=paper.coverage())]
