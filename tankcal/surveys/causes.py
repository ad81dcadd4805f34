"""Shared causes of uncertainty: what one standard uncertainty of an instrument does to all points.

A scale or an offset with an a-priori value and sd s is a weighted unknown. Shifting that value by
one s changes all adjusted unknowns by

    Q A' P s = Q e_k / s

with the column Q e_k of the cofactor matrix: the part of the covariance that comes from it is the
product of this column with itself. Source: JCGM 100, 5.2; Koch 1999, section 3.2.
"""

import numpy as np

from tankcal.surveys.results import Cause

TOGETHER = 900  # coordinates whose cofactors with the causes are asked for at once


def causes_of(adjusted, points, cov_scale):
    """A tuple of Cause over the coordinates of points (k,), scaled like the covariances."""
    layout = adjusted.problem.layout
    named = []
    for i, tool in enumerate(adjusted.survey.instruments):
        for what, columns, sd, factor, unit in (
            ("instrument_scale", layout.scale, tool.scale_sd, 1e6, "ppm"),
            ("instrument_offset", layout.offset, tool.offset_sd_m, 1e3, "mm"),
        ):
            if columns[i] >= 0 and sd > 0:
                named.append((tool.name, what, sd, factor * sd, unit, int(columns[i])))
    if not named:
        return ()
    wanted = np.array([one[-1] for one in named])
    coordinates = layout.points[np.asarray(points)].ravel()
    moves = np.zeros((len(coordinates), len(named)))
    free = np.flatnonzero(coordinates >= 0)
    for part in np.array_split(free, max(1, -(-len(free) // TOGETHER))):
        q = adjusted.solution.cofactors(np.concatenate([coordinates[part], wanted]))
        moves[part] = q[: len(part), len(part) :]
    return tuple(
        Cause(name, what, u, unit, np.sqrt(cov_scale) * moves[:, k] / sd)
        for k, (name, what, sd, u, unit, _) in enumerate(named)
    )
