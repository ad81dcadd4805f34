"""Observations that are correlated with one another: they enter the adjustment as one.

Values l with the covariance Q = L L' are whitened together: L^-1 (computed - observed) has the
covariance I, and so have the rows that the solver sees. Source: Koch 1999, section 3.2.
"""

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg

from tankcal.survey.observations.base import Observations


@dataclass(frozen=True)
class Block:
    """Values of a survey that are correlated.

    Attributes
    ----------
    source, row, component : ndarray, shape (m,)
        Number of their table in Survey.observations, row there, value.
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
        Tuple of (observations of one kind, (k,) component of each), m in all.
    covariance : ndarray, shape (m, m)
    all_of
        Layout in which every unknown, also what is fixed, has a number of its own.
    """

    parts: tuple
    covariance: np.ndarray
    all_of: object = field(repr=False)

    kind, shared = "correlated observations", ("covariance",)

    def __post_init__(self):
        slots = [one.columns(self.all_of) for one, _ in self.parts]
        _, first, place = np.unique(
            np.concatenate([part.ravel() for part in slots]), return_index=True, return_inverse=True
        )
        cuts = np.cumsum([part.size for part in slots])[:-1]
        places = [
            mine.reshape(part.shape)
            for mine, part in zip(np.split(place.ravel(), cuts), slots, strict=True)
        ]
        object.__setattr__(self, "_first", first)
        object.__setattr__(self, "_places", places)
        object.__setattr__(self, "_root", np.linalg.cholesky(self.covariance))

    @property
    def rows(self):
        """m."""
        return len(self.covariance)

    def columns(self, layout):
        """(1, K) column of each unknown that some of the values speak of."""
        columns = [one.columns(layout).ravel() for one, _ in self.parts]
        return np.concatenate(columns)[self._first][None]

    def whitened(self, values):
        """L^-1 times values (m, ...)."""
        return scipy.linalg.solve_triangular(self._root, values, lower=True)

    def linearised(self, state):
        """Misclosures (m,) and derivatives (m, K), not whitened."""
        off, jac = [], []
        for (one, component), places in zip(self.parts, self._places, strict=True):
            rows = np.arange(len(one))
            computed, derivatives = one.computed(state, True)
            off.append(one.difference(computed)[rows, component])
            found = np.zeros((len(one), len(self._first)))
            np.add.at(found, (rows[:, None], places), derivatives[rows, component])
            jac.append(found)
        return np.concatenate(off), np.vstack(jac)

    def fill(self, state, w, jac):
        """Whitened misclosures into w (1, m), derivatives into jac (1, m, K) unless it is empty."""
        off, derivatives = self.linearised(state)
        w[0] = self.whitened(off)
        if len(jac):
            jac[0] = self.whitened(derivatives)
