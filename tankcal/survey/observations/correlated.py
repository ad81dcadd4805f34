"""Correlated observations, which enter the adjustment as a single observation.

Values l with covariance Q = L L' are whitened together: L^-1 (computed - observed) has covariance
I, as have the rows in the solver. Source: Koch 1999, section 3.2.
"""

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg

from tankcal.survey.observations.base import Observations


@dataclass(frozen=True)
class Block:
    """Correlated values of a survey.

    Attributes
    ----------
    source, row, component : ndarray, shape (m,)
        Number of the table in Survey.observations, row, and value in the row.
    covariance : ndarray, shape (m, m)
    """

    source: np.ndarray
    row: np.ndarray
    component: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True)
class Correlated(Observations):
    """One observation of m correlated values; value and sd (1, m) are zeros and ones.

    Attributes
    ----------
    parts : tuple
        Pairs (observations of one kind, component (k,) of each), m in all.
    covariance : ndarray, shape (m, m)
    all_of : Layout
        Layout in which each unknown, fixed or not, has its own number.
    """

    parts: tuple
    covariance: np.ndarray
    all_of: object = field(repr=False)

    kind, shared = "correlated observations", ("covariance",)

    def __post_init__(self):
        slots = [observations.columns(self.all_of) for observations, _ in self.parts]
        # Several values share unknowns: each unknown has one column in the block.
        _, first, place = np.unique(
            np.concatenate([part.ravel() for part in slots]), return_index=True, return_inverse=True
        )
        cuts = np.cumsum([part.size for part in slots])[:-1]
        places = [
            places_of_part.reshape(part.shape)
            for places_of_part, part in zip(np.split(place.ravel(), cuts), slots, strict=True)
        ]
        object.__setattr__(self, "_first", first)
        object.__setattr__(self, "_places", places)
        object.__setattr__(self, "_root", np.linalg.cholesky(self.covariance))

    @property
    def rows(self):
        """Number of values, m."""
        return len(self.covariance)

    def columns(self, layout):
        """Columns (1, K) of the unknowns of all values."""
        columns = [observations.columns(layout).ravel() for observations, _ in self.parts]
        return np.concatenate(columns)[self._first][None]

    def whitened(self, values):
        """L^-1 times values (m, ...)."""
        # Solving with L is more accurate than multiplying by its inverse.
        return scipy.linalg.solve_triangular(self._root, values, lower=True)

    def linearised(self, state):
        """Misclosures (m,) and derivatives (m, K), not whitened."""
        off, jac = [], []
        for (observations, component), places in zip(self.parts, self._places, strict=True):
            rows = np.arange(len(observations))
            computed, derivatives = observations.computed(state, True)
            off.append(observations.difference(computed)[rows, component])
            rows_of_part = np.zeros((len(observations), len(self._first)))
            np.add.at(rows_of_part, (rows[:, None], places), derivatives[rows, component])
            jac.append(rows_of_part)
        return np.concatenate(off), np.vstack(jac)

    def fill(self, state, w, jac):
        """Write whitened misclosures to w (1, m) and derivatives to jac (1, m, K) unless it is
        empty."""
        off, derivatives = self.linearised(state)
        w[0] = self.whitened(off)
        if len(jac):
            jac[0] = self.whitened(derivatives)
