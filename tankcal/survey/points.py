"""Surveyed points of a wall: read from a file, or adjusted from a survey."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Points:
    """Surveyed points, in the order of the file.

    Attributes
    ----------
    names, rows : tuple
        Text, and row of each in its file, for messages.
    xyz_m : ndarray, shape (n, 3)
        Coordinates.
    sd_m : ndarray, shape (n, 3), or None
        Standard deviations; None: not given (estimated from residuals).
    covariance_m2 : ndarray, shape (3n, 3n), or None
        None: not given.
    section, generatrix : tuple
        Given name of each, text or None.
    causes : tuple
        Named causes that the covariance contains (`survey.results.Cause`): covariance = the rest +
        sum of column column', their columns over the coordinates of these points.
    from_adjustment : bool
        True: adjusted from a survey; the covariance has the scale that it should have.
    unbound : tuple
        Causes that nothing has told yet (a free offset): not in the covariance, their columns are
        derivatives.
    by_inputs : dict
        {input of an uncertainty budget: (3n,) derivative of the coordinates by it}.
    file : str
        Where messages say they come from; "": of the rows.
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
