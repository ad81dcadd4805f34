"""The budget of one output: what brings how much, and what is worth measuring better.

JCGM 100:2008 5.1.3, 7.2.7, F; one line for each input, or family of inputs (points, say).
"""

from dataclasses import dataclass

import numpy as np

from tankcal.gum.distributions import name_of


@dataclass(frozen=True)
class BudgetRow:
    """One line of a budget.

    name, unit, type, distribution, dof, note   as the input declares them; of a family, the first
    is_default    nobody declared it
    estimate      in `unit`; nan of a family
    u             standard uncertainty in `unit`; nan of a family
    sensitivity   dy/dx, unit of the output by `unit`; nan of a family
    contribution  |dy/dx| u, of a family sqrt(c' U c), in the unit of the output
    share         of the variance; the shares add up to 1, negative where correlations take away
    halved        the factor of the expanded uncertainty if u were half as large: 0.9 is 10 % less
    correlations  ((name, r), ...) of the inputs that it is correlated with
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


def budget(result, row=0, probability=0.95):
    """The lines of output `row`, in the order of the inputs; sort by `halved` for what to improve.

    result  Propagation; probability  coverage probability of the expanded uncertainty in `halved`
    """
    one = result.rows([row])
    shares = one.shares()[0]
    expanded = one.expanded(probability)[0]
    lines = list(dict.fromkeys(item.line for item in result.inputs.inputs))
    return [_line(one, name, shares, expanded, probability) for name in lines]


def _line(one, name, shares, expanded, probability):
    inputs = one.inputs
    members = [i for i, item in enumerate(inputs.inputs) if item.line == name]
    first = inputs.inputs[members[0]]
    contributions = one.sensitivities[0, members] * inputs.u[members]
    correlation = inputs.correlation[np.ix_(members, members)]
    alone = len(members) == 1
    halved = one.scaled(name, 0.5).expanded(probability)[0]
    return BudgetRow(
        name=name,
        unit=first.unit,
        type=first.type,
        distribution=name_of(first.distribution),
        dof=float(inputs.dof[members].min()),
        note=first.note,
        is_default=first.is_default,
        estimate=float(inputs.estimates[members[0]]) if alone else np.nan,
        u=float(inputs.u[members[0]]) if alone else np.nan,
        sensitivity=float(one.sensitivities[0, members[0]]) if alone else np.nan,
        contribution=float(np.sqrt(max(contributions @ correlation @ contributions, 0.0))),
        share=float(np.sum(shares[members])),
        halved=float(halved / expanded) if expanded > 0 else 1.0,
        correlations=_correlations(inputs, members),
    )


def _correlations(inputs, members):
    """What a line of one input is correlated with; () of a family, whose members are together."""
    if len(members) > 1:
        return ()
    row = inputs.correlation[members[0]]
    others = (i for i in range(len(row)) if i != members[0] and row[i])
    return tuple((inputs.names[i], float(row[i])) for i in others)
