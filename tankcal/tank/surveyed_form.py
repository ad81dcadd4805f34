"""Form of a surveyed wall about a solid: its height, and its volume at every level.

A wall is not exactly a cylinder or sphere. T is the height of the solid, and V are its volumes. H
is the height of the surveyed wall, from the bottom at the dip to the top. The volumes of the wall
are

    W(d) = V(d T / H) (1 + share + g(t) (1 + cos t)^1.5),   d = H (1 - cos t) / 2,

where g is a spline through levels equally spaced in t. W is full where the wall is full, and
equally smooth.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

NODES = 49  # number of levels from empty to full
MOST_BEND = 0.14  # bound of |g|: at the bottom (1 + cos t)^1.5 is 2.8, and a groove may be large
LEAST_TURN = 1e-4  # distance in t from the ends, where the derivative is indeterminate


def node_turns():
    """Return t (NODES,) of the levels of a form."""
    return np.linspace(0.0, np.pi, NODES)


def node_levels(height_m):
    """Return the levels (NODES,) of a solid of a given height."""
    return height_m * (1 - np.cos(node_turns())) / 2


@dataclass(frozen=True)
class SurveyedForm:
    """Form of a wall about the solid fitted to it.

    Attributes
    ----------
    stretch : float
        Ratio of the height of the wall to that of the solid.
    share : float
        Relative excess of the volume of the full wall over that of the solid.
    bend : ndarray, shape (NODES,)
        g at the nodes.
    factors : tuple of body.Factor
        Uncertainty of the volumes at the nodes after the survey, m3.
    """

    stretch: float
    share: float
    bend: np.ndarray
    factors: tuple

    @classmethod
    def of_volumes(cls, volume_m3, area_m2, height_m, added_m3, added_height_m, factors):
        """Return the form of a wall with given additional volumes and additional height.

        Parameters
        ----------
        volume_m3, area_m2 : ndarray, shape (NODES,)
            Volumes and areas of the solid at its nodes.
        height_m : float
            Height of the solid.
        added_m3 : ndarray, shape (NODES,)
            Additional volumes due to the departures of the wall, at equal dips.
        added_height_m : float
            Additional height due to the departures.
        factors : tuple of body.Factor
        """
        stretch = 1 + added_height_m / height_m
        rise_m = node_levels(height_m) * (stretch - 1)
        # The nodes of the wall are higher by `risen`: add the volume between to compare at equal
        # shares.
        additional_m3 = added_m3 + area_m2 * rise_m
        share = additional_m3[-1] / volume_m3[-1]
        size = volume_m3 * (1 + np.cos(node_turns())) ** 1.5
        bend = np.zeros(NODES)
        bend[1:-1] = (additional_m3 - share * volume_m3)[1:-1] / size[1:-1]
        bend = np.clip(bend, -MOST_BEND, MOST_BEND)
        # g is 0 / 0 at the ends: continue with the neighbouring values.
        bend[0], bend[-1] = bend[1], bend[-2]
        return cls(float(stretch), float(share), bend, factors)

    def factor(self, level_share):
        """Return W over V (rows,) at levels given as fractions of the height."""
        turn = _turn(level_share)
        return 1 + self.share + self._bend(turn) * (1 + np.cos(turn)) ** 1.5

    def factor_slope(self, level_share):
        """Return the derivative (rows,) of `factor` by the fraction of the height."""
        turn = np.clip(_turn(level_share), LEAST_TURN, np.pi - LEAST_TURN)
        fall, rise = (1 + np.cos(turn)) ** 0.5, np.sin(turn)
        by_turn = self._bend(turn, 1) * fall**3 - 1.5 * self._bend(turn) * fall * rise
        # share = (1 - cos t) / 2, so dt/dshare = 2 / sin t.
        return 2 * by_turn / rise

    def at(self, level_share):
        """Return the weights (rows, NODES) of values at the nodes for values at levels."""
        return scipy.interpolate.CubicSpline(node_turns(), np.eye(NODES))(_turn(level_share))

    @cached_property
    def _bend(self):
        return scipy.interpolate.CubicSpline(
            node_turns(), self.bend, bc_type=((1, 0.0), "not-a-knot")
        )


def _turn(level_share):
    """Return t of fractions of the height."""
    return np.arccos(1 - 2 * np.clip(level_share, 0.0, 1.0))
