"""The budget at any height, with a factor for each u: what if this u were half?"""

from html import escape

import ipywidgets as widgets

from tankcal.errors import HeightError
from tankcal.text.digits import fixed
from tankcal.text.words import say
from tankcal.workbench.views.calculating import typed_number
from tankcal.workbench.views.what_if import sentences, suppose, table_html

LARGEST, STEP = 3.0, 0.05
STYLE = """<style>.tankcal-budget th, .tankcal-budget td { padding: 0 8px; line-height: 1.6;
  vertical-align: top } .tankcal-budget .left { text-align: left }
.tankcal-budget .right, .tankcal-budget .decimal { text-align: right; white-space: nowrap;
  font-variant-numeric: tabular-nums }</style>"""


class BudgetPanel:
    """A slider for the dip, a second dip for a delivery, and a factor for each line."""

    def __init__(self, result, paper):
        self.result, self.paper = result, paper
        word, heights = paper.word, result.table.height_m
        labels = [(paper.height(float(one)), float(one)) for one in heights]
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
        supposed = suppose(result, paper, float(heights[-1]))
        self.factors = [self._slider(name) for name in supposed.names]
        self.reset = widgets.Button(description=word("views.reset"), layout={"width": "auto"})
        self.reset.on_click(lambda _: self.put_back())
        self.totals, self.table = widgets.HTML(), widgets.HTML()
        self.table.add_class("tankcal-budget")
        for one in (self.dip, self.low, *self.factors):
            one.observe(self.show, "value")
        lines = [widgets.HBox([one, self._readout(one), self._half(one)]) for one in self.factors]
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
        return widgets.FloatSlider(
            value=1.0,
            min=0.0,
            max=LARGEST,
            step=STEP,
            description=name,
            tooltip=name,  # a long one is cut
            continuous_update=False,
            readout=False,  # it knows the decimal point alone
            style={"description_width": "24rem"},
            layout={"width": "44rem"},
        )

    def _readout(self, slider):
        label = widgets.Label(layout={"width": "3rem", "flex": "none"})

        def show(_change=None):
            label.value = fixed(slider.value, 2, self.paper.marks)

        slider.observe(show, "value")
        show()
        return label

    def _half(self, slider):
        button = widgets.Button(
            description="× ½",
            tooltip=self.paper.word("views.half"),
            layout={"width": "auto", "flex": "none"},
        )

        def halve(_):
            slider.value = 0.5

        button.on_click(halve)
        return button

    def put_back(self):
        """All u as they are."""
        for one in self.factors:
            one.value = 1.0

    def show(self, _change=None):
        """Compute the budget with what is chosen now."""
        low, text = None, self.low.value.strip()
        try:
            if text:
                low = typed_number(text)
                if low is None:
                    raise _Typed(self.paper.word("web.no_number", text=text[:40]))
                if low >= self.dip.value:
                    raise _Typed(self.paper.word("views.not_below"))
            factors = {i: one.value for i, one in enumerate(self.factors)}
            found = suppose(self.result, self.paper, self.dip.value, low, factors)
        except _Typed as error:
            self._refuse(str(error))
            return
        except HeightError as error:
            self._refuse(say(self.paper.words, error.args[0]))
            return
        said = "<br>".join(map(escape, sentences(self.paper, found)))
        self.totals.value = f'<div role="status">{said}</div>'
        self.table.value = STYLE + table_html(self.paper, found)

    def _refuse(self, text):
        self.totals.value = f'<div role="status" style="color:#a01818">{escape(text)}</div>'
        self.table.value = ""


class _Typed(Exception):
    """What was typed is no dip."""
