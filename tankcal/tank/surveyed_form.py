"""What the form of a surveyed wall adds to a solid: its height, and its volume at every level.

A wall is no true cylinder or sphere. With T the height of the solid, H that of the surveyed wall
from the bottom at the dip to the top, and V the volumes of the solid, those of the wall are

    W(d) = V(d T / H) (1 + share + g(t) (1 + cos t)^1.5),   d = H (1 - cos t) / 2,

which fills up where the wall does, and as smoothly; g is a spline through levels even in t.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

NODES = 49  # levels from empty to full
MOST_BEND = 0.14  # of g: at the bottom (1 + cos t)^1.5 is 2.8, and a narrow groove no small change
LEAST_TURN = 1e-4  # next to the ends, where the derivative is taken beside them


def node_turns():
    """(NODES,) t of the levels that a form is stated at."""
    return np.linspace(0.0, np.pi, NODES)


def node_levels(height_m):
    """(NODES,) these levels of a solid of some height."""
    return height_m * (1 - np.cos(node_turns())) / 2


@dataclass(frozen=True)
class SurveyedForm:
    """The form of a wall about the solid that was fitted to it.

    Attributes
    ----------
    stretch : float
        Height of the wall over that of the solid.
    share : float
        Of the solid's volume that the full wall holds more.
    bend : ndarray, shape (NODES,)
        g at the nodes.
    factors : tuple of body.Factor
        What the survey leaves uncertain about the volumes at the nodes, m3.
    """

    stretch: float
    share: float
    bend: np.ndarray
    factors: tuple

    @classmethod
    def of_volumes(cls, volume_m3, area_m2, height_m, added_m3, added_height_m, factors):
        """The form of a wall that adds volumes at the nodes of a solid, and a height.

        Parameters
        ----------
        volume_m3, area_m2 : ndarray, shape (NODES,)
            Of the solid at its nodes.
        height_m : float
            Of the solid.
        added_m3 : ndarray, shape (NODES,)
            By the departures of the wall, at the same dips.
        added_height_m : float
            By them.
        factors : tuple of body.Factor
        """
        stretch = 1 + added_height_m / height_m
        risen = node_levels(height_m) * (stretch - 1)
        rest = added_m3 + area_m2 * risen
        share = rest[-1] / volume_m3[-1]
        size = volume_m3 * (1 + np.cos(node_turns())) ** 1.5
        bend = np.zeros(NODES)
        bend[1:-1] = (rest - share * volume_m3)[1:-1] / size[1:-1]
        bend = np.clip(bend, -MOST_BEND, MOST_BEND)
        bend[0], bend[-1] = bend[1], bend[-2]
        return cls(float(stretch), float(share), bend, factors)

    def factor(self, level_share):
        """(rows,) W over V at levels that are these shares of the height."""
        turn = _turn(level_share)
        return 1 + self.share + self._bend(turn) * (1 + np.cos(turn)) ** 1.5

    def factor_slope(self, level_share):
        """(rows,) derivative of `factor` by the share of the height."""
        turn = np.clip(_turn(level_share), LEAST_TURN, np.pi - LEAST_TURN)
        fall, rise = (1 + np.cos(turn)) ** 0.5, np.sin(turn)
        by_turn = self._bend(turn, 1) * fall**3 - 1.5 * self._bend(turn) * fall * rise
        return 2 * by_turn / rise

    def at(self, level_share):
        """(rows, NODES) weights by which values at the nodes make those at levels."""
        return _through_nodes()(_turn(level_share))

    @cached_property
    def _bend(self):
        return scipy.interpolate.CubicSpline(
            node_turns(), self.bend, bc_type=((1, 0.0), "not-a-knot")
        )


def _through_nodes():
    return scipy.interpolate.CubicSpline(node_turns(), np.eye(NODES))


def _turn(level_share):
    return np.arccos(1 - 2 * np.clip(level_share, 0.0, 1.0))
