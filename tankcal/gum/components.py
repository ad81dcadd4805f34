"""Components of uncertainty: sources, alone and correlated, and what they make together.

Table, budget and `propagate` all state u, degrees of freedom, k and U by `Combined`; deliveries
and the calculator, which work on sums kept for speed, by the same `sum_of_fourths` and `dof_of`.

Inputs that are correlated are one component: its variance has their covariances in it, and its
degrees of freedom are the least of theirs (`together_dof`). Of inputs whose covariance was
estimated together these are equal, and c' S c is a chi-square of just as many (S is of Wishart's
distribution). Of unequal ones no rule was found that neither falls short nor is long; of five that
were simulated the least fell short the least often, however the variances and the correlation had
been estimated (docs/uncertainty.md).

Source: JCGM 100:2008 (GUM) 5.1, 5.2.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.gum.coverage import coverage_factor, dof_of, least_of, sum_of_fourths

BLOCK = 1024  # rows at once: copies of them stay in the processor's cache
NO_EIGENVALUE = 1e-12  # of the largest: what rounding leaves where there is none is below it
ROUNDING = 1e-12  # of the largest volume of a table: less than that is lost in its digits


@dataclass(frozen=True)
class Source:
    """One cause of uncertainty, with one or more columns of the factor that belong together.

    Attributes
    ----------
    kind : str
        "points", "form", ... or the name of a declared input; "a & b" of correlated ones.
    columns_m3 : ndarray, shape (rows, c)
        Derivative of the output times standard uncertainty, in the unit of the output: m3 in a
        table.
    dof : float
        Degrees of freedom.
    u, unit : float and str, or None
        As declared; None for what was not declared but computed.
    type : str
        "A" or "B".
    distribution : str
    note : str
    estimate : float or None
        Value of the input, in `unit`; None where it has none.
    is_default : bool
        True for an input that nobody declared: tankcal's own assumption.
    parts : tuple of Source
        Of correlated inputs each by itself; else ().
    correlation : ndarray, shape (parts, parts), or None
        Of these.
    u_is : str
        What u is of Student's t: "scale", or "sd": then `dof` is the shape of it alone.
    """

    kind: str
    columns_m3: np.ndarray
    dof: float = np.inf
    u: float | None = None
    unit: str | None = None
    type: str = "A"
    distribution: str = "normal"
    note: str = ""
    estimate: float | None = None
    is_default: bool = False
    parts: tuple = ()
    correlation: np.ndarray | None = None
    u_is: str = "scale"

    @property
    def u_dof(self):
        """Degrees of freedom of u; inf of a declared standard deviation, which is no estimate."""
        return np.inf if self.u_is == "sd" else self.dof

    def mapped(self, function):
        """The same cause with function(columns) for its columns and those of its parts."""
        parts = tuple(part.mapped(function) for part in self.parts)
        return replace(self, columns_m3=function(self.columns_m3), parts=parts)

    def weighted(self, weights):
        """The same cause of weights (new rows, rows) @ rows."""
        return self.mapped(lambda columns: weights @ columns)


def scale_source(source, factors):
    """A cause of which each u is so many times what it is; degrees of freedom stay.

    Parameters
    ----------
    source : Source
    factors : sequence of float
        One, or of correlated inputs one for each part: their correlation stays, too.

    Returns
    -------
    Source

    Examples
    --------
    Of two inputs with r = 1 that bring 3 and 4, the second one halved:

    >>> a, b = Source("a", np.array([[3.0]])), Source("b", np.array([[4.0]]))
    >>> (both,) = group_correlated({"a": a, "b": b}, [("a", "b", 1.0)])
    >>> round(float(np.sum(scale_source(both, [1.0, 0.5]).columns_m3**2)), 12)
    25.0
    """
    if not source.parts:
        (factor,) = factors
        u = None if source.u is None else factor * source.u
        return replace(source, columns_m3=factor * source.columns_m3, u=u)
    pairs = zip(source.parts, factors, strict=True)
    parts = tuple(scale_source(part, [factor]) for part, factor in pairs)
    return replace(source, columns_m3=_mixed(parts, source.correlation), parts=parts)


def declared_source(one, derivative, estimate=None):
    """The `Source` of a declared input.

    Parameters
    ----------
    one : object
        With name, u (SI), u_as_read, unit, type, distribution, dof, note, is_default, u_is.
    derivative : array_like, shape (rows,) or (rows, c)
        Of the volume by the input, m3 per SI unit.
    estimate : float, optional
        Value of the input, in the unit it is declared in.

    Returns
    -------
    Source
    """
    columns = np.asarray(derivative, dtype=float).reshape(len(derivative), -1) * one.u
    return Source(
        one.name,
        columns,
        one.dof,
        one.u_as_read,
        one.unit,
        one.type,
        one.distribution,
        one.note,
        estimate,
        one.is_default,
        u_is=one.u_is,
    )


def factor_of(covariance):
    """Factor L of a positive semidefinite covariance, covariance = L L'.

    Parameters
    ----------
    covariance : ndarray, shape (n, n)

    Returns
    -------
    ndarray, shape (n, r)
        r its rank.

    Raises
    ------
    ValueError
        When the matrix has a negative eigenvalue beyond rounding.

    Examples
    --------
    >>> factor = factor_of(np.array([[2.0, 2.0], [2.0, 2.0]]))
    >>> factor.shape, (factor @ factor.T).round(12).tolist()
    ((2, 1), [[2.0, 2.0], [2.0, 2.0]])
    """
    values, vectors = np.linalg.eigh(covariance)
    largest = max(values.max(initial=0.0), 0.0)
    if values.min(initial=0.0) < -1e-9 * largest:
        raise ValueError(f"not a covariance: eigenvalue {values.min():.3g} against {largest:.3g}")
    keep = values > NO_EIGENVALUE * largest
    return (vectors[:, keep] * np.sqrt(values[keep]))[:, ::-1]


def triangular(correlation):
    """Lower triangular L of a correlation matrix R = L L' that may be singular.

    Row i is a combination of the inputs before it and its own: with R = I each stands alone.

    Parameters
    ----------
    correlation : ndarray, shape (n, n)

    Returns
    -------
    ndarray, shape (n, n)

    Examples
    --------
    >>> triangular(np.array([[1.0, 0.6], [0.6, 1.0]])).round(12).tolist()
    [[1.0, 0.0], [0.6, 0.8]]
    """
    lower = np.zeros_like(correlation)
    for j, column in enumerate(correlation.T):
        left = column - lower @ lower[j]
        if left[j] > 1e-9:
            lower[j:, j] = left[j:] / np.sqrt(left[j])
    return lower


def group_correlated(sources, correlations):
    """Sources with those that are correlated made one, for their columns mix.

    With columns c_i u_i and R = L L', L lower triangular, the columns of the group are (c_i u_i) L.
    Its degrees of freedom are those of `together_dof`.

    Parameters
    ----------
    sources : dict of {str: Source}
        Of one column each where correlated.
    correlations : iterable of (str, str, float)
        Names of two inputs, and r.

    Returns
    -------
    tuple of Source

    Examples
    --------
    >>> a, b = Source("a", np.array([[3.0]])), Source("b", np.array([[4.0]]))
    >>> (both,) = group_correlated({"a": a, "b": b}, [("a", "b", 1.0)])
    >>> both.kind, round(float(np.sum(both.columns_m3**2)), 12)
    ('a & b', 49.0)
    """
    pairs = {frozenset(pair): r for *pair, r in correlations if {*pair} <= sources.keys()}
    done, found = set(), []
    for name, source in sources.items():
        if name in done:
            continue
        names = _partners(name, pairs, sources)
        done |= set(names)
        found.append(source if len(names) == 1 else _together(names, sources, pairs))
    return tuple(found)


def _partners(name, pairs, order):
    """The names that are correlated with this one, directly or through others, in their order."""
    reached, news = set(), {name}
    while news:
        reached |= news
        news = {one for pair in pairs if pair & reached for one in pair} - reached
    return [one for one in order if one in reached]


def _together(names, sources, pairs):
    parts = tuple(sources[name] for name in names)
    correlation = np.eye(len(names))
    for i, one in enumerate(names):
        for j, other in enumerate(names):
            if i != j:
                correlation[i, j] = pairs.get(frozenset((one, other)), 0.0)
    return Source(
        " & ".join(names),
        _mixed(parts, correlation),
        together_dof([part.u_dof for part in parts]),
        type="B",
        is_default=any(part.is_default for part in parts),
        parts=parts,
        correlation=correlation,
    )


def _mixed(parts, correlation):
    """(rows, n) columns of parts that are correlated, each a column with its rows in a row."""
    mix, rows = triangular(correlation).T, len(parts[0].columns_m3)
    columns = np.empty((len(parts), rows))
    for start in range(0, rows, BLOCK):
        some = slice(start, start + BLOCK)
        np.matmul(mix, [part.columns_m3[some, 0] for part in parts], out=columns[:, some])
    return columns.T


def together_dof(dof):
    """Degrees of freedom of inputs that are correlated with one another: the least of theirs.

    Parameters
    ----------
    dof : array_like, shape (n,)

    Returns
    -------
    float

    Examples
    --------
    >>> together_dof([8.0, 3.0, np.inf])
    3.0
    """
    return float(np.min(dof))


@dataclass(frozen=True)
class Combined:
    """Outputs made of independent components; one row an output.

    Attributes
    ----------
    variances : ndarray, shape (rows, components)
        That each component brings, in the unit of the output squared.
    dof : ndarray, shape (components,)
        Degrees of freedom of each, may be inf.

    Examples
    --------
    >>> one = Combined(np.array([[9.0, 16.0]]), np.array([9.0, np.inf]))
    >>> one.u.tolist(), one.effective_dof.round(2).tolist(), one.k(0.95).round(3).tolist()
    ([5.0], [69.44], [1.995])
    """

    variances: np.ndarray
    dof: np.ndarray

    @cached_property
    def u(self):
        """(rows,) combined standard uncertainty."""
        return np.sqrt(np.sum(self.variances, axis=1))

    @cached_property
    def effective_dof(self):
        """(rows,) effective degrees of freedom, Welch-Satterthwaite; inf without finite ones."""
        fourths = sum_of_fourths(self.variances, self.dof)
        return dof_of(np.sum(self.variances, axis=1), fourths, least_of(self.dof))

    def k(self, probability):
        """(rows,) coverage factor for that coverage probability, of Student's t."""
        return coverage_factor(probability, self.effective_dof)

    def expanded(self, probability):
        """(rows,) expanded uncertainty U = k u."""
        return self.k(probability) * self.u


def combine(sources, rows):
    """Outputs made of independent causes: their u, degrees of freedom, k and U.

    Parameters
    ----------
    sources : sequence of Source
        Causes whose columns have one row for each output, in its unit.
    rows : int
        Outputs.

    Returns
    -------
    Combined

    Examples
    --------
    >>> found = combine([Source("tape", np.array([[3.0]]), 9.0), Source("form", [[4.0]])], 1)
    >>> found.u.tolist(), found.expanded(0.95).round(2).tolist()
    ([5.0], [9.97])
    """
    squares = [np.einsum("ij,ij->i", one.columns_m3, one.columns_m3) for one in sources]
    variances = np.reshape(squares, (len(squares), rows)).T
    return Combined(variances, np.array([one.u_dof for one in sources], dtype=float))
