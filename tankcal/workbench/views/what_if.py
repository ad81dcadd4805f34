"""Budget of a volume with changed standard uncertainties of its lines.

U follows from the law of propagation, as in the budget of the report. If the certificate states a U
by Monte Carlo, this U differs, and the answer states the difference of method.
"""

from dataclasses import dataclass, replace

from tankcal.record.schema import to_plain
from tankcal.record.table import budget_lines
from tankcal.report.numbers import degrees_of_freedom
from tankcal.report.tables import Column
from tankcal.report.uncertainty.budget import budget_table
from tankcal.report.web import block_html
from tankcal.text.digits import UNKNOWN_DECIMALS, decimals_of, fixed


@dataclass(frozen=True)
class ChangedBudget:
    """Budgets without and with changed standard uncertainties.

    Attributes
    ----------
    now, then : Budget
        Budget without and with the factors.
    names : tuple of str
        Names of the lines in the language.
    factors : tuple of float
        Factor of u of each line.
    is_simulated : bool
        Whether the certificate states this U by Monte Carlo.
    """

    now: object
    then: object
    names: tuple[str, ...]
    factors: tuple[float, ...]
    is_simulated: bool = False


def change_budget(result, paper, high_m, low_m=None, factors=None):
    """Compute the budget of a dip, or of a delivery between two dips, with factors of u.

    Parameters
    ----------
    result : Result
        Result of the job.
    paper : Paper
        Paper of its record, for the names of the lines.
    high_m, low_m : float
        Dips, m; with low_m None, the volume below high_m.
    factors : dict, optional
        Factors of u, {index of a line: factor}; 1 for other lines.

    Returns
    -------
    ChangedBudget

    Raises
    ------
    HeightError
        For a dip outside the table.
    """
    now = result.budget(high_m, low_m)
    all_factors = tuple(float((factors or {}).get(i, 1.0)) for i in range(len(now.lines)))
    then = result.budget(high_m, low_m, factors=all_factors)
    names = tuple(paper.input_name(line) for line in to_plain(budget_lines(now.lines)))
    stated = result.at(high_m) if low_m is None else result.delivery(low_m, high_m)
    return ChangedBudget(now, then, names, all_factors, stated.interval == "monte_carlo")


def budget_sentences(paper, changed):
    """Sentences with volume, U, k and degrees of freedom, without and with the factors."""
    now, then = changed.now, changed.then
    lines = [
        paper.word(
            "views.budget_now",
            volume=paper.number(now.volume_m3, "m3", u=now.U_m3),
            **_totals(paper, now),
        )
    ]
    if any(factor != 1.0 for factor in changed.factors):
        change = 100 * (then.U_m3 / now.U_m3 - 1) if now.U_m3 > 0 else 0.0
        lines.append(
            paper.word(
                "views.budget_then",
                **_totals(paper, then),
                change=f"{'+' if change > 0 else ''}{fixed(change, 1, paper.marks)}",
            )
        )
    if changed.is_simulated:
        lines.append(paper.word("views.budget_simulated"))
    return lines


def _totals(paper, budget):
    """Texts of U, u, k and degrees of freedom of a budget."""
    return {
        "U": paper.number(budget.U_m3, "m3", u=budget.U_m3),
        "u": paper.number(budget.u_m3, "m3", u=budget.u_m3),
        "k": paper.number(budget.k, decimals=2),
        "dof": degrees_of_freedom(budget.dof, paper.marks),
    }


def table_html(paper, changed):
    """HTML table of the lines of the budget with the factors."""
    U = changed.now.U_m3
    table = budget_table(decimals_of(U) + 1 if U > 0 else UNKNOWN_DECIMALS)
    table = table.only("input", "u", "unit", "how", "dof", "contribution_m3", "share")
    factor = Column("factor", decimals=2, heading="factor_of_u")
    input_, *others = table.columns
    lines = to_plain(budget_lines(changed.then.lines))
    rows = [line | {"factor": value} for line, value in zip(lines, changed.factors, strict=True)]
    shown = replace(table, columns=(input_, factor, *others))
    return block_html(paper.show(shown, rows, on="budget_what_if").data)
