"""Saved part of wall hits, and the tables that print it: set-ups, instruments, rings, controls."""

import numpy as np

from tankcal.record.ranging import SharedByHits, departure_from_sections, shared_of
from tankcal.record.schema import Finite, Saved, key
from tankcal.report.tables import table
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
from tankcal.units import HOUR_S

CLASS_DEG, LAST_DEG = 10, 90  # width of the classes of incidence, and their end


class HitSetupUsed(Saved):
    """A set-up from which the wall was hit."""

    setup: str = key("name")
    station: str = key("of the set-up")
    instrument: str = key("name")
    certificate: str = key('of the instrument; "": not given')
    x_m: Finite = key("intersection of its axes, in the survey's frame")
    y_m: Finite = key("intersection of its axes, in the survey's frame")
    z_m: Finite = key("intersection of its axes, in the survey's frame")
    tie: str = key('"network", "frame" (it is the frame itself) or "wall" (only the wall)')
    hits: int = key("adjusted and not rejected")
    rejected: int = key("hits that are not on the wall, or contradict it")
    checks: int = key("hits that are only compared")


class RingOfHits(Saved):
    """The hits of a section."""

    section: str = key("name")
    course: str = key("of the section")
    level_m: float = key("mean height above the table's zero")
    hits: int = key("used for the wall")
    rejected: int = key("rejected hits that are nearest to this section")
    least: int = key("number required by the rule file for this circumference")


class IncidenceClass(Saved):
    """Hits with similar angles of incidence."""

    low_deg: float = key("from the wall's normal")
    high_deg: float = key("from the wall's normal")
    hits: int = key("all readings")


class ControlRead(Saved):
    """A reading of a control target, less its first reading."""

    setup: str = key("name")
    target: str = key("name")
    elapsed_h: float = key("since the first control reading of the set-up")
    direction_rad: float | None = key("less that of the first reading; null: not read")
    zenith_rad: float | None = key("less that of the first reading; null: not read")
    distance_m: float | None = key("less that of the first reading; null: not read")
    row: int | None = key("of the file")


class DriftOfSetup(Saved):
    """Drift of a set-up from all its control targets; the hits are not corrected for it."""

    setup: str = key("name")
    hours: float = key("between its first and its last control reading")
    direction_rad_h: float | None = key("of the zero of its circle, per hour; null: not determined")
    zenith_rad_h: float | None = key("of its zenith angles, per hour; null: not determined")


class ComparedHit(Saved):
    """A hit that was only compared with the wall."""

    setup: str = key("name")
    section: str = key("nearest section in its course")
    departure_m: float = key("outwards, from the outline of that section")
    row: int | None = key("of the file")


class HitsRecord(Saved):
    """Hits of the bare wall, and their instruments."""

    setups: list[HitSetupUsed] = key("in the order of their hits")
    shared: list[SharedByHits] = key("offsets and scales of the instruments")
    rings: list[RingOfHits] = key("from the bottom up")
    incidence: list[IncidenceClass] = key("histogram")
    control: list[ControlRead] = key("readings of control targets, in the order of time")
    drifts: list[DriftOfSetup] = key("of set-ups that read control targets")
    compared: list[ComparedHit] = key("hits with use = check")


def save_hits(result):
    """Return the `HitsRecord` of a result."""
    from tankcal.methods.hits.warnings import drifts_of, repeats_of

    repeats = repeats_of(result.job.hits.control)
    certificates = {name: tool.certificate for name, tool in result.job.hits.instruments.items()}
    return HitsRecord(
        setups=setups_used(result.job.hits, result.sighting.poses, _mask_of_used(result)),
        shared=shared_of(result.sighting.estimates, certificates, result.sighting.estimated_m),
        rings=_rings(result),
        incidence=incidence_classes(result.sighting.incidence_rad),
        control=_control_readings(repeats),
        drifts=[
            DriftOfSetup(
                setup=drift.setup,
                hours=drift.hours,
                direction_rad_h=HOUR_S * drift.direction_rad_s,
                zenith_rad_h=HOUR_S * drift.zenith_rad_s,
            )
            for drift in drifts_of(repeats)
        ],
        compared=_compare_hits(result),
    )


def _mask_of_used(result):
    """Mask (n,) of the hits on the accepted points of the wall."""
    measured = np.flatnonzero(~result.job.hits.check)  # in the order of the job's points
    is_used = np.zeros(len(result.job.hits.check), dtype=bool)
    accepted = result.wall.accepted
    is_used[measured[accepted[accepted < len(measured)]]] = True  # targets come after the hits
    return is_used


def setups_used(hits, poses, is_used):
    """`HitSetupUsed` of each set-up; `is_used` (n,) is the mask of the accepted hits."""
    setup = np.array(hits.setup)
    first = {}
    for index, (name, _) in enumerate(poses.keys):
        first.setdefault(name, index)
    rows = []
    for name, index in first.items():
        declared, is_here = hits.setups[name], setup == name
        x_m, y_m, z_m = poses.xyz_m[index].tolist()
        rows.append(
            HitSetupUsed(
                setup=name,
                station=declared.station,
                instrument=declared.instrument,
                certificate=hits.instruments[declared.instrument].certificate,
                x_m=x_m,
                y_m=y_m,
                z_m=z_m,
                tie=poses.ties[index],
                hits=np.count_nonzero(is_here & is_used),
                rejected=np.count_nonzero(is_here & ~hits.check & ~is_used),
                checks=np.count_nonzero(is_here & hits.check),
            )
        )
    return rows


def _rings(result):
    """Return `RingOfHits` of each section."""
    from tankcal.methods.hits.warnings import least_hits

    job, wall = result.job, result.wall
    least, count = least_hits(job), np.count_nonzero(~job.hits.check)
    heights = np.array([section.group.height_m for section in wall.sections])
    z = job.points.xyz_m[:count][~wall.shell.on_wall[:count], 2] - job.datum.bottom_z_m
    nearest = np.argmin(np.abs(z[:, None] - heights), axis=1) if len(z) else np.zeros(0, dtype=int)
    rejected = np.bincount(nearest, minlength=len(heights))
    return [
        RingOfHits(
            section=section.group.name,
            course=job.courses[section.group.course].name,
            level_m=section.group.height_m - result.zero_m,
            hits=np.count_nonzero(wall.accepted[section.group.members] < count),
            rejected=rejected[index],
            least=least,
        )
        for index, section in enumerate(wall.sections)
    ]


def incidence_classes(incidence_rad):
    """Histogram of angles of incidence, up to the last class with hits."""
    edges = np.arange(0, LAST_DEG + 1, CLASS_DEG)
    counts = np.histogram(np.degrees(incidence_rad), edges)[0]
    last = np.flatnonzero(counts)[-1] + 1
    return [
        IncidenceClass(low_deg=float(low), high_deg=float(low + CLASS_DEG), hits=count)
        for low, count in zip(edges[:last], counts[:last], strict=True)
    ]


def _control_readings(repeats):
    return [
        ControlRead(
            setup=repeat.setup,
            target=repeat.target,
            elapsed_h=repeat.elapsed_s[i] / HOUR_S,
            direction_rad=repeat.direction_rad[i],
            zenith_rad=repeat.zenith_rad[i],
            distance_m=repeat.distance_m[i],
            row=repeat.rows[i],
        )
        for repeat in repeats
        for i in range(len(repeat.rows))
    ]


def _compare_hits(result):
    """Return `ComparedHit` of each hit that is only compared."""
    job, sighting, rows = result.job, result.sighting, []
    for index in np.flatnonzero(job.hits.check):
        section, departure_m = departure_from_sections(result, sighting.points.xyz_m[index])
        rows.append(
            ComparedHit(
                setup=job.hits.setup[index],
                section=section.group.name,
                departure_m=departure_m,
                row=job.hits.rows[index] if job.hits.rows else None,
            )
        )
    return rows


# ---- tables of hits

_SECTION = Column("section", sheet="section", width=10)
_COUNTS = counts_of("hits")

SETUPS = Table(
    "hit_setups",
    (
        *PLACE,
        Column("tie", words="ties_of_setups", heading="hit_tie", sheet="hit_tie", width=16),
        *_COUNTS,
        CHECKS,
    ),
    rows=lambda record: record["hits"]["setups"],
)  # fmt: skip

SHARED = table.SHARED  # also the basis of a table of clouds

RINGS = Table(
    "hit_rings",
    (
        _SECTION,
        COURSE,
        LEVEL,
        *_COUNTS,
        LEAST,
    ),
    rows=lambda record: record["hits"]["rings"],
)  # fmt: skip

INCIDENCE = Table(
    "hit_incidence",
    (
        Column("low_deg", decimals=0, heading="incidence_low", sheet="incidence_low_deg"),
        Column("high_deg", decimals=0, heading="incidence_high", sheet="incidence_high_deg"),
        Column("hits", decimals=0, heading="hits_read", sheet="hits_read"),
    ),
    rows=lambda record: record["hits"]["incidence"],
)  # fmt: skip

CONTROL = Table(
    "hit_control",
    (
        SETUP,
        Column("target", heading="hit_target", sheet="hit_target", width=10),
        Column("elapsed_h", decimals=2, heading="control_hours", sheet="control_hours"),
        Column("direction_rad", "rad arcsec", decimals=1, heading="control_direction",
               sheet="control_direction_arcsec"),
        Column("zenith_rad", "rad arcsec", decimals=1, heading="control_zenith",
               sheet="control_zenith_arcsec"),
        Column("distance_m", "mm", decimals=1, heading="control_distance",
               sheet="control_distance_mm"),
    ),
    rows=lambda record: record["hits"]["control"],
)  # fmt: skip

DRIFTS = Table(
    "hit_drifts",
    (
        SETUP,
        Column("hours", decimals=2, heading="drift_hours", sheet="drift_hours"),
        Column("direction_rad_h", "rad arcsec", decimals=2, heading="drift_direction",
               sheet="drift_direction_arcsec"),
        Column("zenith_rad_h", "rad arcsec", decimals=2, heading="drift_zenith",
               sheet="drift_zenith_arcsec"),
    ),
    rows=lambda record: record["hits"]["drifts"],
)  # fmt: skip

COMPARED = Table(
    "hit_compared",
    (
        SETUP,
        ROW,
        _SECTION,
        DEPARTURE,
    ),
    rows=lambda record: record["hits"]["compared"],
)  # fmt: skip
