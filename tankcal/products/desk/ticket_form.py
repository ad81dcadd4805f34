"""Form of a ticket: quantities of product from dips, with the table of a record.

The form collects the entries; the quantities and all problems are those of `tankcal ticket`.
"""

from dataclasses import dataclass
from html import escape

from tankcal.errors import InputError
from tankcal.job.starter.texts import split_unit
from tankcal.products.quantity.chain import STATES
from tankcal.products.quantity.reading import GAUGING, GLASS, PRODUCT, SHELL, read_tickets
from tankcal.products.quantity.saving import ticket_file
from tankcal.products.quantity.table import table_of
from tankcal.record.schema import to_plain
from tankcal.report.ticket import TicketPaper
from tankcal.report.ticket import pages as of_ticket
from tankcal.report.ticket.pages import label_text, notes, result_text
from tankcal.report.web import block_html
from tankcal.tank.gauging import FIELDS_OF_U, UNCERTAINTIES, UNITS_OF_U
from tankcal.tank.volume_correction.corrections import TABLE
from tankcal.tank.volume_correction.petroleum import BASE_NAMES
from tankcal.text.digits import shortest
from tankcal.text.naming import NUMBER
from tankcal.text.words import say

# {section: {key of the ticket: its label in [quantity.labels] of the words}}
GAUGING_LABELS = {"dip_m": "dip", "ullage_m": "ullage", "water_dip_m": "water",
            "temperature_c": "liquid", "ambient_c": "ambient"}  # fmt: skip
FORM = {
    "product": {
        "correction": "correction", "group": "group", "base": "base", "alpha_per_k": "alpha",
        "density_kg_m3": "density", "density_is": "density_is",
        "density_temperature_c": "sample", "hydrometer": "hydrometer", "sw_percent": "sw",
    },
    "shell": {"insulated": "insulated"},
    **dict.fromkeys(STATES, GAUGING_LABELS),
    "uncertainty": FIELDS_OF_U,
}  # fmt: skip
# Codes of the ticket with another code in [quantity.choices] of the words.
NAMED_CHOICES = {
    "CNP-6-70": "cnp",
    "CNP-6-70-unrounded": "cnp_unrounded",
    "coefficient": "constant",
}


@dataclass(frozen=True)
class TicketEntry:
    """Entry of a ticket.

    Attributes
    ----------
    place : str
        "section.key" of the ticket.
    label, unit : str
        Label and symbol of the unit.
    kind : {"flag", "choice", "number"}
        Kind of entry.
    choices : tuple of (str, str)
        Codes and texts of a choice.
    assumed : str
        Value that is assumed if the entry is blank; "" if none is.
    """

    place: str
    label: str
    unit: str = ""
    kind: str = "number"
    choices: tuple = ()
    assumed: str = ""


def ticket_entry(report, section, key):
    """`TicketEntry` of a key in the language of a report."""
    words, place = report.words["quantity"], f"{section}.{key}"
    label = words["labels"][FORM[section][key]]
    field = next((item for item in (*PRODUCT, *SHELL, *GAUGING) if item.name == key), None)
    if field is not None and field.kind == "flag":
        return TicketEntry(place, label, kind="flag")
    if field is not None and field.choices:
        choices = []
        for code in field.choices:
            if code == TABLE:  # factors of an own table are in a file of `tankcal ticket`
                continue
            # Names of standards have no translation.
            named = NAMED_CHOICES.get(code, code) if key == "correction" else code
            text = words["choices"].get(named, named)
            if key in ("base", "hydrometer"):
                text = BASE_NAMES[GLASS.get(code, code)]
            choices.append((code, text))
        return TicketEntry(place, label, kind="choice", choices=tuple(choices))
    unit, assumed = split_unit(key)[1], ""
    if section == "uncertainty":
        unit, assumed = UNITS_OF_U[key], shortest(UNCERTAINTIES[key], report.marks)
    elif key == "sw_percent":
        unit = "%"
    return TicketEntry(place, label, unit, assumed=assumed)


def ticket_sections(report):
    """Sections of the form: [(title, entries)]."""
    words = report.words["quantity"]
    titles = {**words["columns"], "uncertainty": words["headings"]["uncertainty"]}
    return [
        (titles.get(section, ""), [ticket_entry(report, section, key) for key in keys])
        for section, keys in FORM.items()
    ]


def answer_ticket(report, texts):
    """Answer to the entries of a ticket.

    Parameters
    ----------
    report : object
        Report of the record with the table.
    texts : dict
        {"section.key": text}; point or comma as decimal mark.

    Returns
    -------
    html : str
        Quantities, steps and budget; "" if an entry is missing or not accepted.
    problems : list of (str, str)
        "section.key" or "", and text, of each problem or warning.
    """
    settings, problems = {}, []
    for section, keys in FORM.items():
        for key in keys:
            entry = ticket_entry(report, section, key)
            value = texts.get(entry.place, "").strip()
            if not value:
                continue
            if entry.kind == "flag":
                value = True
            elif entry.kind == "number":
                plain = value.replace(",", ".")
                if not NUMBER.fullmatch(plain):
                    problems.append((entry.place, report.word("web.no_number", text=value[:40])))
                    continue
                value = float(plain)
            settings.setdefault(section, {})[key] = value
    if problems or not settings:
        return "", problems
    try:
        tickets = read_tickets(table_of(report.record), settings)
    except InputError as error:
        sentences = report.words["quantity"]["sentences"]
        for problem in error.problems:
            # A missing choice is asked for in the words of the list, not by its codes.
            place = problem.column or ""
            asked = sentences.get(f"{place.partition('.')[2]}_blank")
            text = asked if asked and not texts.get(place) else say(report.words, problem.expected)
            problems.append((place, text))
        return "", problems
    problems = [(item.column or "", say(report.words, item.expected)) for item in tickets.warnings]
    return answer_html(tickets, report.words["language"]["code"]), problems


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
