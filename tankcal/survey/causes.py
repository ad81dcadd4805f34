"""Shared causes of uncertainty: effect of one standard uncertainty of an instrument on all points.

A scale or an offset with an a priori value and standard deviation is a weighted unknown. A shift of
that value by one standard deviation changes all adjusted coordinates by a column c. The
contribution to their covariance is c c'. Source: JCGM 100, 5.2; Koch 1999, section 3.2.
"""

import numpy as np

from tankcal.survey.results import Cause


def causes_of(adjusted, points, cov_scale):
    """Return the shared causes of the coordinates of selected points.

    Parameters
    ----------
    adjusted : network.Adjusted
    points : array_like of int, shape (k,)
        Numbers of the points.
    cov_scale : float
        Variance factor of the covariances.

    Returns
    -------
    tuple of Cause
        Instruments without effect on the points are omitted.
    """
    causes = []
    for i, tool in enumerate(adjusted.survey.instruments):
        for what, parameter, sd, factor, unit in (
            ("instrument_scale", "scale", tool.scale_sd, 1e6, "ppm"),
            ("instrument_offset", "offset_m", tool.offset_sd_m, 1e3, "mm"),
        ):
            if sd > 0:
                moves = adjusted.effect_of_known_m(parameter, i).reshape(-1, 3)[np.asarray(points)]
                # Covariances carry the factor cov_scale, so a column carries its root.
                change = np.sqrt(cov_scale) * moves.ravel()
                if change.any():
                    causes.append(Cause(tool.name, what, factor * sd, unit, change))
    return tuple(causes)
