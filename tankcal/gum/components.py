"""Components of uncertainty: sources, their combination, and the budget of an output.

Tables, budgets and `propagate` compute u, degrees of freedom, k and U with `Combined`. Deliveries
and the calculator, which store sums for speed, use `sum_of_fourths` and `dof_of`.

Correlated inputs form one component. Its variance contains their covariances. Its degrees of
freedom are the smallest among the inputs (`together_dof`). If the covariance of the inputs was
estimated jointly, the degrees of freedom are equal, and c' S c has a chi-square distribution with
this number of degrees of freedom (S has a Wishart distribution). For unequal degrees of freedom, no
rule is both safe and short. Of five simulated rules, the smallest value fell short least often, for
every method of estimating the variances and the correlation (docs/studies/propagation.md).

A budget lists the contribution of each input, and its potential for improvement.

Source: JCGM 100:2008 (GUM) 5.1, 5.2, 7.2.7, F.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.gum.coverage import coverage_factor, dof_of, least_of, sum_of_fourths

BLOCK = 1024  # rows processed together, so that their copies stay in the cache
NO_EIGENVALUE = 1e-12  # relative to the largest eigenvalue; smaller eigenvalues are rounding
ROUNDING = 1e-12  # relative to the largest volume of a table; smaller values are rounding


def type_of(dof):
    """Return the type of evaluation of the uncertainty of readings, "A" or "B".

    An evaluation of type A is a statistic of a series of observations (JCGM 100:2008, 4.2), and
    has their finite degrees of freedom. Declared standard deviations and priors are of type B.
    """
    return "A" if np.isfinite(dof) else "B"


@dataclass(frozen=True)
class Source:
    """A source of uncertainty, with its columns of the factor of the covariance.

    Attributes
    ----------
    kind : str
        "points", "form", ... or the name of a declared input; "a & b" for correlated inputs.
    columns_m3 : ndarray, shape (rows, c)
        Derivative of the output times standard uncertainty, in the unit of the output (m3 in a
        table).
    dof : float
        Degrees of freedom.
    u, unit : float and str, or None
        As declared; None for a computed source.
    type : str
        Type of evaluation, "A" or "B"; see `type_of`.
    distribution : str
        Name of the distribution.
    note : str
        Note of the declaration.
    estimate : float or None
        Value of the input, in `unit`; None without a value.
    is_default : bool
        True for an assumption of tankcal, which nobody declared.
    parts : tuple of Source
        Each of the correlated inputs; else ().
    correlation : ndarray, shape (parts, parts), or None
        Correlation matrix of the parts.
    u_is : str
        Meaning of u for Student's t: "scale" or "sd". With "sd", `dof` is only the shape.
    """

    kind: str
    columns_m3: np.ndarray
    dof: float = np.inf
    u: float | None = None
    unit: str | None = None
    type: str = "B"
    distribution: str = "normal"
    note: str = ""
    estimate: float | None = None
    is_default: bool = False
    parts: tuple = ()
    correlation: np.ndarray | None = None
    u_is: str = "scale"

    @property
    def u_dof(self):
        """Degrees of freedom of u; inf for a declared standard deviation, which is no estimate."""
        return np.inf if self.u_is == "sd" else self.dof

    def mapped(self, function):
        """Apply a function to the columns of the source and of its parts.

        Parameters
        ----------
        function : callable
            function(columns) -> new columns.

        Returns
        -------
        Source
        """
        parts = tuple(part.mapped(function) for part in self.parts)
        return replace(self, columns_m3=function(self.columns_m3), parts=parts)

    def weighted(self, weights):
        """Source of weighted sums of the rows, for weights (new rows, rows)."""
        return self.mapped(lambda columns: weights @ columns)


def scale_source(source, factors):
    """Multiply the standard uncertainty of a source; the degrees of freedom stay unchanged.

    Parameters
    ----------
    source : Source
        The source.
    factors : sequence of float
        One factor, or a factor for each part of correlated inputs; the correlation stays unchanged.

    Returns
    -------
    Source

    Examples
    --------
    Two inputs with r = 1 and contributions 3 and 4, the second contribution halved:

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
    # The columns of correlated inputs are mixed, so they are computed again from the parts.
    return replace(source, columns_m3=_correlate_columns(parts, source.correlation), parts=parts)


def declared_source(item, derivative, estimate=None):
    """Create the `Source` of a declared input.

    Parameters
    ----------
    item : object
        Declaration with name, u (SI), u_as_read, unit, type, distribution, dof, note, is_default
        and u_is.
    derivative : array_like, shape (rows,) or (rows, c)
        Derivative of the volume by the input, m3 per SI unit.
    estimate : float, optional
        Value of the input, in the declared unit.

    Returns
    -------
    Source
    """
    columns = np.asarray(derivative, dtype=float).reshape(len(derivative), -1) * item.u
    return Source(
        item.name,
        columns,
        item.dof,
        item.u_as_read,
        item.unit,
        item.type,
        item.distribution,
        item.note,
        estimate,
        item.is_default,
        u_is=item.u_is,
    )


def factor_of(covariance):
    """Factor L of a positive semidefinite covariance L L'.

    Parameters
    ----------
    covariance : ndarray, shape (n, n)
        Covariance matrix.

    Returns
    -------
    ndarray, shape (n, r)
        L, with r the rank of the covariance.

    Raises
    ------
    ValueError
        If the matrix has a negative eigenvalue larger than rounding.

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
    # Eigenvectors of zero eigenvalues contribute only rounding.
    keep = values > NO_EIGENVALUE * largest
    # The largest eigenvalue first.
    return (vectors[:, keep] * np.sqrt(values[keep]))[:, ::-1]


def triangular(correlation):
    """Lower triangular factor L of a correlation matrix R = L L', which may be singular.

    Row i combines input i with the inputs before it; for R = I, L is the identity.

    Parameters
    ----------
    correlation : ndarray, shape (n, n)
        Correlation matrix R.

    Returns
    -------
    ndarray, shape (n, n)
        L.

    Examples
    --------
    >>> triangular(np.array([[1.0, 0.6], [0.6, 1.0]])).round(12).tolist()
    [[1.0, 0.0], [0.6, 0.8]]
    """
    lower = np.zeros_like(correlation)
    for j, column in enumerate(correlation.T):
        # Column of the remaining matrix R - L L' of the columns so far.
        left = column - lower @ lower[j]
        # An input that follows from the inputs before it has a zero column.
        if left[j] > 1e-9:
            lower[j:, j] = left[j:] / np.sqrt(left[j])
    return lower


def group_correlated(sources, correlations):
    """Join correlated sources to one source each, because their columns mix.

    Parameters
    ----------
    sources : dict of {str: Source}
        Sources by name; a correlated source has one column.
    correlations : iterable of (str, str, float)
        Names of two inputs and their correlation coefficient.

    Returns
    -------
    tuple of Source

    Notes
    -----
    With columns c_i u_i and R = L L', L lower triangular, the joint source has the columns (c_i
    u_i) L. Its degrees of freedom follow from `together_dof`.

    Examples
    --------
    >>> a, b = Source("a", np.array([[3.0]])), Source("b", np.array([[4.0]]))
    >>> (both,) = group_correlated({"a": a, "b": b}, [("a", "b", 1.0)])
    >>> both.kind, round(float(np.sum(both.columns_m3**2)), 12)
    ('a & b', 49.0)
    """
    # A frozenset ignores the order of the two names.
    pairs = {frozenset(pair): r for *pair, r in correlations if {*pair} <= sources.keys()}
    grouped, results = set(), []
    for name, source in sources.items():
        if name in grouped:
            continue
        # Names of the inputs correlated with an input, directly or through other inputs.
        reached, added = set(), {name}
        # Breadth-first search; the result has the order of the sources.
        while added:
            reached |= added
            added = {partner for pair in pairs if pair & reached for partner in pair} - reached
        names = [partner for partner in sources if partner in reached]
        grouped |= set(names)
        results.append(source if len(names) == 1 else _join_sources(names, sources, pairs))
    return tuple(results)


def _join_sources(names, sources, pairs):
    """Joint source of correlated inputs."""
    parts = tuple(sources[name] for name in names)
    correlation = np.eye(len(names))
    for i, first in enumerate(names):
        for j, second in enumerate(names):
            if i != j:
                correlation[i, j] = pairs.get(frozenset((first, second)), 0.0)
    return Source(
        " & ".join(names),
        _correlate_columns(parts, correlation),
        together_dof([part.u_dof for part in parts]),
        is_default=any(part.is_default for part in parts),
        parts=parts,
        correlation=correlation,
    )


def _correlate_columns(parts, correlation):
    """Columns (rows, n) of correlated parts, stored by column."""
    # Columns (c_i u_i) L, computed as L' times the contributions in blocks of rows.
    mix, rows = triangular(correlation).T, len(parts[0].columns_m3)
    columns = np.empty((len(parts), rows))
    for start in range(0, rows, BLOCK):
        block = slice(start, start + BLOCK)
        np.matmul(mix, [part.columns_m3[block, 0] for part in parts], out=columns[:, block])
    return columns.T


def together_dof(dof):
    """Degrees of freedom of correlated inputs: the smallest value among the inputs.

    Parameters
    ----------
    dof : array_like, shape (n,)
        Degrees of freedom of each input; may be inf.

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
    """Combined uncertainty of outputs with independent components; each row is an output.

    Attributes
    ----------
    variances : ndarray, shape (rows, components)
        Variance contributed by each component, in the unit of the output squared.
    dof : ndarray, shape (components,)
        Degrees of freedom of each component; may be inf.

    Examples
    --------
    >>> output = Combined(np.array([[9.0, 16.0]]), np.array([9.0, np.inf]))
    >>> output.u.tolist(), output.effective_dof.round(2).tolist(), output.k(0.95).round(3).tolist()
    ([5.0], [69.44], [1.995])
    """

    variances: np.ndarray
    dof: np.ndarray

    @cached_property
    def u(self):
        """Combined standard uncertainty (rows,)."""
        return np.sqrt(np.sum(self.variances, axis=1))

    @cached_property
    def effective_dof(self):
        """Effective degrees of freedom (rows,), Welch-Satterthwaite; inf if all are infinite."""
        # Welch-Satterthwaite: u^4 / sum(u_i^4 / dof_i).
        fourths = sum_of_fourths(self.variances, self.dof)
        return dof_of(np.sum(self.variances, axis=1), fourths, least_of(self.dof))

    def k(self, probability):
        """Coverage factor (rows,) of Student's t for a coverage probability."""
        return coverage_factor(probability, self.effective_dof)

    def expanded(self, probability):
        """Expanded uncertainty (rows,), U = k u."""
        return self.k(probability) * self.u


def combine(sources, rows):
    """Combine independent sources: u, degrees of freedom, k and U of each output.

    Parameters
    ----------
    sources : sequence of Source
        Sources with a row for each output, in its unit.
    rows : int
        Number of outputs.

    Returns
    -------
    Combined

    Examples
    --------
    >>> output = combine([Source("tape", np.array([[3.0]]), 9.0), Source("form", [[4.0]])], 1)
    >>> output.u.tolist(), output.expanded(0.95).round(2).tolist()
    ([5.0], [9.97])
    """
    # A source with several columns contributes the sum of their squares.
    squares = [np.einsum("ij,ij->i", source.columns_m3, source.columns_m3) for source in sources]
    variances = np.reshape(squares, (len(squares), rows)).T
    return Combined(variances, np.array([source.u_dof for source in sources], dtype=float))


@dataclass(frozen=True)
class BudgetRow:
    """One line of a budget.

    Attributes
    ----------
    name, unit, type, distribution, dof, note
        As declared for the input; for a family, of its first input.
    is_default : bool
        True for an assumption of the program, which nobody declared.
    estimate : float
        Estimate in `unit`; nan for a family.
    u : float
        Standard uncertainty in `unit`; nan for a family.
    sensitivity : float
        Sensitivity coefficient dy/dx, unit of the output per unit of the input; nan for a family.
    contribution : float
        |dy/dx| u, or sqrt(c' U c) for a family, in the unit of the output.
    share : float
        Share of the variance. The shares have the sum 1; a correlation can make a share negative.
    halved : float
        Factor of the expanded uncertainty if u were halved: 0.9 means a reduction by 10 %.
    correlations : tuple of (str, float)
        Name of each correlated input, and correlation coefficient.
    """

    name: str
    unit: str
    type: str
    distribution: str
    dof: float
    note: str
    is_default: bool
    estimate: float
    u: float
    sensitivity: float
    contribution: float
    share: float
    halved: float
    correlations: tuple = ()


class Shares:
    """Sources of one output, and the contributions of groups of inputs.

    Parameters
    ----------
    sources : sequence of Source
        Sources with a single row.
    probability : float
        Coverage probability of U.

    Attributes
    ----------
    u, dof, k, U : float
        Combined standard uncertainty, effective degrees of freedom, coverage factor and expanded
        uncertainty of the output.
    """

    def __init__(self, sources, probability):
        self.sources, self.probability = sources, probability
        self._found = combine(sources, 1)
        self._variances = self._found.variances[0]
        self._variance = float(self._variances.sum())
        self.u, self.dof = float(self._found.u[0]), float(self._found.effective_dof[0])
        self.k = float(self._found.k(probability)[0])
        self.U = self.k * self.u

    def of_line(self, members):
        """Contribution, share and halved of a `BudgetRow`.

        Parameters
        ----------
        members : dict of {int: sequence of int or None}
            Index of each source in the line, with the indices of its parts; None: all parts.

        Returns
        -------
        dict
        """
        square = variance = 0.0
        changed = self._variances.copy()
        for number, chosen in members.items():
            parts = self._parts_of(number, chosen)
            square, variance = square + parts[0], variance + parts[1]
            # Variance of the source after halving u of its members.
            changed[number] = parts[2]
        return {
            "contribution": float(max(square, 0.0) ** 0.5),
            "share": float(variance / self._variance) if self._variance > 0 else 0.0,
            "halved": self._compute_U_for(changed) / self.U if self.U > 0 else 1.0,
        }

    def _parts_of(self, number, chosen):
        """Variances of parts of a source: the parts alone, with covariances, and after halving."""
        source, whole = self.sources[number], self._variances[number]
        # Halving u of all parts quarters the variance.
        if chosen is None:
            return whole, whole, whole / 4
        contributions = np.array([part.columns_m3[0, 0] for part in source.parts])
        is_chosen = np.isin(np.arange(len(contributions)), chosen)
        line, half = (
            np.where(is_chosen, contributions, 0.0),
            np.where(is_chosen, contributions / 2, contributions),
        )
        # c'Rc of the parts; c'R times all contributions, which assigns half of each covariance to
        # the line; variance of the source with the parts halved.
        return (
            line @ source.correlation @ line,
            line @ (source.correlation @ contributions),
            half @ source.correlation @ half,
        )

    def _compute_U_for(self, variances):
        """Expanded uncertainty for other variances of the sources."""
        return float(Combined(variances[None, :], self._found.dof).expanded(self.probability)[0])


def budget(result, row=0, probability=0.95):
    """Uncertainty budget of one output, with a line for each input or family of inputs.

    Parameters
    ----------
    result : Propagation
        Result of the propagation.
    row : int, optional
        Index of the output.
    probability : float, optional
        Coverage probability of the expanded uncertainty in `halved`.

    Returns
    -------
    list of BudgetRow
        In the order of the inputs; sorted by `halved`, the largest improvement comes first.

    Examples
    --------
    >>> from tankcal.gum import standard
    >>> from tankcal.uncertainty import Input, Inputs, propagate
    >>> inputs = Inputs([Input("a", standard(3.0)), Input("b", standard(4.0))])
    >>> lines = budget(propagate(lambda x: x[0] + x[1], inputs))
    >>> [(line.name, round(line.share, 2)) for line in lines]
    [('a', 0.36), ('b', 0.64)]
    """
    output = result.rows([row])
    shares = Shares(_sources(output), probability)
    # dict.fromkeys keeps the order of the inputs.
    lines = list(dict.fromkeys(item.line for item in output.inputs.inputs))
    return [_line(output, name, shares) for name in lines]


def _sources(output):
    """Sources of one output, with the inputs of each source as its parts."""
    inputs, contributions = output.inputs, output.sensitivities[0] * output.inputs.u
    return [
        replace(
            source,
            parts=tuple(Source(inputs.names[i], contributions[[[i]]]) for i in group),
            correlation=inputs.correlation[np.ix_(group, group)],
        )
        for source, group in zip(output.sources, inputs.groups, strict=True)
    ]


def _line(output, name, shares):
    """Line of the budget for the inputs with this name."""
    inputs = output.inputs
    members = [i for i, item in enumerate(inputs.inputs) if item.line == name]
    first, is_single = inputs.inputs[members[0]], len(members) == 1
    # Indices of the members within each group of correlated inputs.
    places = [np.flatnonzero(np.isin(group, members)) for group in inputs.groups]
    parts = {
        number: None if len(members_of_source) == len(inputs.groups[number]) else members_of_source
        for number, members_of_source in enumerate(places)
        if len(members_of_source)
    }
    return BudgetRow(
        name=name,
        unit=first.unit,
        type=first.type,
        distribution=first.distribution.name,
        dof=float(inputs.dof[members].min()),
        note=first.note,
        is_default=first.is_default,
        estimate=float(inputs.estimates[members[0]]) if is_single else np.nan,
        u=float(inputs.u[members[0]]) if is_single else np.nan,
        sensitivity=float(output.sensitivities[0, members[0]]) if is_single else np.nan,
        correlations=_correlations(inputs, members),
        **shares.of_line(parts),
    )


def _correlations(inputs, members):
    """Correlations of a line with a single input; () for a family."""
    if len(members) > 1:
        return ()
    row = inputs.correlation[members[0]]
    partners = (i for i in range(len(row)) if i != members[0] and row[i])
    return tuple((inputs.names[i], float(row[i])) for i in partners)
