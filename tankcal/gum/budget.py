"""Uncertainty budget of one output: contribution of each input, and potential for improvement.

Source: JCGM 100:2008 5.1.3, 7.2.7, F.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.gum.components import Combined, Source, combine


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
            "halved": self._expanded_for(changed) / self.U if self.U > 0 else 1.0,
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

    def _expanded_for(self, variances):
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
