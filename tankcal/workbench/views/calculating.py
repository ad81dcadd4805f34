"""What the calculators answer: volume of a dip, dip of a volume, volume between two dips.

The volumes, U and k are those that certificate and page state: between two rows U is that of the
row with the larger one, a delivery that was simulated has the U of its simulation.
"""

import re
from dataclasses import dataclass

import numpy as np

from tankcal.errors import HeightError
from tankcal.report.numbers import unit
from tankcal.text.digits import decimals_of, decimals_of_height, fixed
from tankcal.text.words import say

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)")
SAME_M = 1e-9
MOST_LETTERS = 40  # of what was typed, in an answer


@dataclass(frozen=True)
class Answer:
    """A sentence, what stands beside it, and whether the question was refused.

    Attributes
    ----------
    text : str
    facts : tuple of (str, str)
        Labels and values.
    is_refused : bool
    """

    text: str
    facts: tuple[tuple[str, str], ...] = ()
    is_refused: bool = False


def typed_number(text):
    """The number that was typed, with a decimal point or comma; None for anything else."""
    plain = text.strip().replace(",", ".")
    return float(plain) if len(plain) < MOST_LETTERS and _NUMBER.fullmatch(plain) else None


class Calculator:
    """Answers for a result, in the words of a paper of its record."""

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
        """The volume at a dip in metres."""
        dip = self._dip(text)
        if isinstance(dip, Answer):
            return dip
        found, row = self.result.at(dip), self._worse_row(dip)
        stated = self.result.intervals
        U, k = stated.U_m3[row], self.result.table.k[row] if stated.by_gum[row] else None
        facts = [self._standard(self.result.table.u_m3[row])]
        return self._stated(found.value_m3, float(U), k, [*facts, *self._ullage(dip)])

    def dip_of(self, text):
        """The dip of a volume in the unit of the table."""
        volume = typed_number(text)
        if volume is None:
            return self._refused(
                "views.no_volume" if text.strip() else "views.type_volume",
                text=text.strip()[:MOST_LETTERS],
                unit=self._unit.symbol,
            )
        try:
            found = self.result.dip_of(volume / self._unit.factor)
        except HeightError as error:
            return self._refused("views.refused", reason=say(self.paper.words, error.args[0]))
        dip, u = float(found.height_m[0]), float(found.u_m[0])
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

    def delivery(self, one, other):
        """The volume between two dips in metres, given in any order."""
        dips = [self._dip(one), self._dip(other)]
        for dip in dips:
            if isinstance(dip, Answer):
                return dip
        low, high = sorted(dips)
        if high - low < SAME_M:
            return self._refused("web.same_dip")
        found = self.result.delivery(low, high)
        facts = [] if found.k is None else [self._standard(found.u_m3)]
        return self._stated(found.value_m3, found.U_m3, found.k, facts)

    # ---- parts of an answer

    def _dip(self, text):
        """A dip of the table; an `Answer` that refuses it."""
        heights, dip = self.result.table.height_m, typed_number(text)
        if not text.strip():
            return self._refused("web.type_dip")
        if dip is None:
            return self._refused("web.no_number", text=text.strip()[:MOST_LETTERS])
        if dip < heights[0] - SAME_M:
            return self._refused("web.below", **{"from": self._metres(heights[0])})
        if dip > max(heights[-1], round(heights[-1], 3)) + SAME_M:
            return self._refused("web.above", to=self._metres(heights[-1]))
        low, high = self._critical or (np.inf, -np.inf)
        if low + SAME_M < dip < high - SAME_M:
            return self._refused("web.critical")
        return float(np.clip(dip, heights[0], heights[-1]))

    def _worse_row(self, dip):
        """Number of the row that a dip is read from, of two that with the larger U."""
        rows = self.result.table.rows_of(dip)
        U = self.result.intervals.U_m3[rows]
        return int(rows[-1] if U[-1] >= U[0] else rows[0])

    def _stated(self, volume_m3, U_m3, k, facts):
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
        u = float(u_m3) * self._unit.factor
        places = decimals_of(u) if u > 0 else self._unit.least
        return self.paper.word("web.standard_u"), self._quantity(u, places)

    def _ullage(self, dip):
        reference = self.result.job.datum.reference_height_m
        if reference is None:
            return []
        return [(self.paper.word("web.ullage"), self._metres(reference - dip))]

    def _quantity(self, value, places):
        return f"{fixed(value, places, self.paper.marks)}\N{NO-BREAK SPACE}{self._unit.symbol}"

    def _metres(self, height, places=None):
        places = decimals_of_height(height) if places is None else places
        return f"{fixed(height, places, self.paper.marks)}\N{NO-BREAK SPACE}m"

    def _refused(self, name, **values):
        return Answer(self.paper.word(name, **values), is_refused=True)
