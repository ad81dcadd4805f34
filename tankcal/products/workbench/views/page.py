"""Frames with pages of a result in a notebook, and the answers of the calculators.

The frame is a sandbox: a page has no access to the notebook and loads nothing from the network. In
a saved notebook, the calculators and pictures of the page still work.

Answers of the calculators: volume of a dip, dip of a volume, volume between two dips.

Volumes, U and k agree with the certificate and the page. Between two rows, the larger U of the rows
applies. A simulated delivery has the U of its simulation.
"""

import re
from dataclasses import dataclass
from html import escape

import numpy as np

from tankcal.errors import HeightError
from tankcal.products.desk.result_pages import whole_page
from tankcal.report.numbers import unit
from tankcal.text.digits import decimals_of, decimals_of_height, fixed
from tankcal.text.words import say

HEIGHT = "44rem"  # height of a frame
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)")
SAME_M = 1e-9  # largest difference of dips that are treated as equal
MOST_LETTERS = 40  # largest number of characters of the entered text in an answer


def frame_html(html, title):
    """HTML of a frame that contains a page."""
    style = f"box-sizing:border-box;width:100%;height:{HEIGHT};border:1px solid #c3cad2"
    return (
        f'<iframe sandbox="allow-scripts" title="{escape(title)}" style="{style}" '
        f'srcdoc="{escape(html)}"></iframe>'
    )


class SavedView:
    """Results as a single HTML page, `html`, which a notebook displays in a frame."""

    def __init__(self, paper):
        self._paper = paper

    @property
    def html(self):
        """HTML of the page with all parts."""
        return whole_page(self._paper)

    def _repr_html_(self):
        return frame_html(self.html, self._paper.word("views.results"))


# ---- answers of the calculators: volume of a dip, dip of a volume, volume between two dips


@dataclass(frozen=True)
class Answer:
    """Answer of a calculator.

    Attributes
    ----------
    text : str
        Sentence with the answer.
    facts : tuple of (str, str)
        Labels and values of further results.
    is_refused : bool
        Whether the question was refused.
    """

    text: str
    facts: tuple[tuple[str, str], ...] = ()
    is_refused: bool = False


def parse_number(text):
    """Number in an entered text, with decimal point or comma, or None."""
    plain = text.strip().replace(",", ".")
    return float(plain) if len(plain) < MOST_LETTERS and _NUMBER.fullmatch(plain) else None


class Calculator:
    """Answers for a result, in the language of a `Paper` of its record."""

    def __init__(self, result, paper):
        self.result, self.paper = result, paper
        self._unit = unit(paper.record["job"]["table"]["volume_unit"])
        self._critical = result.table.critical_m

    @property
    def unit(self):
        """Symbol of the unit of the volumes."""
        return self._unit.symbol

    # ---- questions

    def volume_at(self, text):
        """Answer with the volume at a dip, entered in metres."""
        dip = self._dip(text)
        if isinstance(dip, Answer):
            return dip
        volume, row = self.result.at(dip), self._worse_row(dip)
        stated = self.result.intervals
        U, k = stated.U_m3[row], self.result.table.k[row] if stated.by_gum[row] else None
        facts = [self._standard(self.result.table.u_m3[row])]
        return self._state_volume(volume.value_m3, float(U), k, [*facts, *self._ullage(dip)])

    def dip_of(self, text):
        """Answer with the dip of a volume, entered in the unit of the table."""
        volume = parse_number(text)
        if volume is None:
            return self._refuse(
                "views.no_volume" if text.strip() else "views.type_volume",
                text=text.strip()[:MOST_LETTERS],
                unit=self._unit.symbol,
            )
        try:
            result = self.result.dip_of(volume / self._unit.factor)
        except HeightError as error:
            return self._refuse("views.refused", reason=say(self.paper.words, error.args[0]))
        dip, u = float(result.height_m[0]), float(result.u_m[0])
        k = float(self.result.table.at(dip).k)
        paper = self.paper
        answer = paper.word(
            "views.dip",
            dip=self._metres(dip, 4),
            U=paper.number(k * u, "mm", u=k * u),
            k=fixed(k, 2, paper.marks),
            coverage=paper.coverage(),
        )
        return Answer(answer, tuple(self._ullage(dip)))

    def delivery(self, first, second):
        """Answer with the volume between two dips, entered in metres in any order."""
        dips = [self._dip(first), self._dip(second)]
        for dip in dips:
            if isinstance(dip, Answer):
                return dip
        low, high = sorted(dips)
        if high - low < SAME_M:
            return self._refuse("web.same_dip")
        delivery = self.result.delivery(low, high)
        facts = [] if delivery.k is None else [self._standard(delivery.u_m3)]
        return self._state_volume(delivery.value_m3, delivery.U_m3, delivery.k, facts)

    # ---- parts of an answer

    def _dip(self, text):
        """Dip in the range of the table, or an `Answer` that refuses the entered text."""
        heights, dip = self.result.table.height_m, parse_number(text)
        if not text.strip():
            return self._refuse("web.type_dip")
        if dip is None:
            return self._refuse("web.no_number", text=text.strip()[:MOST_LETTERS])
        if dip < heights[0] - SAME_M:
            return self._refuse("web.below", **{"from": self._metres(heights[0])})
        if dip > max(heights[-1], round(heights[-1], 3)) + SAME_M:
            return self._refuse("web.above", to=self._metres(heights[-1]))
        low, high = self._critical or (np.inf, -np.inf)
        if low + SAME_M < dip < high - SAME_M:
            return self._refuse("web.critical")
        return float(np.clip(dip, heights[0], heights[-1]))

    def _worse_row(self, dip):
        """Index of the row of a dip, or of the neighbouring row with the larger U."""
        rows = self.result.table.rows_of(dip)
        U = self.result.intervals.U_m3[rows]
        return int(rows[-1] if U[-1] >= U[0] else rows[0])

    def _state_volume(self, volume_m3, U_m3, k, facts):
        """Answer with a volume, its U and k, and the relative U; k is None if simulated."""
        volume, U = volume_m3 * self._unit.factor, U_m3 * self._unit.factor
        least = self._unit.least
        places = decimals_of(U) if U > 0 else least
        words = self.paper
        answer = words.word(
            "web.result_simulated" if k is None else "web.result",
            volume=self._quantity(volume, max(places, least)),
            U=self._quantity(U, places),
            k="" if k is None else fixed(k, 2, words.marks),
            coverage=words.coverage(),
        )
        if volume > 0:
            facts = [
                *facts,
                (words.word("web.relative_U"), f"{fixed(100 * U / volume, 3, words.marks)} %"),
            ]
        return Answer(answer, tuple(facts))

    def _standard(self, u_m3):
        """Label and value of the standard uncertainty."""
        u = float(u_m3) * self._unit.factor
        places = decimals_of(u) if u > 0 else self._unit.least
        return self.paper.word("web.standard_u"), self._quantity(u, places)

    def _ullage(self, dip):
        """Label and value of the ullage of a dip, if the reference height is known."""
        reference = self.result.job.datum.reference_height_m
        if reference is None:
            return []
        return [(self.paper.word("web.ullage"), self._metres(reference - dip))]

    def _quantity(self, value, places):
        """Text of a volume with its unit."""
        return f"{fixed(value, places, self.paper.marks)}\N{NO-BREAK SPACE}{self._unit.symbol}"

    def _metres(self, height, places=None):
        """Text of a height in metres."""
        places = decimals_of_height(height) if places is None else places
        return f"{fixed(height, places, self.paper.marks)}\N{NO-BREAK SPACE}m"

    def _refuse(self, name, **values):
        """Answer that refuses a question."""
        return Answer(self.paper.word(name, **values), is_refused=True)
