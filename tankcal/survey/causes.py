"""Shared causes of uncertainty: what one standard uncertainty of an instrument does to all points.

A scale or an offset with an a-priori value and sd is a weighted unknown. Shifting that value by one
sd changes all adjusted coordinates by a column c: the part of their covariance that comes from it
is c c'. Source: JCGM 100, 5.2; Koch 1999, section 3.2.
"""

import numpy as np

from tankcal.survey.results import Cause


def causes_of(adjusted, points, cov_scale):
    """A tuple of Cause over the coordinates of points (k,), scaled like the covariances."""
    found = []
    for i, tool in enumerate(adjusted.survey.instruments):
        for what, of, sd, factor, unit in (
            ("instrument_scale", "scale", tool.scale_sd, 1e6, "ppm"),
            ("instrument_offset", "offset_m", tool.offset_sd_m, 1e3, "mm"),
        ):
            if sd > 0:
                moves = adjusted.effect_of_known_m(of, i).reshape(-1, 3)[np.asarray(points)]
                change = np.sqrt(cov_scale) * moves.ravel()
                if change.any():
                    found.append(Cause(tool.name, what, factor * sd, unit, change))
    return tuple(found)
