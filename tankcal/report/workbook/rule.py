"""The sheet Decision rule: what the rule limits, and what became of every limit."""

from tankcal.report.paper import Paper
from tankcal.report.uncertainty import rule
from tankcal.report.workbook.look import values_of
from tankcal.report.workbook.tables import write_tables
from tankcal.report.workbook.uncertainty import dips, shares
from tankcal.text.digits import LITRE_DECIMALS, decimals_of, decimals_of_rows

_HEAD_ROW = 3
_FACTS = (40, 16, 16, 16, 16, 16)  # widths of the columns that the facts go over


def rule_sheet(book, record):
    """The rule, its verdict, and its limits; of U first, then of deviations."""
    paper, verdict = Paper(record, book.words), record["rule"]
    sheet = book.sheet("rule", landscape=True, tab="result")
    row = _HEAD_ROW
    for key, text in rule.facts(paper):
        if text:
            book.paragraph_in(sheet, row, 1, text, _FACTS[1:])
            book.label(sheet, row, paper.label(key), _FACTS[0])
            row += 1
    limits, deviations = verdict["uncertainty"], verdict["deviation"]
    tables = [(book.word("headings.limits"), "limits", _limits(book, paper, limits))]
    if deviations:
        for name, columns_of in (("deviations", _deviations), ("acceptance", _acceptance)):
            title = book.word(f"headings.{name}")
            tables.append((title, name, columns_of(book, paper, deviations)))
    row = write_tables(book, sheet, row + 1, tables)
    for text in rule.sentences(paper):
        book.paragraph(sheet, row, text, (*_FACTS, *_FACTS[1:4]))
        row += 1


def _limits(book, paper, rows):
    U = values_of(rows, "worst_U_m3")
    litres = decimals_of_rows(U, least=LITRE_DECIMALS)
    limits = [rule.limit_text(paper, row) for row in rows]
    return [
        book.column("limit", limits, None, _FACTS[0]),
        shares(book, "at_most", values_of(rows, "limit")),
        book.column("verdict", _codes(paper, "limit_codes", rows), None, 16),
        dips(book, "kept_from_m", values_of(rows, "from_m")),
        book.column("kept_from_m3", values_of(rows, "from_m3"), litres),
        dips(book, "worst_dip_m", values_of(rows, "worst_m")),
        dips(book, "worst_down_to_m", values_of(rows, "worst_low_m")),
        book.column("worst_m3", values_of(rows, "worst_m3"), litres),
        book.column("worst_U_m3", U, decimals_of_rows(U)),
        shares(book, "worst_ratio", values_of(rows, "worst_ratio")),
        book.column("clause", values_of(rows, "clause"), None, 40),
        book.column("verified", values_of(rows, "verified")),
    ]


def _deviations(book, paper, rows):
    U = values_of(rows, "U_m3")
    litres = decimals_of_rows(U, least=LITRE_DECIMALS)
    guards = [paper.word(f"guards.{row['guard']}") for row in rows]
    return [
        book.column("limit", _of_deviations(paper, rows), None, _FACTS[0]),
        dips(book, "from_dip_m", values_of(rows, "high_m")),
        book.column("verdict", _codes(paper, "deviation_codes", rows), None, 16),
        dips(book, "down_to_m", values_of(rows, "low_m")),
        book.column("stated_m3", values_of(rows, "stated_m3"), litres),
        book.column("table_m3", values_of(rows, "volume_m3"), litres),
        book.column("deviation_m3", values_of(rows, "deviation_m3"), litres),
        book.column("U_m3", U, decimals_of_rows(U)),
        book.column("guard", guards),
        _conformity(book, values_of(rows, "probability")),
        book.column("clause", values_of(rows, "clause"), None, 40),
        book.column("verified", values_of(rows, "verified")),
    ]


def _acceptance(book, paper, rows):
    litres = decimals_of_rows(values_of(rows, "U_m3"), least=LITRE_DECIMALS)
    ends = [
        book.column(code, [row[key][place] for row in rows], litres)
        for codes, key in (("TL_m3 TU_m3", "tolerance_m3"), ("AL_m3 AU_m3", "accepted_m3"))
        for place, code in enumerate(codes.split())
    ]
    return [
        book.column("limit", _of_deviations(paper, rows), None, _FACTS[0]),
        dips(book, "from_dip_m", values_of(rows, "high_m")),
        book.column("guard_band_m3", values_of(rows, "guard_m3"), litres, 16),
        *ends,
    ]


def _of_deviations(paper, rows):
    return [rule.deviation_limit_text(paper, row) for row in rows]


def _conformity(book, probabilities):
    """Probabilities in percent; near to 0 and 1 with as many decimals as tell them from these."""
    rest = [100 * min(one, 1 - one) for one in probabilities]
    digits = [min(decimals_of(one, significant=1, least=2), 6) for one in rest]
    return book.column("conformity", probabilities, digits, percent=True)


def _codes(paper, group, rows):
    return [paper.word(f"{group}.{row['code']}") for row in rows]
