"""What a comparison decides: the verdict, why, by which rule, and the numbers that it limits."""

from tankcal.report import blocks
from tankcal.report.plain import Column
from tankcal.report.saved_paper import signed_text
from tankcal.text.digits import NOTHING

LEGAL = (
    Column("number"), Column("value"), Column("as_printed"), Column("limit"), Column("verdict"),
)  # fmt: skip
DECIMALS_OF_LIMITED = {"%": 3, "mm": 1, "m3": 3}


def verdict(paper):
    """The verdict in its box, with the rule, and its reasons."""
    found, rule = paper.found, paper.found["rule"]
    code = found["verdict"] or "none"
    note = ""
    if rule:
        note = paper.word("texts.by_rule", rule=rule["name"], verified=_verified(paper, rule))
    box = blocks.result(paper.word("labels.verdict"), paper.word(f"verdicts.{code}"), note)
    reasons = [paper.reason(one) for one in found["reasons"]]
    return [
        box,
        blocks.paragraph(paper.word(f"texts.verdict_{code}")),
        *([paper.heading("reasons"), blocks.listing(reasons)] if reasons else []),
        *_rule(paper, rule),
    ]


def signed(paper):
    """The lines to sign on, beside what is signed: a page of them alone nobody would accept."""
    return [blocks.signature([paper.word(f"signatures.{one}") for one in ("compared", "approved")])]


def _rule(paper, rule):
    if not rule:
        return []
    asked = paper.word("texts.rule_default") if rule["is_default"] else None
    return [
        paper.facts(
            [
                ("rule", rule["name"]),
                ("rule_file", rule["file"]),
                ("rule_source", rule["source"]),
                ("rule_verified", paper.word(f"verified.{rule['verified']}")),
                ("verdict_verified", paper.word(f"verified.{paper.found['verified']}")),
                ("rule_remark", rule["remark"]),
                ("rule_asked", asked),
            ]
        )
    ]


# ---- the numbers that a rule limits


def legal(paper):
    """The numbers of the rule, and the periods, each with its limit and verdict."""
    found = [*legal_rows(paper), *age_rows(paper)]
    if not found:
        return []
    return [
        paper.heading("legal"),
        paper.table("legal", found, LEGAL),
        paper.paragraph("legal"),
        blocks.listing(_clauses(paper)),
    ]


def legal_rows(paper):
    """Rows of the three numbers."""
    return [
        {
            "number": paper.word(f"numbers.{one['code']}"),
            "value": _limited(paper, one["value"], one["unit"]),
            "as_printed": _limited(paper, one["as_printed"], one["unit"]),
            "limit": f"±\N{NO-BREAK SPACE}{paper.chosen(one['limit'], one['unit'])}",
            "verdict": paper.word(f"limits.{one['verdict']}"),
        }
        for one in paper.found["legal"]
    ]


def _limited(paper, value, unit):
    if value is None:
        return NOTHING
    return signed_text(value, paper.measure(value, unit, DECIMALS_OF_LIMITED[unit]))


def age_rows(paper):
    """Rows of the periods of the rule."""
    return [
        {
            "number": paper.word(f"ages.{one['of']}"),
            "value": _age(paper, one["age_years"]),
            "as_printed": NOTHING,
            "limit": _years(paper, one["years"]),
            "verdict": paper.word(f"limits.{one['verdict']}"),
        }
        for one in paper.found["ages"]
    ]


def _age(paper, years):
    if years is None:
        return NOTHING
    return paper.word("texts.years", years=paper.number(years, decimals=1))


def _years(paper, years):
    return paper.word("texts.years", years=paper.plain(years))


def _clauses(paper):
    """Where each value stands in the rule, and whether it was read there; each clause once."""
    every = [*paper.found["legal"], *paper.found["ages"]]
    said = [f"{one['clause']} ({_verified(paper, one)})" for one in every]
    return list(dict.fromkeys(said))


def _verified(paper, one):
    return paper.word(f"verified.{one['verified']}")
