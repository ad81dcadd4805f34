"""The prediction paper: U of the table, weak areas, reliability, effects of changes, design."""

import numpy as np

from tankcal.planning.changes import cost_of
from tankcal.planning.measurements import BLUNDER_SDS
from tankcal.planning.places import group_by_ends
from tankcal.report import blocks
from tankcal.report.numbers import unit
from tankcal.report.plain import Column
from tankcal.report.planning import figures
from tankcal.report.planning.field_sheets import SHORT, count_unseen_targets
from tankcal.report.planning.paper import DESIGN
from tankcal.report.planning.rows import lost_ties, place_of_change
from tankcal.text.digits import format_with_u
from tankcal.text.words import group_name, name_of_input
from tankcal.uncertainty import combine

DIPS = 12  # rows of the capacity table in the paper
MOST_POINTS = 40  # weak points listed
MOST_CHANGES = 30  # changes in each table
NEGLIGIBLE = 1e-9  # of the largest u: smaller inputs are not listed
SHOWN_IN = {"m": "mm", "mm": "image um", "rad": "rad arcsec"}  # printed units of blunders
SHARE = Column("relative", "share", digits=3)
_EFFECT = (
    Column("relative", "share", digits=3, heading="u_over_v"), Column("U_m3", "m3", digits=3),
    Column("difference", "share ppm", decimals=1), Column("poor", decimals=0),
    Column("cost", digits=4),
)  # fmt: skip
EFFECTS = (Column("change"), *_EFFECT)
EFFECTS_ON_WALL = tuple(column for column in EFFECTS if column.key != "poor")
EFFECTS_WITH_PLACE = (
    Column("change"), *(Column(key, "m", decimals=1) for key in ("arc_m", "off_m", "height_m")),
    *_EFFECT,
)  # fmt: skip


def outlook(paper):
    """Return the blocks of the prediction of a PlanPaper."""
    return [
        *paper.head("prediction"),
        result(paper),
        _facts(paper),
        *paper.warnings(paper.prediction.warnings),
        *table(paper),
        *_weak(paper),
        *_reliability(paper),
        *_simulated(paper),
        *changes(paper),
        *design(paper),
    ]


def result(paper):
    """Return the block of the full tank with its U and the verdict on the limit."""
    prediction, table = paper.prediction, paper.prediction.table
    value = format_with_u(table.volume_m3[-1], table.U_m3[-1], paper.marks, least=0)
    text = paper.word(
        "texts.top",
        volume=value.value,
        U=value.uncertainty,
        share=paper.three_digits(table.U_m3[-1] / table.volume_m3[-1]),
        k=paper.number(float(table.k[-1]), decimals=2),
    )
    note = paper.word("texts.before_anything")
    limits = paper.plan.limits
    if limits.relative_u is not None:
        verdict = paper.word(
            f"texts.limit_{limits.quantity}_{'met' if prediction.meets else 'missed'}",
            limit=paper.three_digits(limits.relative_u),
            share=paper.three_digits(prediction.relative_u),
        )
        note = f"{verdict} {note}"
    return blocks.result(paper.word("texts.top_label"), text, note)


def _facts(paper):
    prediction, plan = paper.prediction, paper.plan
    solution, datum = prediction.network.adjusted.solution, prediction.datum
    cost = cost_of(plan)
    ranges = [paper.number(float(sd), "mm", digits=2) for sd in prediction.precision.range_m]
    homogeneity = ", ".join(f"{axis} {text}" for axis, text in zip("xyz", ranges, strict=True))
    return paper.facts(
        [
            ("planned_for", paper.day()),
            ("photo_stations", paper.count(len(plan.stations))),
            ("photographs", paper.count(len(plan.photos))),
            ("setups", paper.count(len(plan.setups))),
            ("tapes", paper.count(len(plan.ties))),
            ("lost_ties", paper.count(len(lost_ties(prediction)))),
            ("bases", paper.count(len(group_by_ends(plan.bases)))),
            ("control_points", paper.count(len(plan.known))),
            ("targets", paper.count(len(plan.targets.names))),
            ("unseen_targets", paper.count(count_unseen_targets(prediction))),
            ("observations", paper.count(solution.rows)),
            ("unknowns", paper.count(solution.estimated)),
            ("redundancy", paper.count(solution.dof)),
            ("mean_sd", paper.number(prediction.precision.mean_sd_m, "mm", digits=2)),
            ("homogeneity", homogeneity),
            ("datum", paper.translate(datum.words) if datum.words else None),
            ("cost", paper.plain(cost) if cost else None),
        ]
    )


# ---- uncertainty of the table


def table(paper):
    """Return the blocks of U against the dip, some rows, the worst deliveries and the budget."""
    table, stated = paper.prediction.table, paper.prediction.result.stated
    last = len(table.height_m) - 1
    places = dict.fromkeys(np.linspace(0, last, DIPS + 1).round().astype(int)[1:].tolist())
    rows = [
        {
            "height_m": float(table.height_m[i]),
            "volume_m3": float(table.volume_m3[i]),
            "U_m3": float(table.U_m3[i]),
            "relative": float(table.U_m3[i] / table.volume_m3[i]),
        }
        for i in places
    ]
    dip = Column("height_m", "m", height=True, heading="dip")
    columns = [dip, Column("volume_m3", "m3", u="U_m3"), Column("U_m3", "m3", digits=2), SHARE]
    sources = sorted(_sources(paper).items(), key=lambda source: -source[1])
    return [
        paper.heading("uncertainty"),
        paper.figure(figures.uncertainty(paper), "uncertainty"),
        paper.table("dips", rows, columns),
        *_worst(paper, stated.worst),
        paper.table(
            "sources",
            [{"source": name, "U_m3": float(u)} for name, u in sources],
            [Column("source"), Column("U_m3", "m3", digits=2, heading="u_top")],
        ),
    ]


def _sources(paper):
    """Return {input: standard uncertainty of the full tank, m3}, without negligible inputs."""
    table, variances = paper.prediction.table, {}
    of_top = combine(table.sources, len(table.height_m)).variances[-1]
    for source, variance in zip(table.sources, of_top, strict=True):
        name = name_of_input(paper.words, source.kind)
        variances[name] = variances.get(name, 0.0) + variance
    u_of = {name: np.sqrt(variance) for name, variance in variances.items()}
    least = NEGLIGIBLE * max(u_of.values(), default=0.0)
    return {name: u for name, u in u_of.items() if u > least}


def _worst(paper, worst):
    rows = [
        {
            "minimum_m": delivery.minimum_m,
            "low_m": delivery.relative.low_m,
            "high_m": delivery.relative.high_m,
            "U_m3": delivery.relative.U_m3,
            "relative": delivery.relative.relative,
        }
        for delivery in worst
    ]
    heights = [Column(key, "m", height=True) for key in ("minimum_m", "low_m", "high_m")]
    columns = [*heights, Column("U_m3", "m3", digits=2), SHARE]
    return [paper.table("worst", rows, columns)] if rows else []


# ---- weak areas and reliability


def _weak(paper):
    prediction = paper.prediction
    rows = [
        {
            "point": point.name,
            "rays": point.rays,
            "sd_m": None if point.undetermined else float(point.sd_m.max()),
            "why": paper.word(f"texts.{_weakness(paper, point)}", rays=point.rays),
        }
        for point in (*prediction.undetermined, *prediction.weak)
    ]
    columns = [
        Column("point"), Column("rays", decimals=0), Column("sd_m", "mm", digits=2), Column("why"),
    ]  # fmt: skip
    across = 2 if len(rows) > SHORT else None
    listed = [paper.table("weak", rows[:MOST_POINTS], columns, across=across)] if rows else []
    if len(rows) > MOST_POINTS:
        listed.append(paper.paragraph("more_weak", count=len(rows) - MOST_POINTS))
    return [
        paper.heading("weak"),
        paper.figure(figures.weak_areas(paper), "weak_areas"),
        paper.figure(figures.rays(paper), "rays"),
        *(listed or [paper.paragraph("none_weak")]),
        _sections(paper),
    ]


def _weakness(paper, point):
    """Key of the text that states why a point is undetermined or weak."""
    if point.undetermined:
        return {0: "why_unseen", 1: "why_one_ray"}.get(point.rays, "why_undetermined")
    if point.rays >= paper.fewest_rays:
        return "why_large_sd"
    return "why_one_ray" if point.rays == 1 else "why_few_rays"


def _sections(paper):
    rows = [
        {
            "section": section.name,
            "height_m": section.height_m,
            "targets": section.targets,
            "centre_x_m": float(section.centre_sd_m[0]),
            "centre_y_m": float(section.centre_sd_m[1]),
            "radius_m": float(section.radius_sd_m),
        }
        for section in paper.prediction.sections
    ]
    sds = [Column(key, "mm", digits=2) for key in ("centre_x_m", "centre_y_m", "radius_m")]
    height = Column("height_m", "m", decimals=3)
    columns = [Column("section"), height, Column("targets", decimals=0), *sds]
    return paper.table("sections", rows, columns)


def _reliability(paper):
    rows = [
        {
            "readings": _name_of_group(paper, group),
            "count": group.count,
            "uncontrolled": group.uncontrolled,
            "redundancy": group.redundancy,
            "blunder": None
            if np.isnan(group.blunder)
            else paper.number(group.blunder, SHOWN_IN[group.unit], digits=3),
            "of": " – ".join(group.of),
            "volume_m3": None if np.isnan(group.volume_m3) else group.volume_m3,
            "volume_of": " – ".join(group.volume_of),
        }
        for group in paper.prediction.reliability
    ]
    columns = [
        Column("readings"), Column("count", decimals=0), Column("uncontrolled", decimals=0),
        Column("redundancy", decimals=2), Column("blunder", align="right"), Column("of"),
        Column("volume_m3", "m3", digits=2, heading="volume_of_blunder"), Column("volume_of"),
    ]  # fmt: skip
    return [
        paper.heading("reliability"),
        paper.paragraph("reliability"),
        paper.table("reliability", rows, columns),
        *_uncontrolled(paper),
    ]


def _name_of_group(paper, group):
    return group_name(paper.words, {"name": group.name, "kind": group.kind})


def _uncontrolled(paper):
    """Return the blocks of the effect of errors in uncontrolled readings on the volume."""
    rows = []
    for group in paper.prediction.reliability:
        if group.uncontrolled:
            shown = unit(SHOWN_IN[group.unit])
            rows.append(
                {
                    "readings": _name_of_group(paper, group),
                    "uncontrolled": group.uncontrolled,
                    "per_unit_m3": group.per_unit_m3 / shown.factor,
                    "per": shown.symbol,
                    "volume_of": " – ".join(group.per_unit_of),
                }
            )
    columns = [
        Column("readings"), Column("uncontrolled", decimals=0),
        Column("per_unit_m3", "m3", digits=2, heading="volume_of_blunder"), Column("per"),
        Column("volume_of"),
    ]  # fmt: skip
    if not rows:
        return []
    return [paper.paragraph("uncontrolled"), paper.table("uncontrolled", rows, columns)]


# ---- simulated surveys


def _simulated(paper):
    simulated = paper.simulated
    if simulated is None:
        return []
    values = {
        "simulated_coordinates": paper.number(simulated.ratio, decimals=3),
        "simulated_volume": paper.number(simulated.volume_ratio, decimals=3),
    }
    return simulated_surveys(paper, "simulated", values)


def simulated_surveys(paper, name, values):
    """Return the blocks of simulated surveys of any plan.

    Parameters
    ----------
    paper : PlanPaper
    name : str
        Key of the text that describes the simulation.
    values : dict
        {label: text} of the results.

    Returns
    -------
    list of blocks.Block
    """
    simulated = paper.simulated
    sd = paper.number(simulated.volume_ratio_sd, digits=2)
    texts = [paper.paragraph(name, seed=str(simulated.seed), sd=sd)]
    if simulated.blunders:
        share, times = paper.three_digits(simulated.blunders), paper.plain(BLUNDER_SDS)
        texts.append(paper.paragraph("simulated_blunders", share=share, times=times))
    rejected = paper.number(float(simulated.set_aside.mean()), decimals=1)
    return [
        paper.heading("simulated"),
        *texts,
        paper.facts(
            [
                ("simulated_surveys", paper.count(simulated.runs)),
                *values.items(),
                ("simulated_aside", rejected),
                ("simulated_failed", paper.count(len(simulated.failed))),
            ]
        ),
    ]


# ---- changes and the smallest design


def changes(paper):
    """Return the blocks of the evaluated changes."""
    possible = [effect for effect in paper.effects if not effect.why]
    if not possible:
        return []
    drops = [effect for effect in possible if effect.change.action == "drop"]
    gains = [effect for effect in possible if effect.change.action != "drop"]
    return [
        paper.heading("changes"),
        paper.paragraph("wall_changes" if paper.is_wall else "changes"),
        *_best(paper, "gains", gains, EFFECTS_ON_WALL if paper.is_wall else EFFECTS_WITH_PLACE),
        *_best(paper, "drops", drops, EFFECTS_ON_WALL if paper.is_wall else EFFECTS),
        *_indispensable(paper),
        paper.figure(figures.changes(paper), "changes"),
    ]


def _best(paper, name, effects, columns):
    """Return the blocks of the first effects, and of the number of further effects."""
    if not effects:
        return []
    best = [paper.table(name, _rows_of_effects(paper, effects[:MOST_CHANGES]), columns)]
    if len(effects) > MOST_CHANGES:
        best.append(paper.paragraph("more_changes", count=len(effects) - MOST_CHANGES))
    return best


def _indispensable(paper):
    """Return the blocks of items without which the survey has no solution, with the reasons."""
    lost = [
        paper.word(
            f"texts.needed_{_reason(effect.why)}", change=paper.describe_change(effect.change)
        )
        for effect in paper.effects
        if effect.why and effect.change.action == "drop"
    ]
    return [paper.paragraph("needed"), blocks.listing(lost)] if lost else []


def _reason(why):
    return next((code for code in ("datum", "rank") if why.startswith(f"{code} defect")), "other")


def _rows_of_effects(paper, effects):
    return [
        {
            "change": paper.describe_change(effect.change),
            "relative": effect.relative_u,
            "U_m3": effect.U_m3,
            "difference": effect.difference,
            "poor": effect.poor,
            "cost": effect.change.cost or None,
        }
        | place_of_change(effect.change)
        for effect in effects
    ]


def design(paper):
    """Return the blocks of the smallest design, if it was searched for."""
    path = paper.design
    if path is None:
        return []
    text = paper.paragraph(
        "design" if path.start_cost or path.cost else "design_without_cost",
        before=paper.three_digits(path.start_u),
        after=paper.three_digits(path.relative_u),
        cost_before=paper.plain(path.start_cost),
        cost=paper.plain(path.cost),
        tried=path.evaluations,
    )
    missed = []
    if path.prediction.meets is False:
        limit = paper.three_digits(paper.plan.limits.relative_u)
        missed = [paper.paragraph("design_missed", limit=limit)]
    if not path.steps:
        return [paper.heading("design"), paper.paragraph("no_step"), text, *missed]
    columns = EFFECTS_ON_WALL if paper.is_wall else EFFECTS_WITH_PLACE
    steps = paper.table("design", _rows_of_effects(paper, path.steps), columns)
    folder = paper.paragraph("design_has_papers", folder=DESIGN)
    return [paper.heading("design"), text, *missed, folder, steps]
