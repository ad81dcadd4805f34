"""Quantity calculator of a result: a ticket that is typed, and its quantities with U.

The panel collects the entries; the quantities and all problems are those of `result.ticket`.
"""

from html import escape

import ipywidgets as widgets

from tankcal.errors import InputError
from tankcal.job.starter.texts import split_unit
from tankcal.products.quantity.reading import GAUGING, GLASS, PRODUCT, SHELL, read_tickets
from tankcal.products.quantity.saving import ticket_file
from tankcal.products.quantity.table import table_of
from tankcal.products.quantity.transfer import STATES
from tankcal.products.workbench.tables import NUMBER
from tankcal.record.schema import to_plain
from tankcal.report.ticket import TicketPaper
from tankcal.report.ticket import tables as of_ticket
from tankcal.report.ticket.pages import label_text, notes, result_text
from tankcal.report.web import block_html
from tankcal.tank.gauging import FIELDS_OF_U, UNCERTAINTIES, UNITS_OF_U
from tankcal.tank.volume_correction.corrections import TABLE
from tankcal.tank.volume_correction.petroleum import BASE_NAMES
from tankcal.text.digits import shortest
from tankcal.text.words import say

# {section: {key of the ticket: its label in [quantity.labels] of the words}}
_GAUGING = {"dip_m": "dip", "ullage_m": "ullage", "water_dip_m": "water",
            "temperature_c": "liquid", "ambient_c": "ambient"}  # fmt: skip
FORM = {
    "product": {
        "correction": "correction", "group": "group", "base": "base", "alpha_per_k": "alpha",
        "density_kg_m3": "density", "density_is": "density_is",
        "density_temperature_c": "sample", "hydrometer": "hydrometer", "sw_percent": "sw",
    },
    "shell": {"insulated": "insulated"},
    **dict.fromkeys(STATES, _GAUGING),
    "uncertainty": FIELDS_OF_U,
}  # fmt: skip
# Codes of the ticket with another code in [quantity.choices] of the words.
_CHOICES = {"CNP-6-70": "cnp", "CNP-6-70-unrounded": "cnp_unrounded", "coefficient": "constant"}
_WRONG, _WARNED, _BLANK = "#a01818", "#6b4e00", "#4a5560"  # colours of remarks
STYLE = """<style>.tankcal-ticket th, .tankcal-ticket td { padding: 0 8px; line-height: 1.6;
  vertical-align: top; text-align: left } .tankcal-ticket .right, .tankcal-ticket .decimal {
  text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums }</style>"""


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
        field = next((item for item in (*PRODUCT, *SHELL, *GAUGING) if item.name == key), None)
        if field is not None and field.kind == "flag":
            return widgets.Checkbox(value=False, description=label, indent=False)
        if field is not None and field.choices:
            # Factors of an own table are in a file, which only `tankcal ticket` reads.
            choices = [(self._choice(key, code), code) for code in field.choices if code != TABLE]
            return widgets.Dropdown(options=[("", None), *choices], description=label, **look)
        unit, assumed = split_unit(key)[1], None
        if section == "uncertainty":
            unit, assumed = UNITS_OF_U[key], UNCERTAINTIES[key]
        elif key == "sw_percent":
            unit = "%"
        return widgets.Text(
            description=f"{label}, {unit}", continuous_update=False,
            placeholder="" if assumed is None else shortest(assumed, self.paper.marks), **look,
        )  # fmt: skip

    def _choice(self, key, code):
        """Text of a choice of a key."""
        if key in ("base", "hydrometer"):
            return BASE_NAMES[GLASS.get(code, code)]
        named = _CHOICES.get(code, code) if key == "correction" else code
        # Names of standards have no translation.
        return self._words["choices"].get(named, named)

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
        self.answer.value = STYLE + answer_html(tickets, self.paper.words["language"]["code"])

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


def answer_html(tickets, language):
    """HTML of the quantities, steps and budget of a ticket, as in its document."""
    paper = TicketPaper(to_plain(ticket_file(tickets)), language)
    steps = of_ticket.STEPS.only("step", "formula", "source", "opening", "closing")
    if "opening" not in tickets.quantities:
        steps = steps.only("step", "formula", "source", "closing")
    state = paper.words["states"][paper.state]
    shown = [
        paper.show(of_ticket.RESULTS, of_ticket.result_rows(paper)),
        paper.show(steps),
        paper.show(of_ticket.BUDGET, of_ticket.budget_rows(paper), state=state),
    ]
    main = ": ".join((label_text(paper), result_text(paper)))
    return (
        f'<div role="status"><b>{escape(main)}</b></div>'
        + "".join(block_html(block.data) for block in shown)
        + "".join(f"<div><small>{escape(text)}</small></div>" for text in notes(paper))
    )


def _line(text, colour):
    """HTML of a line in a colour; texts of users are escaped."""
    return (
        f'<div role="status" style="color:{colour};line-height:1.3;white-space:normal">'
        f"{escape(text)}</div>"
    )
