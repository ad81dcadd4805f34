"""The capacity table of the certificate, each row with the interval that counts."""

from tankcal.report.tables.capacity import NOT_FOR_USE, capacity_rows, capacity_table
from tankcal.report.uncertainty.stated import by_monte_carlo, uneven_rows

MOST_ACROSS, MOST_ACROSS_OF_DENSITIES = 4, 5
LETTERS_OF_A_LINE = 114  # of the small print of the table, gaps between its columns left out


def capacity_blocks(paper):
    """The rows whose interval is not even about the volume, then the whole table."""
    record = paper.record
    table, rows = capacity_table(record), capacity_rows(record)
    of_k = next(one for one in table.columns if one.key == "k")
    k_printed = set(paper.column_texts([row for row in rows if row["k"] is not None], of_k))
    if len(k_printed) < 2:
        rows = [{key: value for key, value in row.items() if key != "k"} for row in rows]
    name = _caption(set(by_monte_carlo(record["capacity"])), k_printed)
    whole = paper.show(
        table,
        rows,
        on=name,
        across=times_across(paper, rows, table.on_paper(name, rows)),
        coverage=paper.coverage(),
        k=min(k_printed, default=None),
    )
    return [*_uneven(paper, table, rows), *note_on_use(paper, rows), whole]


def note_on_use(paper, rows):
    """What the mark of rows that are not for use means; nothing where all are."""
    if "for_use" not in rows[0]:
        return []
    return [paper.paragraph("not_for_use_marked", mark=NOT_FOR_USE)]


def density_blocks(paper):
    """The table for each further density of the liquid."""
    blocks, name = [], "capacity_density"
    table, of_table = capacity_table(paper.record), capacity_rows(paper.record)
    columns = table.on_paper(name, of_table)
    for other in paper.record["densities"]:
        volumes = zip(of_table, other["volume_m3"], strict=True)
        rows = [row | {"volume_m3": volume} for row, volume in volumes]
        density = paper.number(other["density_kg_m3"], "kg/m3", digits=4)
        across = times_across(paper, rows, columns, most=MOST_ACROSS_OF_DENSITIES)
        blocks.append(paper.show(table, rows, on=name, across=across, density=density))
    return blocks


def times_across(paper, rows, columns, most=MOST_ACROSS):
    """How many times the columns stand side by side on a page: as often as they have room."""
    longest = [max(map(len, paper.column_texts(rows, column))) for column in columns]
    return max(1, min(most, LETTERS_OF_A_LINE // sum(1 + length for length in longest)))


def _caption(simulated, k_printed):
    if simulated == {True}:
        return "capacity_monte_carlo"
    name = "capacity_k" if len(k_printed) == 1 else "capacity"
    return f"{name}_marked" if True in simulated else name


def _uneven(paper, table, rows):
    places = uneven_rows(paper.record["capacity"])
    if not places:
        return []
    shown = [rows[place] for place in places]
    return [paper.show(table, shown, on="uneven", across=3, coverage=paper.coverage())]
