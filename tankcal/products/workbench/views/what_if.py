"""Panel of the budget of a volume with changed standard uncertainties of its lines.

`BudgetPanel` shows the budget at any height, with a factor for each standard uncertainty.
"""

from html import escape

import ipywidgets as widgets

from tankcal.errors import HeightError
from tankcal.products.desk.what_if import (
    LARGEST,
    STEP,
    STYLE,
    budget_sentences,
    change_budget,
    table_html,
)
from tankcal.products.workbench.views.page import parse_number
from tankcal.text.digits import fixed
from tankcal.text.words import say


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
