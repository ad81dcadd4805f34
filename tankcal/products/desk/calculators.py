"""Calculators on a result: budget with changed standard uncertainties, and quantities of product.

U of a changed budget follows from the law of propagation, as in the budget of the report. If the
certificate states a U by Monte Carlo, this U differs, and the answer states the difference of
method. The form of a ticket collects the entries; the quantities and all problems are those of
`tankcal ticket`.
"""

import math
from dataclasses import dataclass, replace
from html import escape
from types import SimpleNamespace

from tankcal.errors import InputError
from tankcal.gum.coverage import coverage_factor
from tankcal.job.starter.texts import split_unit
from tankcal.products.quantity.chain import STATES
from tankcal.products.quantity.reading import GAUGING, GLASS, PRODUCT, SHELL, read_tickets
from tankcal.products.quantity.results import ticket_file
from tankcal.products.quantity.table import table_of
from tankcal.record.schema import to_plain
from tankcal.record.table import budget_lines
from tankcal.report.numbers import degrees_of_freedom
from tankcal.report.tables import Column
from tankcal.report.ticket import TicketPaper
from tankcal.report.ticket import pages as of_ticket
from tankcal.report.ticket.pages import label_text, notes, result_text
from tankcal.report.uncertainty.budget import budget_table
from tankcal.report.web import block_html
from tankcal.tank.gauging import FIELDS_OF_U, UNCERTAINTIES, UNITS_OF_U
from tankcal.tank.volume_correction.corrections import TABLE
from tankcal.tank.volume_correction.petroleum import BASE_NAMES
from tankcal.text.digits import UNKNOWN_DECIMALS, decimals_of, fixed, shortest
from tankcal.text.naming import NUMBER
from tankcal.text.words import say

LARGEST, STEP = 3.0, 0.05  # largest factor, and step of its slider
_STATED = ("volume_m3", "u_m3", "dof", "k", "U_m3")
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
        Budget without and with the factors; of a record, an object with these numbers.
    names : tuple of str
        Names of the lines in the language.
    factors : tuple of float
        Factor of u of each line.
    is_simulated : bool
        Whether the certificate states this U by Monte Carlo.
    lines : list of dict
        Lines of the budget with the factors, as in a record.
    """

    now: object
    then: object
    names: tuple[str, ...]
    factors: tuple[float, ...]
    is_simulated: bool = False
    lines: list | None = None


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
    is_simulated = stated.interval == "monte_carlo"
    lines = to_plain(budget_lines(then.lines))
    return ChangedBudget(now, then, names, all_factors, is_simulated, lines)


def list_recorded_budgets(paper):
    """Budgets of a record whose U can be computed again with factors.

    The capacity comes first, then the stated volumes and deliveries.

    Returns
    -------
    list of (int, str)
        Number for `change_recorded_budget`, and dips.
    """
    record, known = paper.record, []
    capacity = record["capacity"]
    if record["budget"]:
        known.append((0, paper.height(capacity["height_m"][-1])))
    for number, item in enumerate(record.get("budgets", ()), 1):
        ends = [item["low_m"], item["high_m"]]
        known.append((number, " - ".join(paper.height(end) for end in ends if end is not None)))
    return [item for item in known if change_recorded_budget(paper, item[0]) is not None]


def change_recorded_budget(paper, number, factors=None):
    """Compute a budget of a record with factors of u.

    Parameters
    ----------
    paper : Paper
        Report of the record.
    number : int
        0: the capacity; otherwise a stated budget, from 1.
    factors : dict, optional
        Factors of u, {index of a line: factor}; 1 for other lines.

    Returns
    -------
    ChangedBudget or None
        None if the lines do not determine U: unknown signs of correlated lines.
    """
    record = paper.record
    capacity, probability = record["capacity"], record["job"]["table"]["coverage_probability"]
    if number == 0:
        lines, source = record["budget"], {key: capacity[key][-1] for key in _STATED}
        is_simulated = (capacity.get("interval") or [""])[-1] == "monte_carlo"
    else:
        source = record["budgets"][number - 1]
        lines, is_simulated = source["lines"], source.get("interval") == "monte_carlo"
    now = SimpleNamespace(**{key: source[key] for key in _STATED})
    now.dof = math.inf if now.dof is None else now.dof
    all_factors = tuple(float((factors or {}).get(i, 1.0)) for i in range(len(lines)))
    u_m3, dof, _ = _combine_lines(lines, [1.0] * len(lines))
    # Degrees of freedom that differ less give equal coverage factors.
    is_same_dof = math.isclose(dof, now.dof, rel_tol=1e-3)
    if not (math.isclose(u_m3, now.u_m3, rel_tol=1e-6) and is_same_dof):
        return None
    u_m3, dof, variances = _combine_lines(lines, all_factors)
    k = coverage_factor(probability, dof) if u_m3 > 0 else now.k
    then = SimpleNamespace(volume_m3=now.volume_m3, u_m3=u_m3, dof=dof, k=float(k),
                           U_m3=float(k) * u_m3)  # fmt: skip
    total = u_m3**2 or 1.0
    changed = [
        line | {
            "u": None if line["u"] is None else factor * line["u"],
            "contribution_m3": factor * line["contribution_m3"], "share": variance / total,
        }
        for line, factor, variance in zip(lines, all_factors, variances, strict=True)
    ]  # fmt: skip
    names = tuple(paper.input_name(line) for line in lines)
    return ChangedBudget(now, then, names, all_factors, is_simulated, changed)


def _combine_lines(lines, factors):
    """u (m3), degrees of freedom, and parts of the variance of lines with factors.

    u^2 = sum f_i f_j r_ij c_i c_j (JCGM 100, 5.2.2); Welch and Satterthwaite (G.4.1).
    """
    signed = [
        factor * math.copysign(line["contribution_m3"], line["sensitivity"] or 1.0)
        for line, factor in zip(lines, factors, strict=True)
    ]
    place = {line["input"]: i for i, line in enumerate(lines)}
    variances = [
        part * part + sum(
            r * part * signed[place[name]]
            for name, r in line["correlations"] if name in place
        )
        for line, part in zip(lines, signed, strict=True)
    ]  # fmt: skip
    variance = max(sum(variances), 0.0)
    quartic = sum(
        part**4 / line["dof"]
        for line, part in zip(lines, signed, strict=True) if line["dof"] is not None
    )  # fmt: skip
    return math.sqrt(variance), variance**2 / quartic if quartic > 0 else math.inf, variances


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
    rows = [
        line | {"factor": value} for line, value in zip(changed.lines, changed.factors, strict=True)
    ]
    shown = replace(table, columns=(input_, factor, *others))
    return block_html(paper.show(shown, rows, on="budget_what_if").data)


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
