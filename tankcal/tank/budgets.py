"""Uncertainty budget of a volume read from the table: at a dip, or between two dips.

The budget has one line for each input, with correlated inputs listed separately, then the
contributions of the reading: rows are rounded to litres and joined by straight lines. These errors
are independent for each reading, so they are not part of the covariance of the rows; for a delivery
they count twice. Source: JCGM 100:2008 5.1.3, 5.2.2, 7.2.7.
"""

from dataclasses import dataclass, replace
from math import isnan

import numpy as np

from tankcal.gum.distributions import within
from tankcal.text.display import table_html, volume_text
from tankcal.uncertainty import (
    BudgetRow,
    Shares,
    Source,
    combine,
    declared_source,
    factor_of,
    scale_source,
    type_of,
)

HALF_A_LITRE_M3 = 5e-4  # half-width of the rounding of a row to whole litres
LEAST_SHARE = 1e-6  # tolerance for rounding of the share of a named cause in the covariance


@dataclass(frozen=True, repr=False)
class Budget:
    """Volume read from the table, with the components of its uncertainty.

    Attributes
    ----------
    low_m, high_m : float
        Dips, m; low_m None: the volume below high_m.
    volume_m3 : float
        Volume below the dip, or between the dips, m3.
    table_u_m3 : float
        Standard uncertainty of the table alone, m3; the expanded contribution of the reading is
        `reading_U_m3`.
    u_m3, dof, k, U_m3 : float
        Including the reading: standard uncertainty, m3, degrees of freedom, coverage factor,
        expanded uncertainty, m3.
    for_use : bool
        False if a dip is in a zone in which the table must not be used.
    lines : tuple of BudgetRow
        In the order of the sources of the table, then of the reading; their shares sum to 1.
    """

    low_m: float | None
    high_m: float
    volume_m3: float
    table_u_m3: float
    u_m3: float
    dof: float
    k: float
    U_m3: float
    for_use: bool
    lines: tuple[BudgetRow, ...]

    @property
    def reading_U_m3(self):
        """k times the root sum of squares of the standard uncertainties of the reading, m3."""
        return self.k * max(self.u_m3**2 - self.table_u_m3**2, 0.0) ** 0.5

    @property
    def summary(self):
        """Dip, or dips, and volume with U in one line (str)."""
        dips = (
            f"{self.high_m:g} m" if self.low_m is None else f"{self.low_m:g} to {self.high_m:g} m"
        )
        return f"{dips}: {volume_text(self.volume_m3, self.U_m3, self.k)}"

    def __str__(self) -> str:
        lines = [
            f"{100 * line.share:6.1f} %  {line.contribution:9.4f} m3  {self._input_text(line)}"
            for line in self._ordered
        ]
        return "\n".join([self.summary, *lines])

    def __repr__(self) -> str:
        return f"<Budget of {self.summary}>"

    def _repr_html_(self) -> str:
        rows = [
            [
                line.name + (" (default)" if line.is_default else ""),
                None if isnan(line.u) else line.u,
                line.unit,
                line.contribution,
                100 * line.share,
            ]
            for line in self._ordered
        ]
        headings = ["input", "u", "unit", "contribution, m3", "share, %"]
        return table_html(self.summary, headings, rows)

    @property
    def _ordered(self):
        """Lines, largest share first."""
        return sorted(self.lines, key=lambda line: -abs(line.share))

    @staticmethod
    def _input_text(line):
        """Return the name of an input with its u, if it has a u of its own."""
        u = "" if isnan(line.u) else f", u = {line.u:.3g} {line.unit}"
        return f"{line.name}{u}{' (default)' if line.is_default else ''}"


def reading_sources(declared, largest_interpolation_m3):
    """Return the two uncertainties of reading a table: interpolation and rounding.

    Parameters
    ----------
    declared : sequence of Input
        Inputs of the job; "interpolation" and "rounding" replace the defaults.
    largest_interpolation_m3 : float
        Largest error of a straight line between two rows, m3.

    Returns
    -------
    tuple of Source
        Sources of a single dip. The defaults are rectangular, with half a litre and the largest
        error of interpolation as half-widths.

    Examples
    --------
    >>> [f"{source.kind} {source.u:.6f} m3" for source in reading_sources((), 0.003)]
    ['interpolation 0.001732 m3', 'rounding 0.000289 m3']
    """
    by_name = {item.name: item for item in declared}
    defaults = {"interpolation": largest_interpolation_m3, "rounding": HALF_A_LITRE_M3}
    return tuple(
        declared_source(by_name[name], np.ones(1))
        if name in by_name
        else _default(name, half_width)
        for name, half_width in defaults.items()
    )


def _default(name, half_width):
    u = within(half_width).u
    return Source(
        name,
        np.array([[u]]),
        u=u,
        unit="m3",
        distribution="rectangular",
        is_default=True,
    )


def budget(table, high_m, low_m=None, reading=(), factors=None):
    """Return the uncertainty budget of the volume below a dip, or between two dips.

    Parameters
    ----------
    table : Capacity
    high_m : float
        Dip, m.
    low_m : float, optional
        Lower dip of a delivery, m.
    reading : sequence of Source, optional
        Result of `reading_sources`; empty for the table alone.
    factors : sequence of float, optional
        Factors on the u of each line of the budget, to study their effect; None: no change.

    Returns
    -------
    Budget

    Raises
    ------
    HeightError
        For a dip outside the table.
    ValueError
        If the number of factors differs from the number of lines, or a factor is negative.

    References
    ----------
    JCGM 100:2008 5.1.3, 5.2.2, 7.2.7.

    Examples
    --------
    A dip between two rows of a table whose upper row has u = 0.2 m3:

    >>> import numpy as np
    >>> from tankcal.tank.capacity import Capacity
    >>> form = Source("form", np.array([[0.0], [0.2]]))
    >>> table = Capacity(np.array([0, 1.0]), np.array([0, 100.0]), np.ones(2), (form,), 0.95)
    >>> print(budget(table, 0.5))
    0.5 m: 50.00 m3, U = 0.20 m3 (k = 1.96)
     100.0 %     0.1000 m3  form

    What if u of the form were half as large?

    >>> print(budget(table, 0.5, factors=[0.5]))
    0.5 m: 50.000 m3, U = 0.098 m3 (k = 1.96)
     100.0 %     0.0500 m3  form
    """
    quantity = table.at(high_m) if low_m is None else table.delivery(low_m, high_m)
    dips = [high_m] if low_m is None else [low_m, high_m]
    weights = table.weights(dips[-1:]) - (0 if low_m is None else table.weights(dips[:1]))
    # A delivery is the difference of two interpolated rows: common errors cancel in the weights.
    sources = [source.weighted(weights) for source in table.sources]
    table_u_m3 = quantity.u_m3
    sources += [_scale_reading(source, table, dips) for source in reading]
    if factors is not None:
        sources = _scale_lines(sources, factors)
        # The changed u of the lines also changes the standard uncertainty of the table.
        table_u_m3 = float(combine(sources[: len(table.sources)], 1).u[0])
    total = Shares(sources, table.probability)
    return Budget(
        low_m=low_m,
        high_m=high_m,
        volume_m3=quantity.value_m3,
        table_u_m3=table_u_m3,
        u_m3=total.u,
        dof=total.dof,
        k=total.k,
        U_m3=total.U,
        for_use=quantity.for_use,
        lines=tuple(line for index in range(len(sources)) for line in _budget_rows(total, index)),
    )


def _scale_lines(sources, factors):
    """Return the sources with the u of each line multiplied by its factor."""
    factors = [float(item) for item in factors]
    ends = np.cumsum([0, *(max(len(item.parts), 1) for item in sources)])
    if len(factors) != ends[-1] or not all(0 <= item < np.inf for item in factors):
        raise ValueError(f"found {factors}; expected {ends[-1]} factors, 0 or more")
    slices = zip(sources, ends, ends[1:], strict=False)
    return [scale_source(item, factors[start:stop]) for item, start, stop in slices]


def _scale_reading(source, table, dips):
    """Return a reading source for dips: rounding at each, interpolation between rows."""
    interpolated = sum(len(table.rows_of(dip)) > 1 for dip in dips)
    times = interpolated if source.kind == "interpolation" else len(dips)
    # Independent errors of equal size: the standard uncertainty grows with the root of their
    # number.
    return source.mapped(lambda columns: columns * np.sqrt(times))


def _budget_rows(total, index):
    """Return the `BudgetRow`s of a source: one, or one for each of its correlated parts."""
    source = total.sources[index]
    if not source.parts:
        return [_budget_row(source, total.of_line({index: None}))]
    rows = []
    for i, part in enumerate(source.parts):
        others = zip(source.parts, source.correlation[i], strict=True)
        pairs = tuple((other.kind, float(r)) for other, r in others if other is not part and r)
        rows.append(_budget_row(part, total.of_line({index: [i]}), pairs))
    return rows


def _budget_row(source, shares, correlations=()):
    """Return the `BudgetRow` of a source."""
    has_u = source.u is not None
    column = float(source.columns_m3[0, 0]) if source.columns_m3.shape[1] == 1 else None
    is_slope = has_u and source.u > 0 and column is not None
    return BudgetRow(
        name=source.kind,
        unit=source.unit or "",
        type=source.type,
        distribution=source.distribution,
        dof=source.u_dof,
        note=source.note,
        is_default=source.is_default,
        estimate=np.nan if source.estimate is None else source.estimate,
        u=source.u if has_u else np.nan,
        sensitivity=column / source.u if is_slope else np.nan,
        correlations=correlations,
        **shares,
    )


# ---- uncertainty after a survey by cause, and causes shared by several parts of a tank


@dataclass(frozen=True)
class Factor:
    """Cause of uncertainty after a survey, in terms of the results of the survey.

    Attributes
    ----------
    kind : str
        "points", "bulge", "ovality", "seams", or the kind of a named cause ("instrument_scale").
    columns : ndarray, shape (f, c)
        Factor of the covariance of the features of a shell or of the inputs of a solid.
    dof, u, unit, type, note, is_default
        As in `uncertainty.Source`.
    """

    kind: str
    columns: np.ndarray
    dof: float = np.inf
    u: float | None = None
    unit: str | None = None
    type: str = "B"
    note: str = ""
    is_default: bool = False

    def mapped(self, function):
        """Return the cause in terms of other quantities: function(columns) -> columns."""
        return replace(self, columns=function(self.columns))

    def source(self, columns_m3):
        """Return the `Source` with the columns (rows, c) of the cause in a table."""
        return Source(
            self.kind,
            columns_m3,
            self.dof,
            self.u,
            self.unit,
            type=self.type,
            note=self.note,
            is_default=self.is_default,
        )


def survey_factors(covariance, dof=np.inf, causes=(), effects=()):
    """Return the `Factor`s of a survey: the points, then every named cause.

    With F F' the covariance and e = F a, the remainder is F (I - A A') F', which is positive
    semidefinite.

    Parameters
    ----------
    covariance : ndarray, shape (f, f)
        Covariance due to all causes: the remainder L L' + sum of e e' over the effects.
    dof : float, optional
        Degrees of freedom of the covariance.
    causes : sequence, optional
        Objects with name, what, u, unit, is_assumed (`surveys.Cause`). Causes of equal name and
        kind form a single `Factor`.
    effects : sequence of ndarray, shape (f,), optional
        Effect of one standard uncertainty of each cause.

    Returns
    -------
    tuple of Factor

    Raises
    ------
    ValueError
        For effects larger than the covariance.
    """
    factor = factor_of(covariance)
    if len(causes) == 0:
        return (Factor("points", factor, dof, type=type_of(dof)),)
    shares = factor.T @ np.column_stack(effects) / np.sum(factor**2, axis=0)[:, None]
    # Coordinates of the effects in the factor; singular values above 1 would leave a negative
    # remainder.
    basis, size, _ = np.linalg.svd(shares)
    if size.max(initial=0.0) > 1 + LEAST_SHARE:
        raise ValueError("a named cause is larger than the covariance that contains it")
    # I - A A' has the eigenvalues 1 - size^2 in the basis of the left singular vectors.
    remaining = np.ones(len(basis))
    remaining[: len(size)] = np.sqrt(np.maximum(1 - size**2, 0.0))
    remainder = factor @ (basis * remaining)
    return (
        Factor("points", remainder[:, remaining > 0], dof, type=type_of(dof)),
        *cause_factors(causes, effects),
    )


def cause_factors(causes, effects):
    """Return a tuple with the `Factor` of each named cause; arguments as for `survey_factors`."""
    return tuple(
        Factor(
            cause.what,
            np.column_stack(columns),
            u=cause.u,
            unit=cause.unit,
            note=cause.name,
            is_default=cause.is_assumed,
        )
        for cause, columns in _group_by_name(causes, effects)
    )


def _group_by_name(causes, effects):
    """Return the first cause of each name and kind, with the effects of all such causes."""
    groups = {}
    for cause, effect in zip(causes, effects, strict=True):
        groups.setdefault((cause.what, cause.name), (cause, []))[1].append(effect)
    return tuple(groups.values())


def join_shared(of_parts):
    """Return sources of parts, with a named cause of several parts joined to a single source.

    The columns of a named cause refer to the same unit variables in all parts, so they add.

    Parameters
    ----------
    of_parts : sequence of sequences of Source

    Returns
    -------
    list of Source

    Examples
    --------
    >>> lifted = Source("registration", np.array([[3.0]]), note="A")
    >>> widened = Source("registration", np.array([[4.0]]), note="A")
    >>> [source.columns_m3.tolist() for source in join_shared([[lifted], [widened]])]
    [[[7.0]]]
    """
    joined, place = [], {}
    for sources in of_parts:
        earlier_place = dict(place)
        for source in sources:
            cause = source.kind, source.note, source.columns_m3.shape[1]
            # Only sources of earlier parts are joined: equal causes within a part remain separate.
            if source.note and cause in earlier_place:
                earlier = joined[earlier_place[cause]]
                columns = earlier.columns_m3 + source.columns_m3
                joined[earlier_place[cause]] = replace(earlier, columns_m3=columns)
                continue
            place[cause] = len(joined)
            joined.append(source)
    return joined
