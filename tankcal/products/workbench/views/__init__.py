"""Views of a result in a notebook: table, calculators, quantity, wall with rejected points.

Frames with pages of a result in a notebook, and the answers of the calculators.

The frame is a sandbox: a page has no access to the notebook and loads nothing from the network. In
a saved notebook, the calculators and pictures of the page still work.

Answers of the calculators: volume of a dip, dip of a volume, volume between two dips.

Volumes, U and k agree with the certificate and the page. Between two rows, the larger U of the rows
applies. A simulated delivery has the U of its simulation.

Quantity calculator of a result: a ticket that is typed, and its quantities with U.

The panel collects the entries; the quantities and all problems are those of `result.ticket`.

results_view(result)                      in the language of the job
results_view(result, on_overrule=decide)  with buttons that call decide(point, decision, reason)
"""

import re
from dataclasses import dataclass
from html import escape
from importlib.util import find_spec
from pathlib import Path

import anywidget
import ipywidgets as widgets
import numpy as np
import traitlets

from tankcal.errors import HeightError, InputError, TankcalError
from tankcal.job.contract.overrulings import DECISIONS
from tankcal.products.desk.calculators import (
    FORM,
    LARGEST,
    STEP,
    STYLE,
    answer_html,
    budget_sentences,
    change_budget,
    table_html,
    ticket_entry,
)
from tankcal.products.desk.result_pages import table_page, wall_page, whole_page
from tankcal.products.desk.tables import NUMBER
from tankcal.products.quantity.chain import STATES
from tankcal.products.quantity.reading import read_tickets
from tankcal.products.quantity.table import table_of
from tankcal.record import record_of
from tankcal.report.numbers import unit
from tankcal.report.paper import Paper
from tankcal.report.web.wall_map import list_inspected, reason_text
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


_WRONG, _WARNED, _BLANK = "#a01818", "#6b4e00", "#4a5560"  # colours of remarks
TICKET_STYLE = """<style>.tankcal-ticket th, .tankcal-ticket td { padding: 0 8px; line-height: 1.6;
  vertical-align: top; text-align: left } .tankcal-ticket .right, .tankcal-ticket .decimal {
  text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums }</style>"""
WIDE = {"width": "100%"}  # layout
# Style that prevents truncated titles of tabs.
WHOLE_TITLES = "<style>.tankcal-titled .lm-TabBar-tab { flex: 0 0 auto !important }</style>"


# ---- quantity calculator of a result: a ticket that is typed, and its quantities with U


class QuantityPanel:
    """Form of a ticket with a remark below each field, and the quantities with U.

    Attributes
    ----------
    entries : dict
        {"section.key": widget}.
    remarks : dict
        {"section.key": widget with the problem or warning of this entry}.
    """

    def __init__(self, paper):
        self.paper, self._table = paper, None
        self._words = paper.words["quantity"]
        self.entries, self.remarks = {}, {}
        self.state, self.answer = widgets.HTML(), widgets.HTML()
        self.answer.add_class("tankcal-ticket")
        columns = {section: self._column(section, keys) for section, keys in FORM.items()}
        product = widgets.VBox([columns["product"], columns["shell"]])
        gaugings = widgets.VBox([columns[state] for state in STATES])
        form = widgets.HBox([product, gaugings], layout={"flex_flow": "row wrap"})
        uncertainty = widgets.Accordion(
            [columns["uncertainty"]], titles=[self._words["headings"]["uncertainty"]]
        )
        self.box = widgets.VBox([form, uncertainty, self.state, self.answer])

    def _column(self, section, keys):
        """Heading and fields of a section; the heading of the uncertainties is that of a fold."""
        rows = []
        if section in STATES or section == "product":
            heading = self._words["columns"][section]
            rows.append(widgets.HTML(f"<b>{escape(heading)}</b>"))
        for key, label in keys.items():
            place = f"{section}.{key}"
            self.entries[place] = self._entry(section, key, self._words["labels"][label])
            self.remarks[place] = widgets.HTML()
            self.entries[place].observe(self.show, "value")
            rows += [self.entries[place], self.remarks[place]]
        return widgets.VBox(rows, layout={"width": "36rem", "max_width": "100%"})

    def _entry(self, section, key, label):
        """Widget of a key: a tick box, a list of choices, or a number."""
        look = {"style": {"description_width": "66%"}, "layout": {"width": "98%"}}
        entry = ticket_entry(self.paper, section, key)
        if entry.kind == "flag":
            return widgets.Checkbox(value=False, description=label, indent=False)
        if entry.kind == "choice":
            choices = [(text, code) for code, text in entry.choices]
            return widgets.Dropdown(options=[("", None), *choices], description=label, **look)
        return widgets.Text(
            description=f"{label}, {entry.unit}", continuous_update=False,
            placeholder=entry.assumed, **look,
        )  # fmt: skip

    # ---- entries

    def settings(self):
        """Entries as the content of a ticket.toml, and texts that are no numbers.

        Returns
        -------
        settings : dict
            {section: {key: value}}.
        wrong : dict
            {"section.key": text}.
        """
        settings, wrong = {}, {}
        for place, entry in self.entries.items():
            section, _, key = place.partition(".")
            value = entry.value
            if isinstance(entry, widgets.Text):
                # Point or comma, as in the calculators: no field takes marks between thousands.
                plain = value.strip().replace(",", ".")
                if plain and not NUMBER.fullmatch(plain):
                    wrong[place] = value.strip()
                    continue
                value = float(plain) if plain else None
            if value is not None and value is not False:  # 0 is an entry, and equals False
                settings.setdefault(section, {})[key] = value
        return settings, wrong

    # ---- results

    def show(self, _change=None):
        """Compute the quantities of the entries, or show the problem of each entry."""
        for remark in self.remarks.values():
            remark.value = ""
        self.state.value = self.answer.value = ""
        settings, wrong = self.settings()
        if not settings and not wrong:
            return
        if wrong:
            for place, text in wrong.items():
                self._remark(place, self.paper.word("web.no_number", text=text[:40]), _WRONG)
            return
        if self._table is None:  # only when it is first needed
            self._table = table_of(self.paper.record)
        try:
            tickets = read_tickets(self._table, settings)
        except InputError as error:
            self._tell(error.problems, _WRONG)
            return
        self._tell(tickets.warnings, _WARNED)
        self.answer.value = TICKET_STYLE + answer_html(
            tickets, self.paper.words["language"]["code"]
        )

    def _tell(self, problems, colour):
        """Show problems or warnings below their fields; others below the form."""
        for problem in problems:
            text = say(self.paper.words, problem.expected)
            entry = self.entries.get(problem.column)
            if entry is not None and not entry.value:
                # A missing choice is asked for in the words of the list, not by its codes.
                key = f"{problem.column.partition('.')[2]}_blank"
                asked = self._words["sentences"].get(key, text)
                is_choice = isinstance(entry, widgets.Dropdown)
                self._remark(problem.column, asked if is_choice else text, _BLANK)
            elif entry is not None:
                self._remark(problem.column, text, colour)
            else:
                place = f"{problem.column}: " if problem.column else ""
                self.state.value += _line(f"{place}{text}", colour)

    def _remark(self, place, text, colour):
        self.remarks[place].value += _line(text, colour)


def _line(text, colour):
    """HTML of a line in a colour; texts of users are escaped."""
    return (
        f'<div role="status" style="color:{colour};line-height:1.3;white-space:normal">'
        f"{escape(text)}</div>"
    )


# ---- widgets of a result: table and calculators, quantity, wall with rejected points, budget


def live_view(result, paper, on_overrule):
    """Widget with all parts of the view as tabs."""
    word = paper.word
    parts = {"views.table": table_part(result, paper)}
    parts["views.quantity"] = QuantityPanel(paper).box
    wall = wall_page(paper)
    if wall is not None or paper.record["rejected"]:
        parts["views.wall"] = wall_part(result, paper, wall, on_overrule)
    if result.table.sources:
        parts["views.budget"] = BudgetPanel(result, paper).box
    tabs = widgets.Tab(children=list(parts.values()), titles=[word(name) for name in parts])
    view = widgets.VBox([widgets.HTML(WHOLE_TITLES), tabs], layout=WIDE)
    view.add_class("tankcal-titled")
    return view


def frame_of(html, title):
    """Widget with a page; without anywidget, it does not report the selected point."""
    if find_spec("anywidget") is None:
        return widgets.HTML(frame_html(html, title), layout=WIDE)

    return Frame(page=html, title=title)


def table_part(result, paper):
    """Widget with the calculators, and the table with its search below."""
    page = table_page(paper, with_calculator=False)
    table = frame_of(page, paper.word("views.table"))
    return widgets.VBox([CalculatorPanel(result, paper).box, table])


class CalculatorPanel:
    """Three calculators: volume of a dip, dip of a volume, volume between two dips."""

    def __init__(self, result, paper):
        self.calculator = Calculator(result, paper)
        word, heights = paper.word, result.table.height_m
        middle = paper.height(float(heights[len(heights) // 2]), "")
        unit = self.calculator.unit
        self.dip = _field(word("views.dip_m"), middle)
        self.volume = _field(word("views.volume_of", unit=unit))
        self.low, self.high = _field(word("views.from_dip")), _field(word("views.to_dip"))
        self.answers = {name: widgets.HTML() for name in ("volume", "dip", "delivery")}
        asked = {
            "volume": ([self.dip], self.calculator.volume_at),
            "dip": ([self.volume], self.calculator.dip_of),
            "delivery": ([self.low, self.high], self.calculator.delivery),
        }
        rows = []
        for name, (fields, ask) in asked.items():
            show = self._shower(name, fields, ask)
            for field in fields:
                field.observe(show, "value")
            show()
            heading = widgets.HTML(f"<b>{escape(word(f'views.asks_{name}'))}</b>")
            rows.append(widgets.VBox([heading, widgets.HBox(fields), self.answers[name]]))
        self.box = widgets.VBox(rows)

    def _shower(self, name, fields, ask):
        def show(_change=None):
            texts = [field.value for field in fields]
            is_asked = any(text.strip() for text in texts)
            self.answers[name].value = _answer_html(ask(*texts)) if is_asked else ""

        return show


def _field(label, value=""):
    return widgets.Text(
        value=value,
        description=label,
        style={"description_width": "initial"},
        layout={"width": "16rem"},
    )


def _answer_html(answer):
    """HTML of an `Answer`."""
    colour = ' style="color:#a01818"' if answer.is_refused else ' style="font-size:1.1em"'
    facts = "".join(
        f"<br><small>{escape(name)}: {escape(value)}</small>" for name, value in answer.facts
    )
    return f'<div role="status"{colour}>{escape(answer.text)}{facts}</div>'


def wall_part(result, paper, page, on_overrule):
    """List of rejected points and pictures of the wall, with a common selected point."""
    points = PointsPanel(paper, on_overrule)
    if page is None:
        return points.box
    frame = frame_of(page, paper.word("views.wall"))
    if frame.has_trait("chosen"):
        widgets.link((points, "chosen"), (frame, "chosen"))
    return widgets.VBox([points.box, frame])


class PointsPanel(traitlets.HasTraits):
    """List of rejected points, the selected point, and buttons for decisions.

    Parameters
    ----------
    paper : Paper
        Texts and record of the result.
    on_overrule : callable or None
        Function on_overrule(point, decision, reason) that receives decisions; None for no buttons.
    """

    chosen = traitlets.Unicode()

    def __init__(self, paper, on_overrule):
        super().__init__()
        self.paper, self.on_overrule = paper, on_overrule
        self.points = {item.name: item for item in list_inspected(paper.record)}
        self.used = {
            point["point"]: point["residual_m"]
            for point in paper.record["points"]
            if point["used"] and point["residual_m"] is not None
        }
        word = paper.word
        self.list = widgets.Select(
            options=[(self._line(item), item.name) for item in self.points.values()],
            value=None,
            rows=min(max(len(self.points), 3), 10),
            layout={"width": "60rem", "max_width": "100%"},
        )
        self.details, self.state = widgets.HTML(), widgets.HTML()
        self.reason = widgets.Text(
            placeholder=word("views.reason"),
            layout={"width": "60rem", "max_width": "100%"},
            continuous_update=True,
        )
        self.previous = _button("◀ " + word("views.previous"), lambda: self.step(-1))
        self.next = _button(word("views.next") + " ▶", lambda: self.step(1))
        self.decide = {
            item: _button(word(f"views.{item}"), lambda item=item: self.overrule(item))
            for item in DECISIONS
        }
        self.list.observe(lambda change: self._choose(change["new"]), "value")
        self.observe(lambda change: self._show(), "chosen")
        self.box = widgets.VBox(self._rows())
        self._show()

    def _rows(self):
        """Widgets of the panel from top to bottom."""
        word, count = self.paper.word, len(self.points)
        heading = word("views.looked_at", count=count) if count else word("views.none_rejected")
        rows = [widgets.HTML(f"<b>{escape(heading)}</b>")]
        if count:
            rows += [self.list, widgets.HBox([self.previous, self.next])]
        rows.append(self.details)
        if self.on_overrule is None:
            return rows
        return [*rows, self.reason, widgets.HBox(list(self.decide.values())), self.state]

    # ---- selection

    def step(self, by):
        """Select the point `by` places further in the list, cyclically."""
        names = list(self.points)
        if not names:
            return
        start = -1 if by > 0 else 0
        place = names.index(self.chosen) if self.chosen in self.points else start
        self.chosen = names[(place + by) % len(names)]

    def _choose(self, name):
        """Select a point of the list."""
        if name is not None:
            self.chosen = name

    def _show(self):
        """Show the selected point."""
        name = self.chosen
        self.list.value = name if name in self.points else None
        point, word = self.points.get(name), self.paper.word
        is_known = point is not None or name in self.used
        for button in self.decide.values():
            button.disabled = not is_known
        self.state.value = ""
        if point is not None:
            self.details.value = f"<div>{escape(self._sentence(point))}</div>"
        elif name in self.used:
            off = self.paper.number(self.used[name], "mm", decimals=1)
            self.details.value = (
                f"<div>{escape(word('views.point_used', point=name, off=off))}</div>"
            )
        else:
            self.details.value = f"<div>{escape(word('views.choose_point'))}</div>"

    def _line(self, point):
        """Text of a point in the list: name, deviation and reason."""
        parts = [point.name, self._deviation(point), reason_text(self.paper, point)]
        return " · ".join(part for part in parts if part)

    def _sentence(self, point):
        """Text of the selected point, with test value and place."""
        parts = [self._line(point)]
        if point.w is not None:
            parts.append(f"w = {self.paper.number(point.w, decimals=1)}")
        if point.azimuth_deg is not None:
            parts.append(f"{self.paper.number(point.azimuth_deg, decimals=1)}°")
            parts.append(self.paper.number(point.height_m, "m", decimals=3))
        return " · ".join(parts)

    def _deviation(self, point):
        """Text of the deviation of a point from the wall."""
        if point.off_m is None:
            return ""
        return self.paper.number(point.off_m, "mm", decimals=1)

    # ---- decisions

    def overrule(self, decision):
        """Pass on a decision about the selected point; a decision requires a reason."""
        word, name = self.paper.word, self.chosen
        reason = " ".join(self.reason.value.split())
        if not reason:
            self._state(word("views.no_reason"), "#a01818")
            return
        try:
            self.on_overrule(name, decision, reason)
        except InputError as error:
            lines = [say(self.paper.words, text) for text in error.texts]
            self._state("\n".join(lines), "#a01818")
        except TankcalError as error:
            self._state(str(error), "#a01818")
        else:
            self.reason.value = ""
            self._state(word(f"views.decided_{decision}", point=name), "#14603c")

    def _state(self, text, colour):
        """Show a message below the buttons."""
        lines = "<br>".join(map(escape, text.splitlines()))
        self.state.value = f'<div role="status" style="color:{colour}">{lines}</div>'


def _button(text, act):
    """Button that calls act()."""
    button = widgets.Button(description=text, layout={"width": "auto"})
    button.on_click(lambda _: act())
    return button


# ---- page in a frame, as a widget that reports the selected point (anywidget)


class Frame(anywidget.AnyWidget):
    """A page of the report in a sandbox; `chosen` is the name of the selected point."""

    _esm = Path(__file__).parent / "frame.js"
    page = traitlets.Unicode().tag(sync=True)
    title = traitlets.Unicode().tag(sync=True)
    height = traitlets.Unicode("44rem").tag(sync=True)
    chosen = traitlets.Unicode().tag(sync=True)


# ---- panel of the budget of a volume with changed standard uncertainties of its lines


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


__all__ = ["results_view"]


def results_view(result, record=None, language=None, on_overrule=None):
    """Build a view of a result that a notebook displays.

    Parameters
    ----------
    result : Result
        Result of `tankcal.run`.
    record : dict, optional
        Record of the result; by default it is computed.
    language : str, optional
        Language of the texts; by default the language of the job.
    on_overrule : callable, optional
        Function on_overrule(point, decision, reason) that receives the user's decision about a
        point, "keep" or "leave_out". By default there are no buttons for decisions.

    Returns
    -------
    ipywidgets.Widget or SavedView
        A widget if ipywidgets is installed, else a `SavedView`, an HTML page without buttons.

    Examples
    --------
    >>> import tankcal
    >>> result = tankcal.run(tankcal.load("examples/silva-1995"), simulated=False)
    >>> type(results_view(result)).__name__ in ("VBox", "SavedView")
    True
    """
    paper = Paper(record_of(result) if record is None else record, language=language)
    if find_spec("ipywidgets") is None:
        return SavedView(paper)

    return live_view(result, paper, on_overrule)
