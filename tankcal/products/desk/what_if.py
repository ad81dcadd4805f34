"""Budget of a volume with changed standard uncertainties of its lines.

U follows from the law of propagation, as in the budget of the report. If the certificate states a U
by Monte Carlo, this U differs, and the answer states the difference of method.
"""

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace

from tankcal.gum.coverage import coverage_factor
from tankcal.record.schema import to_plain
from tankcal.record.table import budget_lines
from tankcal.report.numbers import degrees_of_freedom
from tankcal.report.tables import Column
from tankcal.report.uncertainty.budget import budget_table
from tankcal.report.web import block_html
from tankcal.text.digits import UNKNOWN_DECIMALS, decimals_of, fixed

LARGEST, STEP = 3.0, 0.05  # largest factor, and step of its slider
_STATED = ("volume_m3", "u_m3", "dof", "k", "U_m3")
STYLE = """<style>.tankcal-budget th, .tankcal-budget td { padding: 0 8px; line-height: 1.6;
  vertical-align: top } .tankcal-budget .left { text-align: left }
.tankcal-budget .right, .tankcal-budget .decimal { text-align: right; white-space: nowrap;
  font-variant-numeric: tabular-nums }</style>"""


@dataclass(frozen=True)
class ChangedBudget:
    """Budgets without and with changed standard uncertainties.

    Attributes
    ----------
    now, then : Budget
        Budget without and with the factors; of a record, an object with these numbers.
    names : tuple of str
        Names of the lines in the language.
    factors : tuple of float
        Factor of u of each line.
    is_simulated : bool
        Whether the certificate states this U by Monte Carlo.
    lines : list of dict
        Lines of the budget with the factors, as in a record.
    """

    now: object
    then: object
    names: tuple[str, ...]
    factors: tuple[float, ...]
    is_simulated: bool = False
    lines: list | None = None


def change_budget(result, paper, high_m, low_m=None, factors=None):
    """Compute the budget of a dip, or of a delivery between two dips, with factors of u.

    Parameters
    ----------
    result : Result
        Result of the job.
    paper : Paper
        Report of its record, for the names of the lines.
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
    is_simulated = stated.interval == "monte_carlo"
    lines = to_plain(budget_lines(then.lines))
    return ChangedBudget(now, then, names, all_factors, is_simulated, lines)


def list_recorded_budgets(paper):
    """Budgets of a record whose U can be computed again with factors.

    The capacity comes first, then the stated volumes and deliveries.

    Returns
    -------
    list of (int, str)
        Number for `change_recorded_budget`, and dips.
    """
    record, known = paper.record, []
    capacity = record["capacity"]
    if record["budget"]:
        known.append((0, paper.height(capacity["height_m"][-1])))
    for number, item in enumerate(record.get("budgets", ()), 1):
        ends = [item["low_m"], item["high_m"]]
        known.append((number, " - ".join(paper.height(end) for end in ends if end is not None)))
    return [item for item in known if change_recorded_budget(paper, item[0]) is not None]


def change_recorded_budget(paper, number, factors=None):
    """Compute a budget of a record with factors of u.

    Parameters
    ----------
    paper : Paper
        Report of the record.
    number : int
        0: the capacity; otherwise a stated budget, from 1.
    factors : dict, optional
        Factors of u, {index of a line: factor}; 1 for other lines.

    Returns
    -------
    ChangedBudget or None
        None if the lines do not determine U: unknown signs of correlated lines.
    """
    record = paper.record
    capacity, probability = record["capacity"], record["job"]["table"]["coverage_probability"]
    if number == 0:
        lines, source = record["budget"], {key: capacity[key][-1] for key in _STATED}
        is_simulated = (capacity.get("interval") or [""])[-1] == "monte_carlo"
    else:
        source = record["budgets"][number - 1]
        lines, is_simulated = source["lines"], source.get("interval") == "monte_carlo"
    now = SimpleNamespace(**{key: source[key] for key in _STATED})
    now.dof = math.inf if now.dof is None else now.dof
    all_factors = tuple(float((factors or {}).get(i, 1.0)) for i in range(len(lines)))
    u_m3, dof, _ = _combine_lines(lines, [1.0] * len(lines))
    if not (math.isclose(u_m3, now.u_m3, rel_tol=1e-6) and _is_same_dof(dof, now.dof)):
        return None
    u_m3, dof, variances = _combine_lines(lines, all_factors)
    k = coverage_factor(probability, dof) if u_m3 > 0 else now.k
    then = SimpleNamespace(volume_m3=now.volume_m3, u_m3=u_m3, dof=dof, k=float(k),
                           U_m3=float(k) * u_m3)  # fmt: skip
    total = u_m3**2 or 1.0
    changed = [
        line | {
            "u": None if line["u"] is None else factor * line["u"],
            "contribution_m3": factor * line["contribution_m3"], "share": variance / total,
        }
        for line, factor, variance in zip(lines, all_factors, variances, strict=True)
    ]  # fmt: skip
    names = tuple(paper.input_name(line) for line in lines)
    return ChangedBudget(now, then, names, all_factors, is_simulated, changed)


def _is_same_dof(first, second):
    """Whether two effective degrees of freedom give equal coverage factors."""
    return (math.isinf(first) and math.isinf(second)) or math.isclose(first, second, rel_tol=1e-3)


def _combine_lines(lines, factors):
    """u (m3), degrees of freedom, and parts of the variance of lines with factors.

    u^2 = sum f_i f_j r_ij c_i c_j (JCGM 100, 5.2.2); Welch and Satterthwaite (G.4.1).
    """
    signed = [
        factor * math.copysign(line["contribution_m3"], line["sensitivity"] or 1.0)
        for line, factor in zip(lines, factors, strict=True)
    ]
    place = {line["input"]: i for i, line in enumerate(lines)}
    variances = [
        part * part + sum(
            r * part * signed[place[name]]
            for name, r in line["correlations"] if name in place
        )
        for line, part in zip(lines, signed, strict=True)
    ]  # fmt: skip
    variance = max(sum(variances), 0.0)
    quartic = sum(
        part**4 / line["dof"]
        for line, part in zip(lines, signed, strict=True) if line["dof"] is not None
    )  # fmt: skip
    return math.sqrt(variance), variance**2 / quartic if quartic > 0 else math.inf, variances


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
    rows = [
        line | {"factor": value} for line, value in zip(changed.lines, changed.factors, strict=True)
    ]
    shown = replace(table, columns=(input_, factor, *others))
    return block_html(paper.show(shown, rows, on="budget_what_if").data)
