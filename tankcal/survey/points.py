"""Surveyed points of a wall: read from a file, or adjusted from a survey."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Points:
    """Surveyed points, in the order of the file.

    Attributes
    ----------
    names, rows : tuple
        Name of each point, and its row in the file for messages.
    xyz_m : ndarray, shape (n, 3)
        Coordinates.
    sd_m : ndarray, shape (n, 3), or None
        Standard deviations; None: not given (estimated from residuals).
    covariance_m2 : ndarray, shape (3n, 3n), or None
        None: not given.
    section, generatrix : tuple
        Section and generatrix of each point, text or None.
    causes : tuple
        Named causes contained in the covariance (`survey.results.Cause`), with columns over the
        coordinates of these points: covariance = remainder + sum of column column'.
    from_adjustment : bool
        True: adjusted from a survey; the covariance has its final scale.
    unbound : tuple
        Causes without an estimate (a free offset). They are not in the covariance; their columns
        are derivatives.
    by_inputs : dict
        {input of an uncertainty budget: (3n,) derivative of the coordinates}.
    file : str
        Source of the points in messages; "": the file of the rows.
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
