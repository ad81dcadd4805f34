"""What helps on paper: changes of a plan one at a time, and the smallest design."""

from tankcal.report import blocks
from tankcal.report.plain import Column
from tankcal.report.planning import DESIGN, figures
from tankcal.report.planning.rows import place_of_change

MOST_CHANGES = 30  # in each table
_EFFECT = (
    Column("relative", "share", digits=3, heading="u_over_v"), Column("U_m3", "m3", digits=3),
    Column("difference", "share ppm", decimals=1), Column("poor", decimals=0),
    Column("cost", digits=4),
)  # fmt: skip
EFFECTS = (Column("change"), *_EFFECT)
OF_WALL = tuple(one for one in EFFECTS if one.key != "poor")
PLACED = (
    Column("change"), *(Column(key, "m", decimals=1) for key in ("arc_m", "off_m", "height_m")),
    *_EFFECT,
)  # fmt: skip


def changes(paper):
    """The blocks of the changes that were tried."""
    works = [one for one in paper.effects if not one.why]
    if not works:
        return []
    drops = [one for one in works if one.change.action == "drop"]
    gains = [one for one in works if one.change.action != "drop"]
    return [
        paper.heading("changes"),
        paper.paragraph("wall_changes" if paper.is_wall else "changes"),
        *_best(paper, "gains", gains, OF_WALL if paper.is_wall else PLACED),
        *_best(paper, "drops", drops, OF_WALL if paper.is_wall else EFFECTS),
        *_needed(paper),
        paper.figure(figures.changes(paper), "changes"),
    ]


def _best(paper, name, effects, columns):
    """The first of some effects, and how many more there are."""
    if not effects:
        return []
    found = [paper.table(name, _effects(paper, effects[:MOST_CHANGES]), columns)]
    if len(effects) > MOST_CHANGES:
        found.append(paper.paragraph("more_changes", count=len(effects) - MOST_CHANGES))
    return found


def _needed(paper):
    """What the survey would not work without, and why; additions that cannot be are left out."""
    lost = [
        paper.word(f"texts.needed_{_reason(one.why)}", change=paper.change(one.change))
        for one in paper.effects
        if one.why and one.change.action == "drop"
    ]
    return [paper.paragraph("needed"), blocks.listing(lost)] if lost else []


def _reason(why):
    return next((code for code in ("datum", "rank") if why.startswith(f"{code} defect")), "other")


def _effects(paper, effects):
    return [
        {
            "change": paper.change(one.change),
            "relative": one.relative_u,
            "U_m3": one.U_m3,
            "difference": one.difference,
            "poor": one.poor,
            "cost": one.change.cost or None,
        }
        | place_of_change(one.change)
        for one in effects
    ]


def design(paper):
    """The blocks of the smallest design that was looked for."""
    path = paper.design
    if path is None:
        return []
    code = "design" if path.start_cost or path.cost else "design_without_cost"
    text = paper.paragraph(
        code,
        before=paper.three_digits(path.start_u),
        after=paper.three_digits(path.relative_u),
        cost_before=paper.plain(path.start_cost),
        cost=paper.plain(path.cost),
        tried=path.tried,
    )
    if not path.steps:
        return [paper.heading("design"), paper.paragraph("no_step"), text, *_missed(paper, path)]
    steps = paper.table("design", _effects(paper, path.steps), OF_WALL if paper.is_wall else PLACED)
    papers = paper.paragraph("design_has_papers", folder=DESIGN)
    return [paper.heading("design"), text, *_missed(paper, path), papers, steps]


def _missed(paper, path):
    if path.prediction.meets is not False:
        return []
    limit = paper.three_digits(paper.plan.limits.relative_u)
    return [paper.paragraph("design_missed", limit=limit)]
