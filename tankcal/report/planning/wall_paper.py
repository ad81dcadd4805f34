"""Papers of a plan of the bare wall: prediction and field sheets."""

import numpy as np

from tankcal.planning.improvements import cost_of
from tankcal.planning.wall.changes import NUMBERED
from tankcal.record.plan import survey_of
from tankcal.report import blocks
from tankcal.report.numbers import symbol
from tankcal.report.plain import Column
from tankcal.report.planning.pages import (
    PlanPaper,
    changes,
    design,
    result,
    simulated_surveys,
    table,
)
from tankcal.report.planning.rows import COURSES, DIP, courses_of, field_tables_of_wall
from tankcal.text.words import name_of_input

COUNTED = (
    *("circumferences", "strap_readings", "lines", "offsets", "setups", "hits", "tangents"),
    *("runs", "batches"),
)
COLLECTIVE = ("tangents", "dips")  # names of changes of all readings of a kind
ABOUT = {  # text before a table of the field sheets
    "circumferences": "wall_circumferences",
    "sight_lines": "wall_offsets",
    "hit_setups": "wall_hits",
    "control_targets": "wall_control_targets",
    "tangent_stations": "wall_tangents",
    "bases": "bases",
}
HEADINGS = {  # heading before a table of the field sheets
    "circumferences": "circumferences",
    "sight_lines": "offsets",
    "hit_setups": "hits",
    "control_targets": "control_targets",
    "tangent_stations": "tangents",
    "bases": "bases",
    "instruments": "equipment",
}
NARROW = ("sight_lines", "offsets", "offset_readings", "shared_targets")  # tables in two parts
U_GEOMETRY = Column("U_geometry_m3", "m3", digits=2)
U_JOINT = Column("U_m3", "m3", digits=2, heading="U_joint_m3")


class WallPaper(PlanPaper):
    """A `WallPrediction` with the words of a language; otherwise as `PlanPaper`."""

    is_wall = True

    def describe_change(self, change):
        """Return a `planning.changes.Change` of a WallPlan in words."""
        code = f"{change.action}_wall_{change.item}"
        if change.name in COLLECTIVE:
            code += f"_of_{change.name}"
        name = change.name
        if change.item in NUMBERED:
            name = name.replace(".", self.marks.decimal)
        return self.word(f"changes.{code}", name=name)


# ---- prediction


def wall_outlook(paper):
    """Return the blocks of the prediction of a WallPaper."""
    assumed = [] if paper.plan.design.is_metered_alone else [paper.paragraph("wall_as_assumed")]
    return [
        *paper.head("prediction"),
        result(paper),
        _counts(paper),
        *assumed,
        *paper.warnings(paper.prediction.warnings),
        *table(paper),
        *_filling(paper),
        *_courses(paper),
        *_reliability(paper),
        *_simulation_blocks(paper),
        *changes(paper),
        *design(paper),
    ]


def _counts(paper):
    survey, cost = survey_of(paper.plan), cost_of(paper.plan)
    return paper.facts(
        [
            ("planned_for", paper.day()),
            *((key, paper.count(getattr(survey, key))) for key in COUNTED),
            ("cost", paper.plain(cost) if cost else None),
        ]
    )


def _courses(paper):
    rows = courses_of(paper.prediction)
    if not rows:
        return []
    before = [paper.paragraph("courses_before_liquid")] if paper.plan.design.runs else []
    return [paper.heading("courses"), *before, _table(paper, "courses", rows, COURSES)]


def _table(paper, name, rows, columns):
    """Return the block of a table without its empty columns."""
    filled = [column for column in columns if any(row[column.key] is not None for row in rows)]
    return paper.table(name, rows, filled)


def _reliability(paper):
    rows = [
        {
            "readings": paper.word(f"labels.{readings.kind}"),
            "count": readings.count,
            "uncontrolled": readings.uncontrolled or None,
            "blunder_m": readings.mdb_m if np.isfinite(readings.mdb_m) else None,
        }
        for readings in paper.prediction.reliability
    ]
    columns = [
        Column("readings"), Column("count", decimals=0), Column("uncontrolled", decimals=0),
        Column("blunder_m", "mm", digits=2, heading="blunder"),
    ]  # fmt: skip
    if not rows:
        return []
    return [
        paper.heading("reliability"),
        paper.paragraph("wall_reliability"),
        paper.table("reliability", rows, columns),
    ]


def _simulation_blocks(paper):
    simulated = paper.simulated
    if simulated is None:
        return []
    low, median, high = (paper.number(ratio, decimals=2) for ratio in simulated.U_ratios)
    values = {
        "simulated_error": paper.number(simulated.volume_ratio, decimals=3),
        "simulated_U": paper.word("texts.from_to", middle=median, low=low, high=high),
        "simulated_covered": paper.number(simulated.covered, "share", decimals=1),
        "simulated_rows": paper.number(float(simulated.within.mean()), "share", decimals=1),
    }
    return simulated_surveys(paper, "wall_simulated", values)


# ---- contribution of runs of metered liquid


def _filling(paper):
    """Return the blocks of the contribution of runs of liquid to the geometry."""
    filling = paper.prediction.filling
    if filling is None:
        return []
    is_alone = paper.plan.design.is_metered_alone
    radius = []
    if filling.detectable_radius_m is not None:
        least = paper.number(filling.detectable_radius_m, "mm", digits=2)
        radius = [paper.paragraph("filling_radius", radius=least)]
    return [
        paper.heading("filling"),
        paper.paragraph("filling_alone" if is_alone else "filling"),
        _dips(paper, filling),
        _differences(paper, filling),
        _causes(paper, filling),
        _readings_of_liquid(paper, filling),
        *radius,
    ]


def _dips(paper, filling):
    rows = [vars(dip) for dip in filling.dips]
    liquid = Column("U_liquid_m3", "m3", digits=2)
    columns = [DIP, Column("volume_m3", "m3", u="U_m3"), U_GEOMETRY, liquid, U_JOINT]
    return _table(paper, "filled_dips", rows, columns)


def _differences(paper, filling):
    rows = [
        vars(difference) | {"relative": difference.U_m3 / difference.volume_m3}
        for difference in filling.differences
    ]
    ends = [Column(key, "m", height=True) for key in ("low_m", "high_m")]
    share = Column("relative", "share", digits=3)
    columns = [*ends, Column("volume_m3", "m3", u="U_m3"), U_GEOMETRY, U_JOINT, share]
    return _table(paper, "filled_differences", rows, columns)


def _causes(paper, filling):
    rows = []
    for cause in filling.causes:
        name = name_of_input(paper.words, cause.kind)
        before, after = (
            f"{paper.number(u, digits=3)} {symbol(cause.unit)}"
            for u in (cause.u_before, cause.u_after)
        )
        source = f"{name}, {cause.name}" if cause.name else name
        rows.append({"source": source, "u_before": before, "u_after": after})
    columns = [Column("source"), *(Column(key, align="right") for key in ("u_before", "u_after"))]
    return paper.table("told_by_liquid", rows, columns)


def _readings_of_liquid(paper, filling):
    rows = [
        {
            "readings": paper.word(f"labels.{readings.kind}"),
            "count": readings.count,
            "uncontrolled": readings.uncontrolled or None,
            "redundancy": readings.redundancy,
            "blunder": readings.detectable
            and paper.number(
                readings.detectable, "m3" if readings.kind == "batches" else "mm", digits=2
            ),
        }
        for readings in filling.readings
    ]
    columns = [
        Column("readings"), Column("count", decimals=0), Column("uncontrolled", decimals=0),
        Column("redundancy", decimals=3), Column("blunder", align="right"),
    ]  # fmt: skip
    return _table(paper, "liquid_readings", rows, columns)


# ---- field sheets


def wall_sheets(paper):
    """Return the blocks of the field sheets of a WallPaper."""
    sheets = [*paper.head("field_sheets"), _counts(paper), *paper.warnings(paper.plan.warnings)]
    for name, (rows, columns) in field_tables_of_wall(paper.plan).items():
        if name in HEADINGS:
            sheets.append(paper.heading(HEADINGS[name]))
        if name in ABOUT:
            sheets.append(paper.paragraph(ABOUT[name]))
        if name == "sight_lines" and any(part.faces > 1 for part in paper.plan.design.parts):
            sheets.append(paper.paragraph("wall_faces"))
        if name == "runs":
            instructions = [paper.word(f"forms.{key}") for key in ("tight_how", "batches")]
            sheets += [paper.heading("runs"), paper.paragraph("wall_runs")]
            sheets.append(blocks.listing(instructions))
        sheets.append(paper.table(name, rows, columns, across=2 if name in NARROW else None))
    return [
        *sheets,
        paper.heading("afterwards"),
        blocks.listing([paper.word(f"texts.after_{step}") for step in ("job", "names", "run")]),
        blocks.signature([paper.word("signatures.surveyed")]),
    ]
