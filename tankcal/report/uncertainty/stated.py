"""Stated uncertainty of the rows of the table, of single volumes, and of deliveries.

If Monte Carlo does not validate the GUM interval, the Monte Carlo interval is stated. U is then the
larger distance of its ends from the volume (docs/uncertainty.md).
"""

from tankcal.text.digits import decimals_of

MONTE_CARLO = "monte_carlo"  # code of a Monte Carlo interval in the record
MARK = "*"  # mark of rows with a Monte Carlo interval
_SAME_M = 1e-9  # tolerance for equal dips


def stated_U_m3(capacity):
    """Return the stated U of all rows, m3."""
    return capacity.get("stated_U_m3", capacity["U_m3"])


def by_monte_carlo(capacity):
    """Return for all rows whether the interval is a result of Monte Carlo."""
    return [code == MONTE_CARLO for code in capacity.get("interval", ["gum"] * _count(capacity))]


def k_of_rows(capacity):
    """Return the coverage factors of all rows; None for a Monte Carlo interval."""
    pairs = zip(capacity["k"], by_monte_carlo(capacity), strict=True)
    return [None if simulated else k for k, simulated in pairs]


def uneven_rows(capacity):
    """Return the indices of rows whose interval is asymmetric within the digits of U."""
    indices = []
    for row, (simulated, U) in enumerate(
        zip(by_monte_carlo(capacity), stated_U_m3(capacity), strict=True)
    ):
        if simulated:
            values = (capacity[key][row] for key in ("volume_m3", "low_m3", "high_m3"))
            if _is_uneven(*values, U):
                indices.append(row)
    return indices


def stated_rows(record):
    """Return the stated volumes and deliveries of `budgets` as rows (list of dict).

    The list is empty if no input of the table is uncertain and no volume was requested. In this
    case U would contain the contribution of the reading only, and could be mistaken for the U of
    the tank.

    The keys are low_m, high_m, volume_m3, U_m3, k (None: Monte Carlo), dof (None: infinite),
    relative (None: volume 0), low_m3 and high_m3 (None: symmetric interval), simulated and for_use.
    minimum_m is the minimum height for which the delivery is the worst (or None). stated_m3 and
    note are taken from stated.csv.
    """
    budgets = record.get("budgets", [])
    asked = any(budget.get("stated_m3") is not None or budget.get("note") for budget in budgets)
    if not asked and not any(stated_U_m3(record["capacity"])):
        return []
    return [_stated(record, budget) for budget in budgets]


def _stated(record, budget):
    U, low, high = (
        budget.get("stated_U_m3", budget["U_m3"]),
        budget.get("low_m3"),
        budget.get("high_m3"),
    )
    simulated, volume = budget.get("interval") == MONTE_CARLO, budget["volume_m3"]
    if not (simulated and _is_uneven(volume, low, high, U)):
        low = high = None
    return {
        **{key: budget[key] for key in ("low_m", "high_m", "volume_m3", "for_use")},
        "U_m3": U,
        "k": None if simulated else budget["k"],
        "dof": budget.get("dof"),
        "relative": U / volume if volume else None,
        "low_m3": low,
        "high_m3": high,
        "simulated": simulated,
        "minimum_m": _minimum(record, budget),
        "stated_m3": budget.get("stated_m3"),
        "note": budget.get("note"),
    }


def _minimum(record, budget):
    """Return the minimum height for which a delivery is the worst, or None."""
    for worst in record.get("deliveries") or []:
        if same(worst["at_minimum"], budget):
            return worst["minimum_m"]
    return None


def same(first, second):
    """Return whether two deliveries have equal dips; False if one of them is None."""
    if first is None or second is None or second["low_m"] is None:
        return False
    return all(abs(first[key] - second[key]) < _SAME_M for key in ("low_m", "high_m"))


def _is_uneven(volume, low, high, U):
    return abs((high - volume) - (volume - low)) > 10.0 ** -decimals_of(U)


def _count(capacity):
    return len(capacity["volume_m3"])
