"""The inputs of a measurement, each once, and how they vary together (JCGM 100:2008 5.2, F.1.2).

An input that enters a model twice (one tape for diameter and height) is ONE input with one name;
a correlation is for estimates that were found together, such as coordinates of one adjustment.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from tankcal.gum.components import factor_of

_ROUNDING = 1e-9  # of a correlation: what two programs may differ by


@dataclass(frozen=True)
class Input:
    """One quantity that the model asks for.

    Attributes
    ----------
    name : str
    distribution : object
        Of its value, with `mean`, `u`, `u_dof` and `name` as those of `gum.distributions`; its mean
        is the estimate, in `unit`.
    unit : str
    type : str
        "A" of readings, "B" of other knowledge.
    family : str
        Name of the line of the budget that it is part of; "" for a line of its own.
    is_default : bool
        True when nobody declared it: the program's own assumption.
    note : str

    Raises
    ------
    ValueError
        For another type than "A" or "B".
    """

    name: str
    distribution: object
    unit: str = ""
    type: str = "B"
    family: str = ""
    is_default: bool = False
    note: str = ""

    def __post_init__(self):
        if self.type not in ("A", "B"):
            raise ValueError(f"{self.name}: type {self.type!r}, expected A or B")

    @property
    def line(self):
        """The line of the budget that it is part of."""
        return self.family or self.name


class Inputs:
    """Inputs in the order in which the model takes them, with their correlations.

    Parameters
    ----------
    inputs : sequence of Input, length n
        Their names all different.
    correlation : dict of {(str, str): float}, or ndarray of shape (n, n), optional
        r of the pairs that are correlated, or the whole matrix.

    Raises
    ------
    ValueError
        For names twice or unknown, |r| > 1, a matrix that is not symmetric, has no ones in its
        diagonal, or has a negative eigenvalue (named with its size).

    Examples
    --------
    >>> from tankcal.gum import standard
    >>> inputs = Inputs([Input("d", standard(0.002, mean=4.8)), Input("h", standard(0.001))])
    >>> inputs.names, inputs.u.tolist()
    (('d', 'h'), [0.002, 0.001])
    """

    def __init__(self, inputs, correlation=None):
        self.inputs = tuple(inputs)
        self.names = tuple(one.name for one in self.inputs)
        twice = sorted({name for name in self.names if self.names.count(name) > 1})
        if twice:
            raise ValueError(f"input given twice: {', '.join(twice)}; a shared input is one input")
        pairs = {} if correlation is None else correlation
        matrix = self._of_pairs(pairs) if isinstance(pairs, dict) else np.array(pairs, dtype=float)
        self.correlation = _checked(matrix, self.names)
        self.estimates = np.array([one.distribution.mean for one in self.inputs])
        self.u = np.array([one.distribution.u for one in self.inputs])
        self.dof = np.array([one.distribution.u_dof for one in self.inputs])

    def __len__(self):
        return len(self.inputs)

    def index(self, name):
        """Place of the input called `name`; raises ValueError when there is none."""
        if name not in self.names:
            raise ValueError(f"no input is called {name!r}: there are {', '.join(self.names)}")
        return self.names.index(name)

    @property
    def covariance(self):
        """(n, n) covariance of the inputs, u u' times the correlations."""
        return self.correlation * np.outer(self.u, self.u)

    @cached_property
    def groups(self):
        """Places of the inputs that are correlated with one another, one array a group."""
        from scipy.sparse.csgraph import connected_components  # loads the solvers, too

        count, label = connected_components(csr_array(self.correlation != 0), directed=False)
        return tuple(np.flatnonzero(label == i) for i in range(count))

    @cached_property
    def blocks(self):
        """For each group (p, c) factor of its covariance, c its rank: covariance = factor factor'.

        The groups stand by themselves, so no matrix of all inputs is decomposed.
        """
        return tuple(
            self.u[group, None] * factor_of(self.correlation[np.ix_(group, group)])
            if len(group) > 1
            else self.u[group, None]
            for group in self.groups
        )

    def _of_pairs(self, pairs):
        matrix = np.eye(len(self))
        for (one, other), r in pairs.items():
            i, j = self.index(one), self.index(other)
            if i == j or matrix[i, j]:
                raise ValueError(f"the correlation of {one} and {other} is given twice")
            matrix[i, j] = matrix[j, i] = r
        return matrix


def _checked(matrix, names):
    """The correlation matrix made exactly symmetric; raises ValueError as `Inputs` says."""
    if matrix.shape != (len(names), len(names)):
        raise ValueError(f"correlations {matrix.shape} of {len(names)} inputs")
    if not np.all(np.isfinite(matrix)):
        raise ValueError("a correlation is not a finite number")
    if np.abs(matrix - matrix.T).max(initial=0) > _ROUNDING:
        raise ValueError("the correlations are not symmetric")
    if np.abs(matrix.diagonal() - 1).max(initial=0) > _ROUNDING:
        raise ValueError("an input has another correlation than 1 with itself")
    if np.abs(matrix).max(initial=0) > 1 + _ROUNDING:
        i, j = np.unravel_index(np.abs(matrix).argmax(), matrix.shape)
        raise ValueError(f"correlation {matrix[i, j]:g} of {names[i]} and {names[j]}: beyond 1")
    smallest = np.linalg.eigvalsh(matrix)[0] if len(names) else 1.0
    if smallest < -_ROUNDING * len(names):
        raise ValueError(f"the correlations contradict one another: eigenvalue {smallest:.3g}")
    return (matrix + matrix.T) / 2
