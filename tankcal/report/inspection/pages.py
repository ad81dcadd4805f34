"""What an inspection says, block by block: result, checks, limits, wall, welds, bottom."""

from tankcal.report import blocks
from tankcal.report.comparison.pages import FILE_COLUMNS
from tankcal.report.inspection.bottom import edges, points, settlements
from tankcal.report.inspection.paper import UNVERIFIED, verdict_of
from tankcal.report.inspection.tables import CHECKS, LIMITS, limit_rows
from tankcal.report.inspection.wall import courses, departures, levels, welds
from tankcal.report.saved_paper import bearable, shortened
from tankcal.text.digits import NOTHING

SHOWN = ("table", "columns_table", "figure")
SHORT = 12  # rows of a table that page.typ keeps on one page

# Verdicts, the gravest first.
ORDER = ("failed", "guard_band_beyond", "guard_band", "not_determined", "no_limit", "passed")


def pages(paper, folder=None):
    """The blocks of an InspectionPaper; `folder`: of the files that the PDF holds inside."""
    return ending_together(
        [
            *paper.head(folder),
            *result(paper),
            *subject(paper),
            *checks(paper),
            *limits(paper),
            *reading(paper),
            *departures(paper),
            *levels(paper),
            *courses(paper),
            *welds(paper),
            *settlements(paper),
            *edges(paper),
            *points(paper),
        ]
    )


def ending_together(made):
    """The blocks, the last table on one page with the table or figure before it.

    Alone, its few rows would leave the last page nearly empty, and so would the last of them. A
    long table goes on from page to page.
    """
    shown = [i for i, block in enumerate(made) if block.data["kind"] in SHOWN]
    if len(shown) < 2:
        return made
    first, last = shown[-2:]
    if SHORT < len(made[last].data.get("rows", ())) <= 2 * SHORT:
        made = [*made[:last], blocks.whole(made[last]), *made[last + 1 :]]
    before = made[first].data
    if len(before.get("rows", ())) > SHORT * before.get("across", 1):
        return made
    return [*made[:first], *map(blocks.with_next, made[first:last]), *made[last:]]


def result(paper):
    """How many checks came out how, in the frame; there is no verdict of all together."""
    rule = paper.found["rule"]
    note = paper.word("texts.no_rule")
    if rule:
        note = paper.word("texts.by_rule", rule=bearable(rule["name"]), verified=_read(paper, rule))
    return [
        blocks.result(paper.word("labels.result"), counts(paper), note),
        paper.paragraph("not_of_certificate"),
    ]


def counts(paper):
    """How many checks have each verdict: "1 beyond the limit, 8 within it"."""
    said = [verdict_of(one) for one in paper.found["checks"]]
    found = [
        paper.word(f"counted.{code}_{'one' if said.count(code) == 1 else 'many'}",
                   count=said.count(code))
        for code in ORDER
        if code in said
    ]  # fmt: skip
    return "; ".join(found) or paper.word("texts.no_checks")


def subject(paper):
    """The tank, its survey, and the rule with whether it was read."""
    tank, rule = paper.found["tank"], paper.found["rule"]
    return [
        paper.heading("subject"),
        paper.facts([*_tank(paper, tank), *_survey(paper, tank)]),
        *([paper.table("files", _files(tank), FILE_COLUMNS)] if tank["sha256"] else []),
        *([paper.facts(_rule(paper, rule))] if rule else []),
    ]


def _tank(paper, tank):
    diameter = paper.number(tank["nominal_diameter_m"], "m", decimals=3)
    if diameter is not None:
        source = paper.words["nominal_sources"].get(tank["nominal_source"], tank["nominal_source"])
        diameter = f"{diameter} ({source})"
    return [
        ("tank", bearable(tank["id"])),
        ("job", bearable(tank["name"])),
        ("nominal_diameter", diameter),
        ("shell_height", paper.number(tank["height_m"], "m", decimals=3)),
    ]


def _survey(paper, tank):
    source = paper.words["sources_of_inspections"].get(tank["source"], tank["source"])
    methods = [paper.words["methods"].get(one, bearable(one)) for one in tank["methods"]]
    side = tank["survey_side"]
    day = iso if (iso := paper.date()) else None
    return [
        ("survey_date", paper.day(day) or paper.word("texts.not_known")),
        ("methods", ", ".join(methods)),
        ("surface", side and paper.words["surfaces"].get(side, side)),
        ("state", side and paper.words["states"].get(tank["state"], tank["state"])),
        ("made_of", source if tank["sha256"] else f"{source}: {shortened(tank['file'])}"),
    ]


def _files(tank):
    return [{"file": shortened(tank["file"]), "sha256": tank["sha256"]}]


def _rule(paper, rule):
    return [
        ("rule", bearable(rule["name"])),
        ("rule_file", shortened(rule["file"])),
        ("rule_source", bearable(rule["source"])),
        ("rule_verified", _read(paper, rule)),
        ("rule_remark", bearable(rule["remark"])),
    ]


def _read(paper, one):
    return paper.word(f"verified.{one['verified']}")


# ---- the checks


def checks(paper):
    """Every check with its figure, U, limit, verdict and probability; what to read beside it."""
    found = paper.found["checks"]
    if not found:
        return []
    said = remarks(paper)
    unread = any(one["limit"] is not None and not one["limit"]["verified"] for one in found)
    return [
        paper.heading("checks"),
        paper.show(CHECKS, CHECKS.rows(paper.found)),
        *([paper.paragraph("unverified", mark=UNVERIFIED)] if unread else []),
        blocks.paragraph(_decision(paper)),
        *([paper.heading("remarks", 2), blocks.listing(said)] if said else []),
    ]


def remarks(paper):
    """What is to be read beside checks: a sentence each, the same of several checks once."""
    places = {}
    for one in paper.found["checks"]:
        if one["remark"] is not None:
            said = (paper.check_name(one["code"]), paper.remark(one))
            places.setdefault(said, []).append(paper.place(one))
    return [f"{name}{_where(found)}: {said}" for (name, said), found in places.items()]


def _where(places):
    """The one place of a remark, in brackets; "" of several, or where there is none."""
    return f" ({places[0]})" if len(places) == 1 and places != [NOTHING] else ""


def _decision(paper):
    """The decision rule of this file, and its coverage factors."""
    factors = sorted({round(one["k"], 2) for one in paper.found["checks"] if one["k"]})
    k = "; ".join(paper.number(one, decimals=2) for one in factors)
    decision = paper.found["decision"]
    rule = "" if decision == "guarded" else f"_{decision}"
    return paper.word(f"texts.decision{'' if k else '_without_k'}{rule}", k=k)


def limits(paper):
    """Where each limit stands, and whether it was read there."""
    rows = limit_rows(paper)
    return [paper.heading("limits"), paper.show(LIMITS, rows)] if rows else []


def reading(paper):
    """What to know before relying on it; warnings."""
    found = paper.found
    said = [paper.word("texts.as_built" if found["as_built"] else "texts.as_built_unknown")]
    if found["rule"] and not found["rule"]["verified"]:
        said.append(paper.word("texts.rule_not_read"))
    if found["generatrices"] is not None or found["levels"]:
        said.append(paper.word("texts.surface_of_radii"))
    said += paper.words["standing_limits"].values()
    said += [paper.warning(one) for one in found["warnings"]]
    return [paper.heading("reading"), blocks.listing(said)]
