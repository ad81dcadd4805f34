"""Sheets of the uncertainty: budgets, stated volumes and deliveries, the simulation."""

from tankcal.report.numbers import symbol
from tankcal.report.paper import Paper
from tankcal.report.uncertainty import budget, method, monte_carlo
from tankcal.report.uncertainty.deliveries import worst_rows
from tankcal.report.uncertainty.stated import stated_rows
from tankcal.report.workbook.look import height_digits, number_format, share_digits, values_of
from tankcal.report.workbook.tables import set_widths, write_table, write_tables
from tankcal.text.digits import LITRE_DECIMALS, decimals_of, decimals_of_rows
from tankcal.text.words import input_name

LEAST_WRITTEN_OUT = 1e-4
_HEAD_ROW = 3
_UNLIMITED = "∞"  # degrees of freedom
_FACT = 4  # column in which facts of the simulation stand beside their labels


def dips(book, code, values, width=12):
    """A column of dips in millimetres, or finer where they are."""
    return book.column(code, values, height_digits(values), width)


def shares(book, code, values):
    """A column of ratios in percent, each with two digits."""
    return book.column(code, values, share_digits(values), 12, percent=True)


def _dof(rows):
    return [_UNLIMITED if row["dof"] is None else row["dof"] for row in rows]


# ---- budgets


def budget_sheet(book, record):
    """The budget of the top row, of the table alone, and of every stated volume and delivery."""
    paper, capacity = Paper(record, book.words), record["capacity"]
    top = {key: capacity[key][-1] for key in ("u_m3", "k", "U_m3")}
    height = paper.height(capacity["height_m"][-1])
    sheet = book.sheet("budget", book.word("texts.budget_subtitle", height=height), landscape=True)
    columns = _lines(book, paper, record["budget"], top["u_m3"])
    widths = set_widths(book, sheet, columns)
    row = _budget(book, sheet, _HEAD_ROW, "budget", columns, widths)
    row = _totals(book, sheet, row, top)
    starts = []
    for number, one in enumerate(record.get("budgets", []), 2):
        starts.append(row)
        columns = _lines(book, paper, one["lines"], one["u_m3"])
        book.heading(sheet, row, _title(book, paper, one), len(columns))
        row = _budget(book, sheet, row + 1, f"budget_{number}", columns, widths)
        row = _totals(book, sheet, row, one)
    book.keep_together(sheet, starts, row, widths)
    sheet.freeze_panes(_HEAD_ROW + 1, 1)  # not printed again: each budget has its headings


def _title(book, paper, one):
    high, low = paper.height(one["high_m"]), paper.height(one["low_m"])
    return book.word(f"headings.budget_{'volume' if low is None else 'delivery'}", high=high,
                     low=low)  # fmt: skip


def _lines(book, paper, lines, u_m3):
    words = book.words
    digits = decimals_of(u_m3) + 1
    of_u = decimals_of_rows(values_of(lines, "u"), unknown=4)
    sensitivity = [_digits_of_sensitivity(abs(row["sensitivity"] or 0)) for row in lines]
    units = {key: [symbol(row[key]) for row in lines] for key in ("unit", "sensitivity_unit")}
    halved = [row.get("halved") for row in lines]
    return [
        book.column("input", [input_name(words, row) for row in lines], None, 38),
        book.column("estimate", [row.get("estimate") for row in lines], of_u),
        book.column("u_of_input", values_of(lines, "u"), of_u, 10),
        book.column("unit", units["unit"], None, 9),
        book.column("type", values_of(lines, "type"), None, 7),
        book.column("distribution", [_distribution(words, row) for row in lines], None, 13),
        book.column("dof", _dof(lines), 0, 9),
        book.column("sensitivity", values_of(lines, "sensitivity"), sensitivity, 10),
        book.column("sensitivity_unit", units["sensitivity_unit"], None, 11),
        book.column("contribution_m3", values_of(lines, "contribution_m3"), digits, 10),
        book.column("share", values_of(lines, "share"), 1, 9, percent=True),
        book.column("halved", halved, 1, 10, percent=True),
        book.column("note", [_note(paper, row) for row in lines], None, 40),
    ]


def _digits_of_sensitivity(size):
    """Four digits, or a power of ten where they would stand behind many zeros."""
    return "0.00E+00" if 0 < size < LEAST_WRITTEN_OUT else decimals_of(size, significant=4)


def _note(paper, line):
    """What was declared beside an input, and what it is correlated with."""
    return "; ".join(filter(None, [line["note"], *budget.correlations(paper, [line])]))


def _distribution(words, line):
    return words["distributions"].get(line["distribution"], line["distribution"])


def _budget(book, sheet, row, name, columns, widths):
    last = write_table(book, sheet, row, name, columns, widths=widths)
    heading = book.word("columns.share")
    share = next(i for i, one in enumerate(columns) if one.heading == heading)
    bar = {"type": "data_bar", "bar_color": "#B8CCE4", "bar_solid": True}
    bar |= {"min_type": "num", "min_value": 0, "max_type": "num", "max_value": 1}
    sheet.conditional_format(row + 1, share, last, share, bar)
    return last


def _totals(book, sheet, last, values):
    """u, k and k u under a budget; returns the row of the next heading."""
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
    """Volumes and deliveries as they are stated, and the worst deliveries."""
    paper = Paper(record, book.words)
    sheet = book.sheet("deliveries", landscape=True, tab="result")
    tables = [(book.word("headings.stated"), "stated", _stated(book, paper))]
    worst = worst_rows(paper)
    if worst:
        title = book.word("headings.worst_deliveries")
        tables.append((title, "worst_deliveries", _worst(book, worst)))
    write_tables(book, sheet, _HEAD_ROW, tables)


def _stated(book, paper):
    rows = stated_rows(paper.record)
    U = values_of(rows, "U_m3")
    digits, ends = decimals_of_rows(U), decimals_of_rows(U, least=LITRE_DECIMALS)
    names = book.words["intervals"]
    intervals = [names["monte_carlo" if row["simulated"] else "gum"] for row in rows]
    return [
        dips(book, "from_dip_m", values_of(rows, "high_m")),
        dips(book, "down_to_m", values_of(rows, "low_m")),
        book.column("volume_m3", values_of(rows, "volume_m3"), ends, 14),
        book.column("U_m3", U, digits),
        book.column("k", values_of(rows, "k"), 2, 10),
        shares(book, "relative", values_of(rows, "relative")),
        book.column("interval", intervals, None, 14),
        book.column("uneven_from_m3", values_of(rows, "low_m3"), ends, 14),
        book.column("uneven_to_m3", values_of(rows, "high_m3"), ends, 14),
        book.column("remark", ["; ".join(method.remarks(paper, row)) for row in rows], None, 44),
    ]


def _worst(book, rows):
    U, u = values_of(rows, "U_m3"), values_of(rows, "u_m3")
    litres = decimals_of_rows(U, least=LITRE_DECIMALS)
    return [
        dips(book, "from_dip_m", values_of(rows, "high_m")),
        dips(book, "down_to_m", values_of(rows, "low_m")),
        book.column("volume_m3", values_of(rows, "volume_m3"), litres, 14),
        book.column("U_m3", U, decimals_of_rows(U)),
        book.column("k", values_of(rows, "k"), 2, 10),
        shares(book, "relative", values_of(rows, "relative")),
        dips(book, "at_least_m", values_of(rows, "minimum_m")),
        book.column("standard_u_m3", u, decimals_of_rows(u), 14),
        book.column("dof", _dof(rows), 0),
        book.column("largest", values_of(rows, "which"), None, 44),
    ]


# ---- Monte Carlo


def monte_carlo_sheet(book, record):
    """Every row: mean and u of the simulation, its interval beside the GUM's, the verdict."""
    paper = Paper(record, book.words)
    sheet = book.sheet("monte_carlo")
    columns = _simulated(book, record)
    widths = set_widths(book, sheet, columns)
    row = _HEAD_ROW - 1
    for key, text in monte_carlo.facts(paper):
        row += 1
        book.put(sheet, row, 0, paper.label(key))
        book.paragraph_in(sheet, row, _FACT, text, widths[_FACT:])
    head = row + 2
    book.table(sheet, head, "monte_carlo", columns, autofilter=True, widths=widths)
    book.freeze(sheet, head, 1)


def _simulated(book, record):
    capacity, rows = record["capacity"], record["monte_carlo"]["rows"]
    digits = decimals_of_rows(capacity["stated_U_m3"], least=LITRE_DECIMALS)
    pairs = list(zip(capacity["volume_m3"], capacity["U_m3"], strict=True))
    return [
        dips(book, "dip_height_m", capacity["height_m"], 9),
        book.column("mean_m3", rows["value"], digits, 10),
        book.column("u_m3", rows["u"], decimals_of_rows(rows["u"]), 10),
        book.column("from_m3", rows["low"], digits, 10),
        book.column("to_m3", rows["high"], digits, 10),
        book.column("gum_from_m3", [one - expanded for one, expanded in pairs], digits, 10),
        book.column("gum_to_m3", [one + expanded for one, expanded in pairs], digits, 10),
        _small(book, "lower_difference_m3", rows["d_low"]),
        _small(book, "upper_difference_m3", rows["d_high"]),
        _small(book, "tolerance_m3", rows["tolerance"], 1),
        book.column("validated", rows["validated"], None, 10),
        book.column("sure", rows["sure"], None, 12),
        book.column("draws", rows["draws"], 0, 8),
    ]


def _small(book, code, values, significant=2):
    digits = [min(decimals_of(value, significant=significant), 6) for value in values]
    return book.column(code, values, digits, 10)
