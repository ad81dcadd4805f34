"""Surveyed points of a wall: read from a file, or adjusted from a survey."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Points:
    """Surveyed points, in the order of the file.

    names       (n,) text            rows        (n,) row of each in its file, for messages
    xyz_m       (n, 3) coordinates   covariance_m2  (3n, 3n), or None: not given
    sd_m        (n, 3) standard deviations, or None: not given (estimated from residuals)
    section     (n,) text or None: given section name
    generatrix  (n,) text or None
    causes      named causes that the covariance contains (`surveys.Cause`): covariance = the rest
                + sum of column column', their columns over the coordinates of these points
    from_adjustment  True: adjusted from a survey; the covariance has the scale that it should have
    unbound     causes that nothing has told yet (a free offset): not in the covariance, their
                columns are derivatives
    by_inputs   {input of an uncertainty budget: (3n,) derivative of the coordinates by it}
    file        where messages say they come from; "": of the rows
    """

    names: tuple
    xyz_m: np.ndarray
    sd_m: np.ndarray | None
    covariance_m2: np.ndarray | None
    section: tuple
    generatrix: tuple
    rows: tuple
    causes: tuple = ()
    from_adjustment: bool = False
    unbound: tuple = ()
    by_inputs: dict = field(default_factory=dict)
    file: str = ""
