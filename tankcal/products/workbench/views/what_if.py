"""Budget of a volume with changed standard uncertainties of its lines.

U follows from the law of propagation, as in the budget of the report. If the certificate states a U
by Monte Carlo, this U differs, and the answer states the difference of method.

`BudgetPanel` shows the budget at any height, with a factor for each standard uncertainty.
"""

from dataclasses import dataclass, replace
from html import escape

import ipywidgets as widgets

from tankcal.errors import HeightError
from tankcal.products.workbench.views.page import parse_number
from tankcal.record.schema import to_plain
from tankcal.record.table import budget_lines
from tankcal.report.numbers import degrees_of_freedom
from tankcal.report.tables import Column
from tankcal.report.uncertainty.budget import budget_table
from tankcal.report.web import block_html
from tankcal.text.digits import UNKNOWN_DECIMALS, decimals_of, fixed
from tankcal.text.words import say

LARGEST, STEP = 3.0, 0.05  # largest factor, and step of its slider
STYLE = """<style>.tankcal-budget th, .tankcal-budget td { padding: 0 8px; line-height: 1.6;
  vertical-align: top } .tankcal-budget .left { text-align: left }
.tankcal-budget .right, .tankcal-budget .decimal { text-align: right; white-space: nowrap;
  font-variant-numeric: tabular-nums }</style>"""


@dataclass(frozen=True)
class ChangedBudget:
    """Budgets without and with changed standard uncertainties.

    Attributes
    ----------
    now, then : Budget
        Budget without and with the factors.
    names : tuple of str
        Names of the lines in the language.
    factors : tuple of float
        Factor of u of each line.
    is_simulated : bool
        Whether the certificate states this U by Monte Carlo.
    """

    now: object
    then: object
    names: tuple[str, ...]
    factors: tuple[float, ...]
    is_simulated: bool = False


def change_budget(result, paper, high_m, low_m=None, factors=None):
    """Compute the budget of a dip, or of a delivery between two dips, with factors of u.

    Parameters
    ----------
    result : Result
        Result of the job.
    paper : Paper
        Report of its record, for the names of the lines.
    high_m, low_m : float
        Dips, m; with low_m None, the volume below high_m.
    factors : dict, optional
        Factors of u, {index of a line: factor}; 1 for other lines.

    Returns
    -------
    ChangedBudget

    Raises
    ------
    HeightError
        For a dip outside the table.
    """
    now = result.budget(high_m, low_m)
    all_factors = tuple(float((factors or {}).get(i, 1.0)) for i in range(len(now.lines)))
    then = result.budget(high_m, low_m, factors=all_factors)
    names = tuple(paper.input_name(line) for line in to_plain(budget_lines(now.lines)))
    stated = result.at(high_m) if low_m is None else result.delivery(low_m, high_m)
    return ChangedBudget(now, then, names, all_factors, stated.interval == "monte_carlo")


def budget_sentences(paper, changed):
    """Sentences with volume, U, k and degrees of freedom, without and with the factors."""
    now, then = changed.now, changed.then
    lines = [
        paper.word(
            "views.budget_now",
            volume=paper.number(now.volume_m3, "m3", u=now.U_m3),
            **_totals(paper, now),
        )
    ]
    if any(factor != 1.0 for factor in changed.factors):
        change = 100 * (then.U_m3 / now.U_m3 - 1) if now.U_m3 > 0 else 0.0
        lines.append(
            paper.word(
                "views.budget_then",
                **_totals(paper, then),
                change=f"{'+' if change > 0 else ''}{fixed(change, 1, paper.marks)}",
            )
        )
    if changed.is_simulated:
        lines.append(paper.word("views.budget_simulated"))
    return lines


def _totals(paper, budget):
    """Texts of U, u, k and degrees of freedom of a budget."""
    return {
        "U": paper.number(budget.U_m3, "m3", u=budget.U_m3),
        "u": paper.number(budget.u_m3, "m3", u=budget.u_m3),
        "k": paper.number(budget.k, decimals=2),
        "dof": degrees_of_freedom(budget.dof, paper.marks),
    }


def table_html(paper, changed):
    """HTML table of the lines of the budget with the factors."""
    U = changed.now.U_m3
    table = budget_table(decimals_of(U) + 1 if U > 0 else UNKNOWN_DECIMALS)
    table = table.only("input", "u", "unit", "how", "dof", "contribution_m3", "share")
    factor = Column("factor", decimals=2, heading="factor_of_u")
    input_, *others = table.columns
    lines = to_plain(budget_lines(changed.then.lines))
    rows = [line | {"factor": value} for line, value in zip(lines, changed.factors, strict=True)]
    shown = replace(table, columns=(input_, factor, *others))
    return block_html(paper.show(shown, rows, on="budget_what_if").data)


class BudgetPanel:
    """Slider of the dip, second dip of a delivery, and a factor for each line of the budget."""

    def __init__(self, result, paper):
        self.result, self.paper = result, paper
        word, heights = paper.word, result.table.height_m
        labels = [(paper.height(float(item)), float(item)) for item in heights]
        wide = {"description_width": "initial"}
        self.dip = widgets.SelectionSlider(
            options=labels,
            value=labels[-1][1],
            description=word("views.dip_m"),
            continuous_update=False,
            style=wide,
            layout={"width": "40rem"},
        )
        self.low = widgets.Text(
            description=word("views.low_dip"), style=wide, layout={"width": "22rem"}
        )
        initial = change_budget(result, paper, float(heights[-1]))
        self.factors = [self._slider(name) for name in initial.names]
        self.reset = widgets.Button(description=word("views.reset"), layout={"width": "auto"})
        self.reset.on_click(lambda _: self.reset_factors())
        self.totals, self.table = widgets.HTML(), widgets.HTML()
        self.table.add_class("tankcal-budget")
        for item in (self.dip, self.low, *self.factors):
            item.observe(self.show, "value")
        lines = [
            widgets.HBox([item, self._readout(item), self._half(item)]) for item in self.factors
        ]
        heading = widgets.HTML(f"<b>{escape(word('views.what_if'))}</b>")
        reset = widgets.HBox([self.reset])
        self.box = widgets.VBox(
            [
                self.dip,
                self.low,
                self.totals,
                heading,
                *lines,
                reset,
                self.table,
            ]
        )
        self.show()

    def _slider(self, name):
        """Slider of the factor of a line."""
        return widgets.FloatSlider(
            value=1.0,
            min=0.0,
            max=LARGEST,
            step=STEP,
            description=name,
            tooltip=name,  # the description may be truncated
            continuous_update=False,
            readout=False,  # its readout has a decimal point in all languages
            style={"description_width": "24rem"},
            layout={"width": "44rem"},
        )

    def _readout(self, slider):
        """Label with the value of a slider, with the decimal mark of the language."""
        label = widgets.Label(layout={"width": "3rem", "flex": "none"})

        def show(_change=None):
            label.value = fixed(slider.value, 2, self.paper.marks)

        slider.observe(show, "value")
        show()
        return label

    def _half(self, slider):
        """Button that sets the factor of a slider to a half."""
        button = widgets.Button(
            description="× ½",
            tooltip=self.paper.word("views.half"),
            layout={"width": "auto", "flex": "none"},
        )

        def halve(_):
            slider.value = 0.5

        button.on_click(halve)
        return button

    def reset_factors(self):
        """Reset all factors to 1."""
        for slider in self.factors:
            slider.value = 1.0

    def show(self, _change=None):
        """Compute and show the budget with the current dips and factors."""
        low, text = None, self.low.value.strip()
        try:
            if text:
                low = parse_number(text)
                if low is None:
                    raise _InvalidEntry(self.paper.word("web.no_number", text=text[:40]))
                if low >= self.dip.value:
                    raise _InvalidEntry(self.paper.word("views.not_below"))
            factors = {i: slider.value for i, slider in enumerate(self.factors)}
            changed = change_budget(self.result, self.paper, self.dip.value, low, factors)
        except _InvalidEntry as error:
            self._refuse(str(error))
            return
        except HeightError as error:
            self._refuse(say(self.paper.words, error.args[0]))
            return
        text_html = "<br>".join(map(escape, budget_sentences(self.paper, changed)))
        self.totals.value = f'<div role="status">{text_html}</div>'
        self.table.value = STYLE + table_html(self.paper, changed)

    def _refuse(self, text):
        """Show a message in place of the budget."""
        self.totals.value = f'<div role="status" style="color:#a01818">{escape(text)}</div>'
        self.table.value = ""


class _InvalidEntry(Exception):
    """The entered text is no valid dip."""
