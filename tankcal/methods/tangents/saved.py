"""Saved part of tangents, and the tables that print it: set-ups, levels, every sight."""

import numpy as np

from tankcal.record.ranging import departure_from_sections
from tankcal.record.schema import Finite, Saved, key
from tankcal.report.tables.table import (
    CHECKS,
    COURSE,
    DEPARTURE,
    LEAST,
    LEVEL,
    PLACE,
    ROW,
    SETUP,
    Column,
    Table,
    counts_of,
)

MOST_WAVES, PER_WAVE = 6, 4  # highest order of a level's curve; tangents for each of its orders


class TangentSetup(Saved):
    """A set-up that the limbs were sighted from."""

    setup: str = key("name")
    station: str = key("that it stood over")
    instrument: str = key('name; "": nobody said')
    certificate: str = key('of the instrument; "": not given')
    x_m: Finite = key("where its axes cross, in the survey's frame")
    y_m: Finite = key("the same")
    z_m: Finite = key("the same")
    tangents: int = key("adjusted and not rejected")
    rejected: int = key("that are not of the wall, or contradict it")
    checks: int = key("that are only compared")
    w: float | None = key("test quantity of a set-up that was moved; null: not tested")
    critical: float | None = key("that it is compared with; null: not tested")
    turn_rad: float | None = key("of its circle, as if it had been moved; null: not tested")


class TangentRead(Saved):
    """A sight to a limb."""

    setup: str = key("name")
    course: str = key("as the crew has it")
    level_m: float = key("above the table's zero, as aimed at")
    side: str = key('"left" or "right", as seen from the set-up')
    azimuth_rad: float = key("of the sight")
    length_m: float = key("of the tangent, in plan")
    departure_m: float | None = key("outwards, from the wall as all others have it")
    w: float | None = key("that over its standard deviation; null: no test")
    redundancy: float | None = key("share of a change that shows in it; null: no test")
    mdb_m: float | None = key("smallest blunder that its test finds; null: no test")
    used: bool = key("whether the wall is known from it")
    row: int | None = key("of the file")


class LevelOfTangents(Saved):
    """The tangents of a level: the closed curve that they alone show, of the painted shell."""

    section: str = key("name")
    course: str = key("that it is on")
    level_m: float = key("mean height above the table's zero")
    tangents: int = key("that the wall was taken from")
    rejected: int = key("of this level")
    least: int = key("that the rule file asks for of this circumference")
    order: int = key("of the highest wave of the curve")
    x_m: float | None = key("its centre, in the survey's frame; null: too few tangents")
    y_m: float | None = key("the same")
    perimeter_m: float | None = key("of it: the convex hull; null: too few tangents")
    area_m2: float | None = key("that it encloses")
    wall_area_m2: float = key("of the wall's own section, the hull's excess taken off")


class TangentsRecord(Saved):
    """Tangents of the tank from a traverse round it."""

    setups: list[TangentSetup] = key("in the order of their tangents")
    levels: list[LevelOfTangents] = key("from the bottom up")
    readings: list[TangentRead] = key("in the order of the file")
    excess_m: float = key("by which tangents stand outside the wall on average, taken off")
    excess_sd_m: float = key("standard uncertainty of that, of all tangents together")
    excess_own_sd_m: float = key("standard deviation of one tangent beside it")


def save_tangents(result):
    """`TangentsRecord` of a result."""
    from tankcal.methods.moved_setups import judge_tangents

    tests = judge_tangents(result.job, result.wall, result.touching)
    hull = result.touching.hull
    return TangentsRecord(
        setups=_setups(result, tests),
        levels=_levels(result, tests),
        readings=_readings(result, tests),
        excess_m=float(hull.excess_m.mean()),
        excess_sd_m=float(hull.common_sd_m.mean()),
        excess_own_sd_m=float(hull.own_sd_m.mean()),
    )


def _setups(result, tests):
    from tankcal.methods.moved_setups import critical_of_setup

    tangents, poses = result.job.tangents, result.touching.poses
    setup, found, first = np.array(tangents.setup), [], {}
    for place, (name, _) in enumerate(poses.keys):
        first.setdefault(name, place)
    for name, place in first.items():
        given, mine = tangents.setups[name], setup == name
        w, turn, _ = tests.setups.get(name, (None, None, None))
        found.append(
            TangentSetup(
                setup=name,
                station=given.station,
                instrument=given.instrument or "",
                certificate=tangents.certificates.get(given.instrument, ""),
                **dict(zip(("x_m", "y_m", "z_m"), poses.xyz_m[place].tolist(), strict=True)),
                tangents=np.count_nonzero(mine & tests.used),
                rejected=np.count_nonzero(mine & ~tests.used & ~tangents.check),
                checks=np.count_nonzero(mine & tangents.check),
                w=w,
                critical=None if w is None else critical_of_setup(len(tests.setups)),
                turn_rad=turn,
            )
        )
    return found


def _readings(result, tests):
    tangents, touching = result.job.tangents, result.touching
    departure = tests.departure_m.copy()
    for place in np.flatnonzero(tangents.check):
        departure[place] = departure_from_sections(result, touching.points.xyz_m[place])[1]
    return [
        TangentRead(
            setup=tangents.setup[i],
            course=tangents.course[i],
            level_m=tangents.level_m[i],
            side="right" if tangents.is_right[i] else "left",
            azimuth_rad=touching.azimuth_rad[i] % (2 * np.pi),
            length_m=touching.length_m[i],
            departure_m=departure[i],
            w=tests.w[i],
            redundancy=tests.redundancy[i],
            mdb_m=tests.mdb_m[i],
            used=tests.used[i],
            row=tangents.rows[i] if tangents.rows else None,
        )
        for i in range(len(tangents))
    ]


def _levels(result, tests):
    from tankcal.methods.moved_setups import least_tangents

    job, least = result.job, least_tangents(result.job)
    counted = np.flatnonzero(~job.tangents.check)
    name_of = np.array(result.touching.points.section)
    found = []
    for section in result.wall.sections:
        mine = counted[result.wall.accepted[section.group.members]]
        here = (name_of == name_of[mine[0]]) & ~job.tangents.check
        order, curve = _curve(result.touching, mine)
        origin = result.touching.origin_m
        found.append(
            LevelOfTangents(
                section=section.group.name,
                course=job.courses[section.group.course].name,
                level_m=section.group.height_m - result.zero_m,
                tangents=len(mine),
                rejected=np.count_nonzero(here) - len(mine),
                least=least,
                order=order,
                x_m=None if curve is None else curve.x_m + origin[0],
                y_m=None if curve is None else curve.y_m + origin[1],
                perimeter_m=None if curve is None else curve.perimeter_m,
                area_m2=None if curve is None else curve.area_m2,
                wall_area_m2=section.outline.area_m2(),
            )
        )
    return found


def _curve(touching, mine):
    """Highest wave, and `SupportCurve` of some tangents; None: they do not determine it."""
    from tankcal.survey.tangents import fit_support

    order = int(np.clip(len(mine) // PER_WAVE - 1, 1, MOST_WAVES))
    f, support = touching.normal_rad[mine], touching.support_m[mine]
    for highest in range(order, 0, -1):
        try:
            return highest, fit_support(f, support, highest)
        except np.linalg.LinAlgError:
            continue
    return 1, None


_W = Column("w", decimals=2, heading="tangent_w", sheet="tangent_w")
_COUNTS = counts_of("tangents")

SETUPS = Table(
    "tangent_setups",
    (
        *PLACE,
        *_COUNTS,
        CHECKS,
        _W,
        Column("turn_rad", "rad arcsec", decimals=1, heading="tangent_turn",
               sheet="tangent_turn_arcsec"),
    ),
    rows=lambda record: record["tangents"]["setups"],
)  # fmt: skip

LEVELS = Table(
    "tangent_levels",
    (
        COURSE,
        LEVEL,
        *_COUNTS,
        LEAST,
        Column("order", decimals=0, heading="tangent_order", sheet="tangent_order"),
        Column("perimeter_m", "m", decimals=4, heading="tangent_perimeter",
               sheet="tangent_perimeter_m"),
        Column("area_m2", "m2", decimals=3, heading="tangent_area", sheet="tangent_area_m2"),
        Column("wall_area_m2", "m2", decimals=3, heading="tangent_wall_area",
               sheet="tangent_wall_area_m2"),
    ),
    rows=lambda record: record["tangents"]["levels"],
)  # fmt: skip

READINGS = Table(
    "tangent_readings",
    (
        ROW,
        SETUP,
        COURSE,
        LEVEL,
        Column("side", words="limbs", heading="tangent_side", sheet="tangent_side", width=9),
        Column("length_m", "m", decimals=2, heading="tangent_length", sheet="tangent_length_m"),
        DEPARTURE,
        _W,
        Column("redundancy", decimals=2, heading="tangent_redundancy",
               sheet="tangent_redundancy"),
        Column("mdb_m", "mm", decimals=1, heading="tangent_mdb", sheet="tangent_mdb_mm"),
        Column("used", words="yes_no", heading="tangent_used", sheet="tangent_used", width=8),
    ),
    rows=lambda record: record["tangents"]["readings"],
)  # fmt: skip
