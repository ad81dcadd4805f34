"""Saved part of wall hits: set-ups, instruments, rings, control targets."""

import numpy as np

from tankcal.record.ranging import SharedByHits, departure_from_sections, shared_of
from tankcal.record.schema import Finite, Saved, key
from tankcal.survey.control_drift import HOUR_S, drifts_of, repeats_of

CLASS_DEG, LAST_DEG = 10, 90  # of the histogram of incidence


class HitSetupUsed(Saved):
    """A set-up that the wall was hit from."""

    setup: str = key("name")
    station: str = key("that it stood over")
    instrument: str = key("name")
    certificate: str = key('of the instrument; "": not given')
    x_m: Finite = key("where its axes cross, in the survey's frame")
    y_m: Finite = key("the same")
    z_m: Finite = key("the same")
    tie: str = key('"network", "frame" (it is the frame itself) or "wall" (nothing else)')
    hits: int = key("adjusted and not rejected")
    rejected: int = key("hits that are not of the wall, or contradict it")
    checks: int = key("hits that are only compared")


class RingOfHits(Saved):
    """The hits of a section."""

    section: str = key("name")
    course: str = key("that it is on")
    level_m: float = key("mean height above the table's zero")
    hits: int = key("that the wall was taken from")
    rejected: int = key("nearest to it of those that were not")
    least: int = key("that the rule file asks for of this circumference")


class IncidenceClass(Saved):
    """Hits that meet the wall under like angles."""

    low_deg: float = key("from the wall's normal")
    high_deg: float = key("the same")
    hits: int = key("all that were read")


class ControlRead(Saved):
    """A reading of a control target, less the first one."""

    setup: str = key("name")
    target: str = key("name")
    elapsed_h: float = key("since the first control reading of the set-up")
    direction_rad: float | None = key("less that of the first reading; null: not read")
    zenith_rad: float | None = key("the same")
    distance_m: float | None = key("the same")
    row: int | None = key("of the file")


class DriftOfSetup(Saved):
    """How a set-up drifted, by all its control targets; not taken off the hits."""

    setup: str = key("name")
    hours: float = key("between its first and its last control reading")
    direction_rad_h: float | None = key("of the zero of its circle, per hour; null: not told")
    zenith_rad_h: float | None = key("of its zenith angles, per hour; null: not told")


class ComparedHit(Saved):
    """A hit that was only compared with the wall."""

    setup: str = key("name")
    section: str = key("nearest to it in its course")
    departure_m: float = key("outwards, from the outline of that section")
    row: int | None = key("of the file")


class HitsRecord(Saved):
    """Bare hits of the wall, and what took them."""

    setups: list[HitSetupUsed] = key("in the order of their hits")
    shared: list[SharedByHits] = key("offsets and scales of the instruments")
    rings: list[RingOfHits] = key("from the bottom up")
    incidence: list[IncidenceClass] = key("histogram")
    control: list[ControlRead] = key("readings of control targets, in the order of their time")
    drifts: list[DriftOfSetup] = key("of set-ups that read control targets")
    compared: list[ComparedHit] = key("hits with use = check")


def save_hits(result):
    """`HitsRecord` of a result."""
    repeats = repeats_of(result.job.hits.control)
    return HitsRecord(
        setups=_setups(result),
        shared=shared_of(
            result.sighting.told,
            {name: tool.certificate for name, tool in result.job.hits.instruments.items()},
            result.sighting.told_m,
        ),
        rings=_rings(result),
        incidence=_incidence(result.sighting),
        control=_control(repeats),
        drifts=[
            DriftOfSetup(
                setup=one.setup,
                hours=one.hours,
                direction_rad_h=HOUR_S * one.direction_rad_s,
                zenith_rad_h=HOUR_S * one.zenith_rad_s,
            )
            for one in drifts_of(repeats)
        ],
        compared=_compared(result),
    )


def _setups(result):
    hits, poses = result.job.hits, result.sighting.poses
    setup = np.array(hits.setup)
    counted = setup[~hits.check]  # the order of the job's points
    used = np.zeros(len(counted), dtype=bool)
    accepted = result.wall.accepted
    used[accepted[accepted < len(counted)]] = True  # targets come after the hits
    found, first = [], {}
    for place, (name, _) in enumerate(poses.keys):
        first.setdefault(name, place)
    for name, place in first.items():
        given, mine = hits.setups[name], counted == name
        found.append(
            HitSetupUsed(
                setup=name,
                station=given.station,
                instrument=given.instrument,
                certificate=hits.instruments[given.instrument].certificate,
                **dict(zip(("x_m", "y_m", "z_m"), poses.xyz_m[place].tolist(), strict=True)),
                tie=poses.ties[place],
                hits=np.count_nonzero(mine & used),
                rejected=np.count_nonzero(mine & ~used),
                checks=np.count_nonzero((setup == name) & hits.check),
            )
        )
    return found


def _rings(result):
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
            rejected=rejected[place],
            least=least,
        )
        for place, section in enumerate(wall.sections)
    ]


def _incidence(sighting):
    edges = np.arange(0, LAST_DEG + 1, CLASS_DEG)
    counts = np.histogram(np.degrees(sighting.incidence_rad), edges)[0]
    last = np.flatnonzero(counts)[-1] + 1
    return [
        IncidenceClass(low_deg=float(low), high_deg=float(low + CLASS_DEG), hits=count)
        for low, count in zip(edges[:last], counts[:last], strict=True)
    ]


def _control(repeats):
    return [
        ControlRead(
            setup=one.setup,
            target=one.target,
            elapsed_h=one.elapsed_s[i] / HOUR_S,
            direction_rad=one.direction_rad[i],
            zenith_rad=one.zenith_rad[i],
            distance_m=one.distance_m[i],
            row=one.rows[i],
        )
        for one in repeats
        for i in range(len(one.rows))
    ]


def _compared(result):
    job, sighting, found = result.job, result.sighting, []
    for place in np.flatnonzero(job.hits.check):
        section, departure = departure_from_sections(result, sighting.points.xyz_m[place])
        found.append(
            ComparedHit(
                setup=job.hits.setup[place],
                section=section.group.name,
                departure_m=departure,
                row=job.hits.rows[place] if job.hits.rows else None,
            )
        )
    return found
