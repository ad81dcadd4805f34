"""Unknowns shared by observations, besides points and photos: scales, offsets, orientations.

A further unknown requires a line in NUISANCES, values and sds in `Survey.nuisances`, and a pair in
`nuisances` of each class of observations that contains it: its name here, and the field with the
number for each row. Layout, State, start values, names, a priori sds and the datum follow from
these.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Nuisance:
    """Properties of a name of NUISANCES.

    Attributes
    ----------
    element, unit : str
        Name and unit in messages.
    file : str
        File of its a priori value and sd.
    by_turn : float
        Change per rad of a rotation of the whole survey about Z.
    is_scale : bool
        True: a scaling of the whole survey divides 1 + value.
    """

    element: str
    unit: str
    file: str = ""
    by_turn: float = 0.0
    is_scale: bool = False

    def ways(self, value):
        """Derivatives (k, 7) of values (k,) by the seven motions of `network.datum`."""
        derivatives = np.zeros((len(value), 7))
        derivatives[:, 5] = self.by_turn
        if self.is_scale:
            derivatives[:, 6] = -(1.0 + value)
        return derivatives


NUISANCES = {
    "scale": Nuisance("scale", "", "instruments.toml", is_scale=True),
    "offset_m": Nuisance("offset", "m", "instruments.toml"),
    "orientation_rad": Nuisance("orientation", "rad", by_turn=-1.0),
}
