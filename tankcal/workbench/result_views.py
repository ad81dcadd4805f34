"""What a desk shows of its last run: the views of `tankcal.workbench.views`, or the table alone."""

from html import escape

from tankcal.record import record_of
from tankcal.text.digits import decimals_of_height, fixed, format_with_u
from tankcal.text.display import table_html
from tankcal.text.words import marks_of

MOST_ROWS = 100


def results_view(desk):
    """What is shown of the last run of a desk, as an object that displays itself."""
    result = desk.last_run.result
    return CapacityPage(result, record_of(result), desk.reader)


def results_page(desk):
    """The same as HTML, with what was written above it."""
    names = ", ".join(path.name for path in desk.last_run.files)
    written = desk.reader.word("written", folder=str(desk.out), files=names)
    return f"<p>{escape(written)}</p>{results_view(desk)._repr_html_()}"


class CapacityPage:
    """The capacity table as HTML; of a long one every so many rows."""

    def __init__(self, result, record, reader):
        self.result, self.record, self.reader = result, record, reader

    def _repr_html_(self):
        marks, word = marks_of(self.reader.words), self.reader.word
        heights, stated = self.result.table.height_m, self.result.intervals
        step = -(-len(heights) // MOST_ROWS)
        rows = []
        for row in [*range(0, len(heights), step)]:
            height = float(heights[row])
            shown = format_with_u(
                float(self.result.table.volume_m3[row]), float(stated.U_m3[row]), marks, least=0
            ) if stated.U_m3[row] > 0 else None  # fmt: skip
            volume = fixed(float(self.result.table.volume_m3[row]), 3, marks)
            rows.append(
                [
                    fixed(height, decimals_of_height(height), marks),
                    volume if shown is None else f"{shown.value}{shown.power}",
                    "" if shown is None else f"{shown.uncertainty}{shown.power}",
                ]
            )
        headings = [word("dip_m"), word("volume_m3"), word("expanded_m3")]
        return table_html(word("capacity"), headings, rows)
