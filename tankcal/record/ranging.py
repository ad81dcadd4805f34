"""Saved errors of instruments that range on the wall, and departures of single sights from it."""

import numpy as np

from tankcal.record.schema import Saved, key


class SharedByHits(Saved):
    """An offset or a scale that all hits of an instrument share."""

    instrument: str = key("name")
    certificate: str = key('its number; "": not given')
    what: str = key('"instrument_offset" or "instrument_scale"')
    unit: str = key('"mm" or "ppm"')
    u_before: float | None = key("standard uncertainty as declared; null: nothing was known")
    value: float = key("by how much more than its correction it comes out with the wall")
    u_after: float = key("standard uncertainty after that")
    correlation: float = key("with the mean radius of the tank; near 1: nothing tells them apart")


def shared_of(told, certificates, told_m):
    """`SharedByHits` of causes that a wall told.

    certificates  {instrument: number}
    told_m        {instrument: what was taken off its readings before}, m
    """
    found = []
    for one in told:
        is_offset = one.what == "instrument_offset"
        unit, per = ("mm", 1e3) if is_offset else ("ppm", 1e6)
        taken_off = told_m.get(one.name, 0.0) if is_offset else 0.0
        found.append(
            SharedByHits(
                instrument=one.name,
                certificate=certificates.get(one.name, ""),
                what=one.what,
                unit=unit,
                u_before=per * one.u_before,
                value=per * (one.value + taken_off),
                u_after=per * one.u_after,
                correlation=one.correlation,
            )
        )
    return found


def departure_from_sections(result, xyz_m):
    """The section nearest to a place (3,), and how far outwards from its outline that lies, m."""
    height = xyz_m[2] - result.job.datum.bottom_z_m
    section = min(result.wall.sections, key=lambda one: abs(one.group.height_m - height))
    outline, slope = section.outline, np.array(result.wall.shell.slope)
    away = xyz_m[:2] - (height - section.group.height_m) * slope - (outline.x_m, outline.y_m)
    return section, np.hypot(*away) - outline.radius_m(np.array([np.arctan2(*away)]))[0]
