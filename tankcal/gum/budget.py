"""The budget of one output: what brings how much, and what is worth measuring better.

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
        As the input declares them; of a family, the first.
    is_default : bool
        Nobody declared it.
    estimate : float
        In `unit`; nan of a family.
    u : float
        Standard uncertainty in `unit`; nan of a family.
    sensitivity : float
        dy/dx, unit of the output by `unit`; nan of a family.
    contribution : float
        |dy/dx| u, of a family sqrt(c' U c), in the unit of the output.
    share : float
        Of the variance; the shares add up to 1, negative where correlations take away.
    halved : float
        The factor of the expanded uncertainty if u were half as large: 0.9 is 10 % less.
    correlations : tuple
        ((name, r), ...) of the inputs that it is correlated with.
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
    """The `Source`s of one output together, and what a line of its budget has of them.

    u, dof, k, U  of the output

    Parameters
    ----------
    sources
        Of one row each.
    probability
        Coverage probability of U.
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
        """Contribution, share and halved of `BudgetRow`, as a dict.

        members  {number of a source: numbers of its parts; None: all of it}
        """
        square = variance = 0.0
        changed = self._variances.copy()
        for number, chosen in members.items():
            parts = self._parts_of(number, chosen)
            square, variance = square + parts[0], variance + parts[1]
            changed[number] = parts[2]
        return {
            "contribution": float(max(square, 0.0) ** 0.5),
            "share": float(variance / self._variance) if self._variance > 0 else 0.0,
            "halved": self._with(changed) / self.U if self.U > 0 else 1.0,
        }

    def _parts_of(self, number, chosen):
        """What parts of a source bring alone, bring with the others, and leave when halved."""
        source, whole = self.sources[number], self._variances[number]
        if chosen is None:
            return whole, whole, whole / 4
        own = np.array([part.columns_m3[0, 0] for part in source.parts])
        is_chosen = np.isin(np.arange(len(own)), chosen)
        line, half = np.where(is_chosen, own, 0.0), np.where(is_chosen, own / 2, own)
        return (
            line @ source.correlation @ line,
            line @ (source.correlation @ own),
            half @ source.correlation @ half,
        )

    def _with(self, variances):
        """U with other variances of the sources."""
        return float(Combined(variances[None, :], self._found.dof).expanded(self.probability)[0])


def budget(result, row=0, probability=0.95):
    """The budget of one output: a line for each input, or family of inputs (points, say).

    Parameters
    ----------
    result : Propagation
    row : int
        Which output.
    probability : float
        Coverage probability of the expanded uncertainty in `halved`.

    Returns
    -------
    list of BudgetRow
        In the order of the inputs; sort by `halved` for what to improve.

    Examples
    --------
    >>> from tankcal.gum import standard
    >>> from tankcal.uncertainty import Input, Inputs, propagate
    >>> inputs = Inputs([Input("a", standard(3.0)), Input("b", standard(4.0))])
    >>> lines = budget(propagate(lambda x: x[0] + x[1], inputs))
    >>> [(line.name, round(line.share, 2)) for line in lines]
    [('a', 0.36), ('b', 0.64)]
    """
    one = result.rows([row])
    shares = Shares(_sources(one), probability)
    lines = list(dict.fromkeys(item.line for item in one.inputs.inputs))
    return [_line(one, name, shares) for name in lines]


def _sources(one):
    """The sources of one output, those of several inputs with them as their parts."""
    inputs, contributions = one.inputs, one.sensitivities[0] * one.inputs.u
    return [
        replace(
            source,
            parts=tuple(Source(inputs.names[i], contributions[[[i]]]) for i in group),
            correlation=inputs.correlation[np.ix_(group, group)],
        )
        for source, group in zip(one.sources, inputs.groups, strict=True)
    ]


def _line(one, name, shares):
    inputs = one.inputs
    members = [i for i, item in enumerate(inputs.inputs) if item.line == name]
    first, alone = inputs.inputs[members[0]], len(members) == 1
    places = [np.flatnonzero(np.isin(group, members)) for group in inputs.groups]
    parts = {
        number: None if len(own) == len(inputs.groups[number]) else own
        for number, own in enumerate(places)
        if len(own)
    }
    return BudgetRow(
        name=name,
        unit=first.unit,
        type=first.type,
        distribution=first.distribution.name,
        dof=float(inputs.dof[members].min()),
        note=first.note,
        is_default=first.is_default,
        estimate=float(inputs.estimates[members[0]]) if alone else np.nan,
        u=float(inputs.u[members[0]]) if alone else np.nan,
        sensitivity=float(one.sensitivities[0, members[0]]) if alone else np.nan,
        correlations=_correlations(inputs, members),
        **shares.of_line(parts),
    )


def _correlations(inputs, members):
    """What a line of one input is correlated with; () of a family, whose members are together."""
    if len(members) > 1:
        return ()
    row = inputs.correlation[members[0]]
    others = (i for i in range(len(row)) if i != members[0] and row[i])
    return tuple((inputs.names[i], float(row[i])) for i in others)
