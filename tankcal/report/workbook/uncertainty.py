"""Sheets of budgets, stated volumes, deliveries, Monte Carlo, and decision rule."""

from tankcal.report.uncertainty import budget, monte_carlo, rule
from tankcal.report.uncertainty.method import limits_table, stated_table
from tankcal.report.uncertainty.stated import WORST_DELIVERIES, worst_delivery_rows
from tankcal.report.workbook.look import number_format
from tankcal.report.workbook.sections import (
    HEAD_ROW,
    CellTable,
    Facts,
    Sentences,
    SheetContent,
    cell_table,
    columns_of,
    set_widths,
    write_sheet,
)
from tankcal.text.digits import decimals_of

_RULE_FACTS = (40, 16, 16, 16, 16, 16)  # widths of the columns of the facts of a rule
_FACT = 4  # column of the facts of the simulation, to the right of their labels


# ---- budgets


def budget_sheet(book, record):
    """Write the budgets of the top row and of all stated volumes and deliveries."""
    paper, capacity = book.paper, record["capacity"]
    top = {key: capacity[key][-1] for key in ("u_m3", "k", "U_m3")}
    height = paper.height(capacity["height_m"][-1])
    sheet = book.sheet("budget", book.word("texts.budget_subtitle", height=height), landscape=True)
    columns = _budget_columns(book, record["budget"], top["u_m3"])
    widths = set_widths(book, sheet, columns)
    row = _budget_table(book, sheet, HEAD_ROW, "budget", columns, widths)
    row = _totals(book, sheet, row, top)
    starts = []
    for number, stated in enumerate(record.get("budgets", []), 2):
        starts.append(row)
        columns = _budget_columns(book, stated["lines"], stated["u_m3"])
        high, low = paper.height(stated["high_m"]), paper.height(stated["low_m"])
        kind = "volume" if low is None else "delivery"
        title = book.word(f"headings.budget_{kind}", high=high, low=low)
        book.heading(sheet, row, title, len(columns))
        row = _budget_table(book, sheet, row + 1, f"budget_{number}", columns, widths)
        row = _totals(book, sheet, row, stated)
    book.keep_together(sheet, starts, row, widths)
    sheet.freeze_panes(HEAD_ROW + 1, 1)  # not repeated in print, since each budget has headings


def _budget_columns(book, lines, u_m3):
    return columns_of(book, budget.budget_table(decimals_of(u_m3) + 1), lines)


def _budget_table(book, sheet, row, name, columns, widths):
    """Write a budget with bars of the shares; return its last row."""
    last = CellTable(name, columns).write(book, sheet, row, widths) - 1
    heading = book.word("columns.share")
    share = next(i for i, column in enumerate(columns) if column.heading == heading)
    bar = {"type": "data_bar", "bar_color": "#B8CCE4", "bar_solid": True}
    bar |= {"min_type": "num", "min_value": 0, "max_type": "num", "max_value": 1}
    sheet.conditional_format(row + 1, share, last, share, bar)
    return last


def _totals(book, sheet, last, values):
    """Write u, k and k u below a budget; return the row of the next heading."""
    cubic = number_format(decimals_of(values["u_m3"]), unit="m³")
    for below, label, key, shown in (
        (2, "u_of_all", "u_m3", cubic),
        (3, "k_of_all", "k", "0.00"),
        (4, "U_of_all", "U_m3", cubic),
    ):
        book.put(sheet, last + below, 0, book.word(f"labels.{label}"), bold=True)
        book.put(sheet, last + below, 1, values[key], num_format=shown, bold=True)
    return last + 7


# ---- deliveries


def deliveries_sheet(book, record):
    """Write the stated volumes and deliveries, the operating levels, and the worst deliveries."""
    sections = [cell_table(book, stated_table(record), title=book.word("headings.stated"))]
    if record.get("limits"):
        title = book.word("headings.limits_of_tank")
        sections.append(cell_table(book, limits_table(record), title=title))
    worst = worst_delivery_rows(book.paper)
    if worst:
        title = book.word("headings.worst_deliveries")
        sections.append(cell_table(book, WORST_DELIVERIES, worst, title=title))
    write_sheet(book, SheetContent("deliveries", sections, tab="result"))


# ---- Monte Carlo


def monte_carlo_sheet(book, record):
    """Write mean, u and interval of the simulation with the GUM interval for all rows."""
    paper, sheet = book.paper, book.sheet("monte_carlo")
    columns = columns_of(book, monte_carlo.SIMULATED)
    widths = set_widths(book, sheet, columns)
    row = HEAD_ROW - 1
    for key, text in monte_carlo.facts(paper):
        row += 1
        book.put(sheet, row, 0, paper.label(key))
        book.paragraph_in(sheet, row, _FACT, text, widths[_FACT:])
    head = row + 2
    book.table(sheet, head, "monte_carlo", columns, autofilter=True, widths=widths)
    book.freeze(sheet, head, 1)


# ---- decision rule


def rule_sheet(book, record):
    """Write the rule, its verdict, the limits of U, and the limits of deviations."""
    paper = book.paper
    facts = [(paper.label(key), text, None) for key, text in rule.facts(paper) if text]
    tables = {"limits": rule.LIMITS}
    if record["rule"]["deviation"]:
        tables |= {"deviations": rule.DEVIATIONS, "acceptance": rule.ACCEPTANCE}
    sections = [
        Facts(facts, widths=_RULE_FACTS),
        *(
            cell_table(book, table, name=name, title=book.word(f"headings.{name}"))
            for name, table in tables.items()
        ),
        Sentences(rule.sentences(paper), widths=(*_RULE_FACTS, *_RULE_FACTS[1:4])),
    ]
    write_sheet(book, SheetContent("rule", sections, tab="result"))
