"""Runs of metered liquid in the papers of a plan: what they would add, and the rows of the crew."""

import numpy as np

from tankcal.report import blocks
from tankcal.report.numbers import symbol
from tankcal.report.plain import Column
from tankcal.text.words import name_of_input

DIP = Column("dip_m", "m", height=True, heading="dip")
U_GEOMETRY = Column("U_geometry_m3", "m3", digits=2)
U_JOINT = Column("U_m3", "m3", digits=2, heading="U_joint_m3")
BY_PEN = {"nothing": "_" * 8, "words": "marks"}  # filled in on site
RUNS = (
    Column("run"), Column("meter"), DIP, Column("batch_m3", "m3", decimals=2),
    Column("volume_read", **BY_PEN), Column("dip_read", **BY_PEN),
    Column("meter_c", nothing="_" * 5, words="marks"),
    Column("tank_c", nothing="_" * 5, words="marks"),
    Column("shell_c", nothing="_" * 5, words="marks"), Column("time", **BY_PEN),
)  # fmt: skip


def filling(paper):
    """The blocks of what runs of liquid would add to the geometry of a WallPaper."""
    found = paper.prediction.filling
    if found is None:
        return []
    alone = paper.plan.design.is_metered_alone
    return [
        paper.heading("filling"),
        paper.paragraph("filling_alone" if alone else "filling"),
        paper.table("filled_dips", *_dips(found)),
        paper.table("filled_differences", *_differences(found)),
        paper.table("told_by_liquid", *_causes(paper, found)),
        paper.table("liquid_readings", *_readings(paper, found)),
        *_radius(paper, found),
    ]


def _some(rows, columns):
    """Without the columns that no row has anything in."""
    kept = [one for one in columns if any(row[one.key] is not None for row in rows)]
    return rows, kept


def _dips(found):
    rows = [
        {
            "dip_m": one.dip_m,
            "volume_m3": one.volume_m3,
            "U_geometry_m3": one.U_geometry_m3,
            "U_liquid_m3": one.U_liquid_m3,
            "U_m3": one.U_m3,
        }
        for one in found.dips
    ]
    liquid = Column("U_liquid_m3", "m3", digits=2)
    return _some(rows, [DIP, Column("volume_m3", "m3", u="U_m3"), U_GEOMETRY, liquid, U_JOINT])


def _differences(found):
    rows = [
        {
            "low_m": one.low_m,
            "high_m": one.high_m,
            "volume_m3": one.volume_m3,
            "U_geometry_m3": one.U_geometry_m3,
            "U_m3": one.U_m3,
            "relative": one.U_m3 / one.volume_m3,
        }
        for one in found.differences
    ]
    ends = [Column(key, "m", height=True) for key in ("low_m", "high_m")]
    share = Column("relative", "share", digits=3)
    return _some(rows, [*ends, Column("volume_m3", "m3", u="U_m3"), U_GEOMETRY, U_JOINT, share])


def _causes(paper, found):
    rows = []
    for one in found.causes:
        name = name_of_input(paper.words, one.kind)
        before, after = (
            f"{paper.number(u, digits=3)} {symbol(one.unit)}" for u in (one.u_before, one.u_after)
        )
        rows.append(
            {
                "source": f"{name}, {one.name}" if one.name else name,
                "u_before": before,
                "u_after": after,
            }
        )
    columns = [Column("source"), *(Column(key, align="right") for key in ("u_before", "u_after"))]
    return rows, columns


def _readings(paper, found):
    rows = [
        {
            "readings": paper.word(f"labels.{one.kind}"),
            "count": one.count,
            "uncontrolled": one.uncontrolled or None,
            "redundancy": one.redundancy,
            "blunder": one.detectable
            and paper.number(one.detectable, "m3" if one.kind == "batches" else "mm", digits=2),
        }
        for one in found.readings
    ]
    columns = [
        Column("readings"), Column("count", decimals=0), Column("uncontrolled", decimals=0),
        Column("redundancy", decimals=3), Column("blunder", align="right"),
    ]  # fmt: skip
    return _some(rows, columns)


def _radius(paper, found):
    if found.detectable_radius_m is None:
        return []
    least = paper.number(found.detectable_radius_m, "mm", digits=2)
    return [paper.paragraph("filling_radius", radius=least)]


def sheet_of_runs(paper, table):
    """The blocks of the field sheet of the runs; table: its rows and columns."""
    told = [paper.word(f"forms.{one}") for one in ("tight_how", "batches")]
    return [
        paper.heading("runs"),
        paper.paragraph("wall_runs"),
        blocks.listing(told),
        paper.table("runs", *table),
    ]


def rows_of_runs(plan):
    """A row for each dip of each run, with the batch to expect before it."""
    metering, rows = plan.job.liquid, []
    for place in range(0 if metering is None else len(metering)):
        run, dip = metering.run[place], float(metering.dip_m[place])
        is_first, is_dry = place == 0 or metering.run[place - 1] != run, np.isnan(dip)
        rows.append(
            {
                "run": run,
                "meter": metering.meter[place],
                "dip_m": None if is_dry else dip,
                "batch_m3": None if is_first else float(metering.volume_m3[place]),
                "volume_read": "start" if is_first else None,
                "dip_read": "dry" if is_dry else None,
            }
        )
    return rows
