"""Saved errors of instruments that range on the wall, and distances of single sights from it."""

import numpy as np

from tankcal.record.schema import Saved, key


class SharedByHits(Saved):
    """An offset or a scale common to all hits of an instrument."""

    instrument: str = key("name")
    certificate: str = key('its number; "": not given')
    what: str = key('"instrument_offset" or "instrument_scale"')
    unit: str = key('"mm" or "ppm"')
    u_before: float | None = key("standard uncertainty as declared; null: unknown")
    value: float = key("estimate with the wall less the correction of the instrument")
    u_after: float = key("standard uncertainty of the estimate")
    correlation: float = key("with the mean radius of the tank; near 1: not separable")


def shared_of(estimates, certificates, corrections_m):
    """Return the `SharedByHits` of errors that a wall determines.

    Parameters
    ----------
    estimates : iterable
        Common errors of the instruments with their values and uncertainties.
    certificates : dict
        {instrument: number of its certificate}.
    corrections_m : dict
        {instrument: offset already subtracted from its readings, m}.

    Returns
    -------
    list of SharedByHits
    """
    rows = []
    for estimate in estimates:
        is_offset = estimate.what == "instrument_offset"
        unit, factor = ("mm", 1e3) if is_offset else ("ppm", 1e6)
        correction = corrections_m.get(estimate.name, 0.0) if is_offset else 0.0
        rows.append(
            SharedByHits(
                instrument=estimate.name,
                certificate=certificates.get(estimate.name, ""),
                what=estimate.what,
                unit=unit,
                u_before=factor * estimate.u_before,
                value=factor * (estimate.value + correction),
                u_after=factor * estimate.u_after,
                correlation=estimate.correlation,
            )
        )
    return rows


def departure_from_sections(result, xyz_m):
    """Return the section nearest to a position (3,), and the distance from its outline, m.

    The distance is positive outwards.
    """
    height = xyz_m[2] - result.job.datum.bottom_z_m
    section = min(
        result.wall.sections, key=lambda candidate: abs(candidate.group.height_m - height)
    )
    outline, slope = section.outline, np.array(result.wall.shell.slope)
    # The position is shifted along the axis to the height of the section.
    offset = xyz_m[:2] - (height - section.group.height_m) * slope - (outline.x_m, outline.y_m)
    return section, np.hypot(*offset) - outline.radius_m(np.array([np.arctan2(*offset)]))[0]
