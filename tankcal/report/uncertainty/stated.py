"""The uncertainty that is stated: of the rows of the table, of single volumes, of deliveries.

Where Monte Carlo does not validate the GUM interval its own interval counts, and U is the larger
distance of its ends from the volume (docs/uncertainty.md).
"""

from tankcal.text.digits import decimals_of

MONTE_CARLO = "monte_carlo"
MARK = "*"
_SAME_M = 1e-9


def stated_U_m3(capacity):
    """U of every row, as it is printed."""
    return capacity.get("stated_U_m3", capacity["U_m3"])


def by_monte_carlo(capacity):
    """For every row whether its interval is Monte Carlo's."""
    return [code == MONTE_CARLO for code in capacity.get("interval", ["gum"] * _count(capacity))]


def k_of_rows(capacity):
    """The coverage factor of every row; None where U is not k u, but Monte Carlo's."""
    pairs = zip(capacity["k"], by_monte_carlo(capacity), strict=True)
    return [None if simulated else k for k, simulated in pairs]


def uneven_rows(capacity):
    """Numbers of the rows whose interval is not even about the volume to the last digit of U."""
    found = []
    for row, (simulated, U) in enumerate(
        zip(by_monte_carlo(capacity), stated_U_m3(capacity), strict=True)
    ):
        if simulated:
            values = (capacity[key][row] for key in ("volume_m3", "low_m3", "high_m3"))
            if _is_uneven(*values, U):
                found.append(row)
    return found


def stated_rows(record):
    """The volumes and deliveries of `budgets` as rows of a table, as they are stated.

    Keys low_m, high_m, volume_m3, U_m3, k (None: Monte Carlo's), dof (None: infinite), relative
    (None: no volume), low_m3, high_m3 (None where even about the volume), simulated, for_use,
    minimum_m, the minimum height of which it is the worst delivery (None: of none), and stated_m3
    and note, as stated.csv has them.

    There are none where no input of the table was uncertain and nobody asked for a volume: what
    a reading adds is all that their U would hold, and be read as that of the tank.
    """
    budgets = record.get("budgets", [])
    asked = any(one.get("stated_m3") is not None or one.get("note") for one in budgets)
    if not asked and not any(stated_U_m3(record["capacity"])):
        return []
    return [_stated(record, one) for one in budgets]


def _stated(record, one):
    U, low, high = one.get("stated_U_m3", one["U_m3"]), one.get("low_m3"), one.get("high_m3")
    simulated, volume = one.get("interval") == MONTE_CARLO, one["volume_m3"]
    if not (simulated and _is_uneven(volume, low, high, U)):
        low = high = None
    return {
        **{key: one[key] for key in ("low_m", "high_m", "volume_m3", "for_use")},
        "U_m3": U,
        "k": None if simulated else one["k"],
        "dof": one.get("dof"),
        "relative": U / volume if volume else None,
        "low_m3": low,
        "high_m3": high,
        "simulated": simulated,
        "minimum_m": _minimum(record, one),
        "stated_m3": one.get("stated_m3"),
        "note": one.get("note"),
    }


def _minimum(record, one):
    """The minimum height whose worst delivery this one is."""
    for worst in record.get("deliveries") or []:
        if same(worst["at_minimum"], one):
            return worst["minimum_m"]
    return None


def same(one, other):
    """Whether two deliveries, or None, are between the same dips."""
    if one is None or other is None or other["low_m"] is None:
        return False
    return all(abs(one[key] - other[key]) < _SAME_M for key in ("low_m", "high_m"))


def _is_uneven(volume, low, high, U):
    return abs((high - volume) - (volume - low)) > 10.0 ** -decimals_of(U)


def _count(capacity):
    return len(capacity["volume_m3"])
