"""Checks of the numbers of a record: table, uncertainty, coverage, budgets, capability of the CMC.

U is computed again from the record by other ways than it was stated: u of a row from the covariance
factor, k from the degrees of freedom, and the verdict of Monte Carlo from its saved results.
"""

import math

import numpy as np

from tankcal.gum.coverage import coverage_factor
from tankcal.job.plausibility_table import CODES
from tankcal.messages import message
from tankcal.products.assess.requirements import MINOR, OBSERVATION, Finding
from tankcal.products.linter.linting import lint
from tankcal.record.covariance_factor import factor_of
from tankcal.report.laboratory import find_capability, is_outside_scope
from tankcal.report.outputs import RECORD
from tankcal.report.uncertainty.stated import MONTE_CARLO, stated_U_m3

_SAME = 1e-6  # largest relative difference of equal numbers of a record
_SAME_M = 1e-9  # largest difference of equal dips
LEAST_PROBABILITY, MOST_PROBABILITY = 0.94, 0.96  # "approximately 95 %" of ILAC-P14
LARGE_SHARE = 0.5  # share of the variance above which a default u is reported
MOST_REJECTED = 0.05  # share of rejected readings above which an assessor asks
# Typical U of a table by the annexes of ISO 7507, from memory; half of it makes an assessor ask.
USUAL_PERCENT, SMALL_PERCENT = 0.1, 0.05
MOST_ROWS_NAMED = 5  # rows named for a fault, at most


def check_table(evidence):
    """Yield faults of the table of the record: falling volumes, odd rows, wrong digits."""
    path = evidence.paper._path
    yield from check_lint(lint(path).findings, RECORD)


def check_lint(findings, file):
    """Yield each error that the linter found in a capacity table; its warnings are not errors."""
    for finding in findings:
        if finding.severity == "error":
            problem = finding.problem
            place = ", ".join(str(part) for part in (problem.column, problem.row) if part)
            text = message("assess_table", "capacity table: {finding}", finding=problem.expected)
            yield Finding(text, file=file, section=place)


def check_rows(evidence):
    """Yield rows without U, or whose U is not k u or the end of the Monte Carlo interval."""
    capacity = evidence.record["capacity"]
    volume, u, U, k = (np.array(capacity[key]) for key in ("volume_m3", "u_m3", "U_m3", "k"))
    stated = np.array(stated_U_m3(capacity))
    lacking = (volume > 0) & ~(stated > 0)
    if lacking.any():
        text = message(
            "assess_no_u", "{count} rows have no U, the first at {dip}",
            count=int(lacking.sum()), dip=_dip(capacity, np.argmax(lacking)),
        )  # fmt: skip
        yield Finding(text, file=RECORD, section="capacity.U_m3")
    wrong = ~_agree(U, k * u)
    if "interval" in capacity:
        by_law = np.array([source != MONTE_CARLO for source in capacity["interval"]])
        ends = np.maximum(
            volume - np.array(capacity["low_m3"], float),
            np.array(capacity["high_m3"], float) - volume,
        )
        wrong |= ~np.where(by_law, _agree(stated, U), _agree(stated, ends))
    for row in np.flatnonzero(wrong)[:MOST_ROWS_NAMED]:
        text = message(
            "assess_k_u", "U at {dip} is {U:.6g} m3, but k u is {product:.6g} m3",
            dip=_dip(capacity, row), U=float(stated[row]), product=float(k[row] * u[row]),
        )  # fmt: skip
        yield Finding(text, file=RECORD, section="capacity.U_m3")


def check_coverage(evidence):
    """Yield a coverage probability far from 95 %, and k that do not belong to it."""
    capacity = evidence.record["capacity"]
    probability = evidence.record["job"]["table"]["coverage_probability"]
    if not LEAST_PROBABILITY <= probability <= MOST_PROBABILITY:
        text = message(
            "assess_probability", "the coverage probability is {probability:.4g} %",
            probability=100 * probability,
        )  # fmt: skip
        yield Finding(text, file=RECORD, section="table.coverage_probability")
    factors = {}
    for row, (k, dof) in enumerate(zip(capacity["k"], capacity["dof"], strict=True)):
        if dof not in factors:
            factors[dof] = float(coverage_factor(probability, math.inf if dof is None else dof))
        if not math.isclose(k, factors[dof], rel_tol=_SAME):
            text = message(
                "assess_k_dof",
                "k at {dip} is {k:.4g}; {probability:.4g} % and {dof} degrees of freedom give "
                "{expected:.4g}",
                dip=_dip(capacity, row), k=k, probability=100 * probability,
                dof="∞" if dof is None else f"{dof:.3g}", expected=factors[dof],
            )  # fmt: skip
            yield Finding(text, file=RECORD, section="capacity.k")
            return


def check_propagation(evidence):
    """Yield the row whose u disagrees most with the covariance factor of the table."""
    capacity = evidence.record["capacity"]
    u, again = np.array(capacity["u_m3"]), np.linalg.norm(factor_of(capacity), axis=1)
    apart = np.abs(u - again)
    row = int(np.argmax(apart))
    if apart[row] > _SAME * max(u.max(), again.max()):
        text = message(
            "assess_factor",
            "u at {dip} is {u:.6g} m3, but the covariance of the table gives {again:.6g} m3",
            dip=_dip(capacity, row), u=float(u[row]), again=float(again[row]),
        )  # fmt: skip
        yield Finding(text, file=RECORD, section="capacity.u_m3")


def check_budgets(evidence):
    """Yield budgets whose shares do not add up to the variance."""
    for section, lines, _ in _budgets(evidence.record):
        total = sum(line["share"] for line in lines)
        if lines and not math.isclose(total, 1, rel_tol=_SAME):
            text = message(
                "assess_shares", "the shares of the variance add up to {total:.4g} %, not 100 %",
                total=100 * total,
            )  # fmt: skip
            yield Finding(text, file=RECORD, section=section)


def check_types(evidence):
    """Yield inputs evaluated as type A without degrees of freedom, or as both types."""
    types = {}
    for section, lines, _ in _budgets(evidence.record):
        for line in lines:
            types.setdefault(line["input"], {}).setdefault(line["type"], (section, line))
    for name, of_input in types.items():
        if len(of_input) > 1:
            text = message(
                "assess_types", "{name} is of type {types} in different budgets",
                name=name, types=" / ".join(sorted(of_input)),
            )  # fmt: skip
            yield Finding(text, MINOR, RECORD, section=of_input["A"][0])
        elif "A" in of_input and of_input["A"][1]["dof"] is None:
            text = message(
                "assess_type_a", "{name} is of type A, but has no degrees of freedom", name=name
            )
            yield Finding(text, MINOR, RECORD, section=of_input["A"][0])


def check_defaults(evidence):
    """Yield default uncertainties with more than half of the variance of the capacity."""
    for line in evidence.record["budget"]:
        if line["is_default"] and line["share"] > LARGE_SHARE:
            text = message(
                "assess_default",
                "u of {name} was not declared; its default has {share:.0f} % of the variance",
                name=evidence.paper.input_name(line), share=100 * line["share"],
            )  # fmt: skip
            yield Finding(text, OBSERVATION, RECORD, section="budget")


def check_undeclared(evidence):
    """Yield the inputs that affect the table and are not in U."""
    names = [
        name
        for choice in evidence.record["choices"]
        if choice["code"] == "not_in_budget"
        for name in choice["value"]
    ]
    if names:
        words = evidence.paper.words["inputs"]
        text = message(
            "assess_undeclared", "not in U, because not declared: {names}",
            names=[words.get(name, name) for name in names],
        )  # fmt: skip
        yield Finding(text, OBSERVATION, "uncertainty.csv")


def check_bias(evidence):
    """Yield known effects whose correction is switched off."""
    for row in evidence.record["corrections"]:
        if not row["applied"] and row["size_m3"]:
            text = message(
                "assess_bias",
                "{name}: not corrected, although its effect is known ({size:+.3g} m3)",
                name=evidence.paper.word(f"corrections.{row['code']}"), size=row["size_m3"],
            )  # fmt: skip
            yield Finding(text, OBSERVATION, RECORD, section="corrections")


def check_monte_carlo(evidence):
    """Yield rows whose stated interval contradicts the verdict of Monte Carlo."""
    simulated, capacity = evidence.record["monte_carlo"], evidence.record["capacity"]
    if not simulated or "interval" not in capacity:
        return
    rows = zip(simulated["rows"]["validated"], capacity["interval"], strict=True)
    wrong = [row for row, (ok, source) in enumerate(rows) if not ok and source != MONTE_CARLO]
    if wrong:
        text = message(
            "assess_not_validated",
            "{count} rows state U = k u, although Monte Carlo does not validate it, such as {dip}",
            count=len(wrong), dip=_dip(capacity, wrong[0]),
        )  # fmt: skip
        yield Finding(text, file=RECORD, section="monte_carlo")


def check_stated(evidence):
    """Yield stated volumes that differ from the row of the table at their dip."""
    capacity = evidence.record["capacity"]
    height, stated = np.array(capacity["height_m"]), stated_U_m3(capacity)
    for budget in evidence.record.get("budgets", ()):
        row = int(np.argmin(np.abs(height - budget["high_m"])))
        if budget["low_m"] is not None or abs(height[row] - budget["high_m"]) > _SAME_M:
            continue
        volume, U = capacity["volume_m3"][row], stated[row]
        of_budget = budget.get("stated_U_m3", budget["U_m3"])
        # U of a volume may include the reading of the table, so that it is not smaller.
        is_smaller = of_budget < U * (1 - _SAME)
        if not math.isclose(volume, budget["volume_m3"], rel_tol=_SAME) or is_smaller:
            text = message(
                "assess_two_values",
                "stated at {dip}: {volume:.7g} m3, U = {U:.2g} m3; in the table: {row_volume:.7g} "
                "m3, U = {row_U:.2g} m3",
                dip=_dip(capacity, row), volume=budget["volume_m3"], U=of_budget,
                row_volume=volume, row_U=U,
            )  # fmt: skip
            yield Finding(text, file=RECORD, section="budgets")


def check_capability(evidence):
    """Yield U below the CMC, and an accreditation that does not cover the tank."""
    letterhead, record = evidence.letterhead, evidence.record
    accreditation = evidence.entries.get("accreditation_number")
    if is_outside_scope(letterhead, record) and (accreditation or letterhead.get("mark")):
        text = message("assess_outside_scope", "refers to an accreditation that lacks this tank")
        yield Finding(text, file=RECORD, section="certificate.accreditation_number")
    capability = find_capability(letterhead, record)
    if capability is None:
        return
    capacity = record["capacity"]
    percent = 100 * stated_U_m3(capacity)[-1] / capacity["volume_m3"][-1]
    if percent < capability["percent"] * (1 - _SAME):
        text = message(
            "assess_below_cmc", "U of the capacity is {percent:.2g} %, below the CMC of {cmc:g} %",
            percent=percent, cmc=capability["percent"],
        )  # fmt: skip
        yield Finding(text, file=RECORD, section="capacity.U_m3")


def check_size(evidence):
    """Yield a relative U of the capacity that is smaller than surveys usually attain."""
    capacity = evidence.record["capacity"]
    percent = 100 * stated_U_m3(capacity)[-1] / capacity["volume_m3"][-1]
    if 0 < percent < SMALL_PERCENT:
        text = message(
            "assess_small_u",
            "U of the capacity is {percent:.2g} %, less than the usual {usual:g} % or more",
            percent=percent, usual=USUAL_PERCENT,
        )  # fmt: skip
        yield Finding(text, OBSERVATION, RECORD, section="capacity.U_m3")


def check_input(evidence):
    """Yield implausible input, a failed global test, and a large number of rejected readings."""
    for warning in evidence.record["warnings"]:
        if warning.get("code") in CODES:
            text = message("assess_doubt", "implausible input: {warning}", warning=warning["text"])
            place = (warning["file"] or RECORD, None, warning["column"] or "")
            yield Finding(text, OBSERVATION, *place)
    adjustment = evidence.record["adjustment"]
    if not adjustment:
        return
    if adjustment["passed"] is False:
        text = message(
            "assess_global_test",
            "the global test of the adjustment failed (sigma0 = {sigma0:.3g})",
            sigma0=adjustment["sigma0"],
        )  # fmt: skip
        yield Finding(text, MINOR, RECORD, section="adjustment")
    count, rejected = adjustment["observations"], len(adjustment["removed"])
    if rejected > MOST_REJECTED * count:
        text = message(
            "assess_rejected", "{rejected} of {count} observations were rejected",
            rejected=rejected, count=count,
        )  # fmt: skip
        yield Finding(text, OBSERVATION, RECORD, section="adjustment.removed")


def _budgets(record):
    """Yield (section of the record, lines, budget or None) of all budgets."""
    yield "budget", record["budget"], None
    for number, budget in enumerate(record.get("budgets", ())):
        yield f"budgets[{number}]", budget["lines"], budget


def _agree(first, second):
    """Flag equal numbers; a number that is missing on both sides is equal."""
    scale = np.maximum(np.abs(first), np.abs(second))
    return (np.abs(first - second) <= _SAME * scale) | (np.isnan(first) & np.isnan(second))


def _dip(capacity, row):
    """Dip of a row as printed, with the unit m if it is a length in metres."""
    dip = capacity["dip"][row]
    return dip if "'" in dip or " " in dip else f"{dip} m"
