"""Unknowns that observations share besides points and photos: scales, offsets, orientations.

A further one needs a line in NUISANCES, its values and sds in `Survey.nuisances`, and a pair in
`nuisances` of each class of observations that it enters: its name here, and the field with the
number of each row's own one. Layout, State, start, names, sds known beforehand and the datum
follow from these.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Nuisance:
    """What a name of NUISANCES stands for.

    Attributes
    ----------
    element, unit : str
        As the user calls it.
    file : str
        In which its value and sd known beforehand stand.
    by_turn : float
        What it changes by when the whole survey turns by one rad about Z.
    is_scale : bool
        True: 1 + value is divided by what the whole survey is stretched by.
    """

    element: str
    unit: str
    file: str = ""
    by_turn: float = 0.0
    is_scale: bool = False

    def ways(self, value):
        """Derivatives (k, 7) of values (k,) by the seven ways of `network.datum`."""
        found = np.zeros((len(value), 7))
        found[:, 5] = self.by_turn
        if self.is_scale:
            found[:, 6] = -(1.0 + value)
        return found


NUISANCES = {
    "scale": Nuisance("scale", "", "instruments.toml", is_scale=True),
    "offset_m": Nuisance("offset", "m", "instruments.toml"),
    "orientation_rad": Nuisance("orientation", "rad", by_turn=-1.0),
}
