"""What if this u were half: the budget of a volume with other u of its lines.

U comes of the law of propagation and of the table alone, as the budget of the papers; where the
certificate states U by Monte Carlo this is not that U, and the answer says so.
"""

from dataclasses import dataclass, replace

from tankcal.record.plain_data import to_plain
from tankcal.record.statements import budget_lines
from tankcal.report.numbers import degrees_of_freedom
from tankcal.report.tables import Column
from tankcal.report.uncertainty.budget import budget_table
from tankcal.report.web import block_html
from tankcal.text.digits import UNKNOWN_DECIMALS, decimals_of, fixed


@dataclass(frozen=True)
class Supposed:
    """The budget as it is, and with the factors.

    Attributes
    ----------
    now, then : Budget
    names : tuple of str
        Of the lines, in words.
    factors : tuple of float
    is_simulated : bool
        Does the certificate state U by Monte Carlo there?
    """

    now: object
    then: object
    names: tuple[str, ...]
    factors: tuple[float, ...]
    is_simulated: bool = False


def suppose(result, paper, high_m, low_m=None, factors=None):
    """`Supposed` of a dip, or of the delivery between two dips.

    Parameters
    ----------
    result : Result
    paper : Paper
        Of its record.
    high_m, low_m : float
        Dips, m; low_m None: the volume below high_m.
    factors : dict, optional
        {number of a line: factor of its u}; lines that are not there stay as they are.

    Raises
    ------
    HeightError
        For a dip outside the table.
    """
    now = result.budget(high_m, low_m)
    every = tuple(float((factors or {}).get(i, 1.0)) for i in range(len(now.lines)))
    then = result.budget(high_m, low_m, factors=every)
    names = tuple(paper.input_name(one) for one in to_plain(budget_lines(now.lines)))
    stated = result.at(high_m) if low_m is None else result.delivery(low_m, high_m)
    return Supposed(now, then, names, every, stated.interval == "monte_carlo")


def sentences(paper, supposed):
    """What the budget comes to, now and then."""
    now, then = supposed.now, supposed.then
    said = [
        paper.word(
            "views.budget_now",
            volume=paper.number(now.volume_m3, "m3", u=now.U_m3),
            **_totals(paper, now),
        )
    ]
    if any(one != 1.0 for one in supposed.factors):
        change = 100 * (then.U_m3 / now.U_m3 - 1) if now.U_m3 > 0 else 0.0
        said.append(
            paper.word(
                "views.budget_then",
                **_totals(paper, then),
                change=f"{'+' if change > 0 else ''}{fixed(change, 1, paper.marks)}",
            )
        )
    if supposed.is_simulated:
        said.append(paper.word("views.budget_simulated"))
    return said


def _totals(paper, budget):
    return {
        "U": paper.number(budget.U_m3, "m3", u=budget.U_m3),
        "u": paper.number(budget.u_m3, "m3", u=budget.u_m3),
        "k": paper.number(budget.k, decimals=2),
        "dof": degrees_of_freedom(budget.dof, paper.marks),
    }


def table_html(paper, supposed):
    """The lines with what each brings then, as HTML."""
    U = supposed.now.U_m3
    table = budget_table(decimals_of(U) + 1 if U > 0 else UNKNOWN_DECIMALS)
    table = table.only("input", "u", "unit", "how", "dof", "contribution_m3", "share")
    factor = Column("factor", decimals=2, heading="factor_of_u")
    input_, *others = table.columns
    lines = to_plain(budget_lines(supposed.then.lines))
    rows = [line | {"factor": one} for line, one in zip(lines, supposed.factors, strict=True)]
    shown = replace(table, columns=(input_, factor, *others))
    return block_html(paper.show(shown, rows, on="budget_what_if").data)
