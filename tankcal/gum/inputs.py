"""Inputs of a measurement and their correlations (JCGM 100:2008 5.2, F.1.2).

A quantity that enters a model twice (one tape for diameter and height) is a single input with one
name. A correlation describes estimates from a joint evaluation, such as coordinates of one
adjustment.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from tankcal.gum.components import factor_of

_ROUNDING = 1e-9  # correlation coefficients of different programs may differ by this amount


@dataclass(frozen=True)
class Input:
    """Input quantity of a model.

    Attributes
    ----------
    name : str
        Name of the input.
    distribution : object
        Distribution with `mean`, `u`, `u_dof` and `name`, as in `gum.distributions`. Its mean is
        the estimate, in `unit`.
    unit : str
        Unit.
    type : str
        Type of evaluation: "A" from readings, "B" from other information.
    family : str
        Name of the common line in the budget; "" for a separate line.
    is_default : bool
        True for an assumption of the program, which nobody declared.
    note : str
        Note for the budget.

    Raises
    ------
    ValueError
        For a type other than "A" or "B".
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
        """Name of the line in the budget that contains the input."""
        return self.family or self.name


class Inputs:
    """Inputs in the order of the arguments of the model, with their correlations.

    Parameters
    ----------
    inputs : sequence of Input, length n
        Inputs with distinct names.
    correlation : dict of {(str, str): float}, or ndarray of shape (n, n), optional
        Correlation coefficients of correlated pairs, or the whole matrix.

    Raises
    ------
    ValueError
        For repeated or unknown names, |r| > 1, or a matrix that is not a correlation matrix. A
        correlation matrix is symmetric, has a unit diagonal and no negative eigenvalue.

    Examples
    --------
    >>> from tankcal.gum import standard
    >>> inputs = Inputs([Input("d", standard(0.002, mean=4.8)), Input("h", standard(0.001))])
    >>> inputs.names, inputs.u.tolist()
    (('d', 'h'), [0.002, 0.001])
    """

    def __init__(self, inputs, correlation=None):
        self.inputs = tuple(inputs)
        self.names = tuple(item.name for item in self.inputs)
        twice = sorted({name for name in self.names if self.names.count(name) > 1})
        if twice:
            raise ValueError(f"input given twice: {', '.join(twice)}; a shared input is one input")
        # Without correlations, the matrix is the identity.
        pairs = {} if correlation is None else correlation
        matrix = (
            self._build_correlation(pairs)
            if isinstance(pairs, dict)
            else np.array(pairs, dtype=float)
        )
        self.correlation = _check_correlation(matrix, self.names)
        self.estimates = np.array([item.distribution.mean for item in self.inputs])
        self.u = np.array([item.distribution.u for item in self.inputs])
        self.dof = np.array([item.distribution.u_dof for item in self.inputs])

    def __len__(self):
        return len(self.inputs)

    def index(self, name):
        """Index of the input with this name.

        Raises
        ------
        ValueError
            For an unknown name.
        """
        if name not in self.names:
            raise ValueError(f"no input is called {name!r}: there are {', '.join(self.names)}")
        return self.names.index(name)

    @property
    def covariance(self):
        """Covariance (n, n) of the inputs."""
        return self.correlation * np.outer(self.u, self.u)

    @cached_property
    def groups(self):
        """Indices of the inputs in each group of correlated inputs, one array for each group."""
        from scipy.sparse.csgraph import connected_components  # slow to load

        # Inputs correlated through other inputs belong to the same group.
        count, label = connected_components(csr_array(self.correlation != 0), directed=False)
        return tuple(np.flatnonzero(label == i) for i in range(count))

    @cached_property
    def blocks(self):
        """Factor (p, c) of the covariance of each group: covariance = factor factor', c its rank.

        The groups are independent, so that no matrix of all inputs is decomposed.
        """
        return tuple(
            # covariance = diag(u) R diag(u).
            self.u[group, None] * factor_of(self.correlation[np.ix_(group, group)])
            if len(group) > 1
            else self.u[group, None]
            for group in self.groups
        )

    def _build_correlation(self, pairs):
        """Correlation matrix from a dictionary of pairs."""
        matrix = np.eye(len(self))
        for (first, second), r in pairs.items():
            i, j = self.index(first), self.index(second)
            if i == j or matrix[i, j]:
                raise ValueError(f"the correlation of {first} and {second} is given twice")
            matrix[i, j] = matrix[j, i] = r
        return matrix


def _check_correlation(matrix, names):
    """Check a correlation matrix and make it exactly symmetric; raises ValueError, see `Inputs`."""
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
    # A negative eigenvalue would give a combination of inputs a negative variance.
    smallest = np.linalg.eigvalsh(matrix)[0] if len(names) else 1.0
    # Rounding of the coefficients adds up over the inputs.
    if smallest < -_ROUNDING * len(names):
        raise ValueError(f"the correlations contradict one another: eigenvalue {smallest:.3g}")
    return (matrix + matrix.T) / 2
