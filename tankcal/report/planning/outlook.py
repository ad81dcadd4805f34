"""The prediction on paper: U of the table, weak areas, reliability, what helps most."""

import numpy as np

from tankcal.planning.bases import by_ends
from tankcal.planning.changes import cost_of
from tankcal.planning.simulations import BLUNDER_SDS
from tankcal.report import blocks
from tankcal.report.numbers import unit
from tankcal.report.plain import Column
from tankcal.report.planning import figures
from tankcal.report.planning.field_sheets import SHORT, unseen_targets
from tankcal.report.planning.improvements import changes, design
from tankcal.report.planning.rows import lost_ties
from tankcal.text.digits import format_with_u
from tankcal.text.words import group_name, name_of_input
from tankcal.uncertainty import combine

DIPS = 12  # rows of the table that are shown
MOST_POINTS = 40
NOTHING = 1e-9  # of the largest u: an input that contributes less is not listed
SHARE = Column("relative", "share", digits=3)


def outlook(paper):
    """The blocks of the prediction of a PlanPaper."""
    return [
        *paper.head("prediction"),
        result(paper),
        *_facts(paper),
        *paper.warnings(paper.prediction.warnings),
        *table(paper),
        *_weak(paper),
        *_reliability(paper),
        *_simulated(paper),
        *changes(paper),
        *design(paper),
    ]


def result(paper):
    """The full tank with its U, and whether the limit is met."""
    found, table = paper.prediction, paper.prediction.table
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
            f"texts.limit_{limits.of}_{'met' if found.meets else 'missed'}",
            limit=paper.three_digits(limits.relative_u),
            share=paper.three_digits(found.relative_u),
        )
        note = f"{verdict} {note}"
    return blocks.result(paper.word("texts.top_label"), text, note)


def _facts(paper):
    found, plan = paper.prediction, paper.plan
    solution, datum = found.predicted.adjusted.solution, found.datum
    cost = cost_of(plan)
    return [
        paper.facts(
            [
                ("planned_for", paper.day()),
                ("photo_stations", _count(paper, len(plan.stations))),
                ("photographs", _count(paper, len(plan.photos))),
                ("setups", _count(paper, len(plan.setups))),
                ("tapes", _count(paper, len(plan.ties))),
                ("lost_ties", _count(paper, len(lost_ties(found)))),
                ("bases", _count(paper, len(by_ends(plan.bases)))),
                ("control_points", _count(paper, len(plan.known))),
                ("targets", _count(paper, len(plan.targets.names))),
                ("unseen_targets", _count(paper, unseen_targets(found))),
                ("observations", _count(paper, solution.rows)),
                ("unknowns", _count(paper, solution.estimated)),
                ("redundancy", _count(paper, solution.dof)),
                ("mean_sd", paper.number(found.precision.mean_sd_m, "mm", digits=2)),
                ("homogeneity", _axes(paper, found.precision.range_m)),
                ("datum", paper.said(datum.words) if datum.words else None),
                ("cost", paper.plain(cost) if cost else None),
            ]
        )
    ]


def _count(paper, number):
    return paper.number(number, decimals=0) if number else None


def _axes(paper, values_m):
    texts = [paper.number(float(one), "mm", digits=2) for one in values_m]
    return ", ".join(f"{axis} {text}" for axis, text in zip("xyz", texts, strict=True))


def table(paper):
    """U against the dip, the table at some dips, the worst deliveries, the budget."""
    table, stated = paper.prediction.table, paper.prediction.tabled.stated
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
    return [
        paper.heading("uncertainty"),
        paper.figure(figures.uncertainty(paper), "uncertainty"),
        paper.table("dips", rows, columns),
        *_worst(paper, stated.worst),
        paper.table(
            "sources",
            [
                {"source": name, "U_m3": float(u)}
                for name, u in sorted(_sources(paper).items(), key=lambda one: -one[1])
            ],
            [Column("source"), Column("U_m3", "m3", digits=2, heading="u_top")],
        ),
    ]


def _sources(paper):
    """{input: its standard uncertainty of the full tank}."""
    table, variances = paper.prediction.table, {}
    of_top = combine(table.sources, len(table.height_m)).variances[-1]
    for one, variance in zip(table.sources, of_top, strict=True):
        name = name_of_input(paper.words, one.kind)
        variances[name] = variances.get(name, 0.0) + variance
    found = {name: np.sqrt(variance) for name, variance in variances.items()}
    least = NOTHING * max(found.values(), default=0.0)
    return {name: u for name, u in found.items() if u > least}


def _worst(paper, worst):
    rows = [
        {
            "minimum_m": one.minimum_m,
            "low_m": one.relative.low_m,
            "high_m": one.relative.high_m,
            "U_m3": one.relative.U_m3,
            "relative": one.relative.relative,
        }
        for one in worst
    ]
    heights = [Column(key, "m", height=True) for key in ("minimum_m", "low_m", "high_m")]
    columns = [*heights, Column("U_m3", "m3", digits=2), SHARE]
    return [paper.table("worst", rows, columns)] if rows else []


def _weak(paper):
    found = paper.prediction
    rows = [
        {
            "point": one.name,
            "rays": one.rays,
            "sd_m": None if one.undetermined else float(one.sd_m.max()),
            "why": paper.word(f"texts.{_why(paper, one)}", rays=one.rays),
        }
        for one in (*found.undetermined, *found.weak)
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
        paper.table("sections", *_sections(found)),
    ]


def _why(paper, one):
    if one.undetermined:
        return {0: "why_unseen", 1: "why_one_ray"}.get(one.rays, "why_undetermined")
    if one.rays >= paper.fewest_rays:
        return "why_large_sd"
    return "why_one_ray" if one.rays == 1 else "why_few_rays"


def _sections(found):
    rows = [
        {
            "section": one.name,
            "height_m": one.height_m,
            "targets": one.targets,
            "centre_x_m": float(one.centre_sd_m[0]),
            "centre_y_m": float(one.centre_sd_m[1]),
            "radius_m": float(one.radius_sd_m),
        }
        for one in found.sections
    ]
    sds = [Column(key, "mm", digits=2) for key in ("centre_x_m", "centre_y_m", "radius_m")]
    height = Column("height_m", "m", decimals=3)
    return rows, [Column("section"), height, Column("targets", decimals=0), *sds]


def _reliability(paper):
    rows = [
        {
            "readings": group_name(paper.words, {"name": one.name, "kind": one.kind}),
            "count": one.count,
            "uncontrolled": one.uncontrolled,
            "redundancy": one.redundancy,
            "blunder": _blunder(paper, one),
            "of": " – ".join(one.of),
            "volume_m3": None if np.isnan(one.volume_m3) else one.volume_m3,
            "volume_of": " – ".join(one.volume_of),
        }
        for one in paper.prediction.reliability
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


def _uncontrolled(paper):
    """What an error in a reading that nothing controls does to the volume."""
    rows = [
        {
            "readings": group_name(paper.words, {"name": one.name, "kind": one.kind}),
            "uncontrolled": one.uncontrolled,
            "per_unit_m3": one.per_unit_m3 / unit(SHOWN_IN[one.unit]).factor,
            "per": unit(SHOWN_IN[one.unit]).symbol,
            "volume_of": " – ".join(one.per_unit_of),
        }
        for one in paper.prediction.reliability
        if one.uncontrolled
    ]
    columns = [
        Column("readings"), Column("uncontrolled", decimals=0),
        Column("per_unit_m3", "m3", digits=2, heading="volume_of_blunder"), Column("per"),
        Column("volume_of"),
    ]  # fmt: skip
    if not rows:
        return []
    return [paper.paragraph("uncontrolled"), paper.table("uncontrolled", rows, columns)]


SHOWN_IN = {"m": "mm", "mm": "image um", "rad": "rad arcsec"}


def _blunder(paper, one):
    if np.isnan(one.blunder):
        return None
    return paper.number(one.blunder, SHOWN_IN[one.unit], digits=3)


def _simulated(paper):
    found = paper.simulated
    if found is None:
        return []
    values = {
        "simulated_coordinates": paper.number(found.ratio, decimals=3),
        "simulated_volume": paper.number(found.volume_ratio, decimals=3),
    }
    return simulated_surveys(paper, "simulated", values)


def simulated_surveys(paper, about, values):
    """The blocks of simulated surveys of any plan.

    about   the text that says how they were drawn
    values  {label: text} of what they gave
    """
    found = paper.simulated
    known = paper.number(found.volume_ratio_sd, digits=2)
    said = [paper.paragraph(about, seed=str(found.seed), sd=known)]
    if found.blunders:
        share, times = paper.three_digits(found.blunders), paper.plain(BLUNDER_SDS)
        said.append(paper.paragraph("simulated_blunders", share=share, times=times))
    return [
        paper.heading("simulated"),
        *said,
        paper.facts(
            [
                ("simulated_surveys", _count(paper, found.runs)),
                *values.items(),
                ("simulated_aside", paper.number(float(found.set_aside.mean()), decimals=1)),
                ("simulated_failed", _count(paper, len(found.failed))),
            ]
        ),
    ]
