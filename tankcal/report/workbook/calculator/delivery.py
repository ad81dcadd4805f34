"""A delivery between two dips with its U, the coverage factor, and the dip of a volume.

Formulas of the coverage factor for integer and non-integer degrees of freedom v.

The function TINV truncates degrees of freedom to integers, unlike the record. Up to v = 1000,
Student's t follows exactly from the beta distribution, since t^2 / (v + t^2) is Beta(1/2, v/2).
Above, Fisher's expansion is used up to the fourth power of 1/v. Source: Abramowitz and Stegun,
Handbook of Mathematical Functions, 26.5.27 and 26.7.5.

u^2 is the sum of squares of f(high) - f(low). f is a row of the covariance factor, interpolated
linearly between rows. k follows from the Welch-Satterthwaite formula over the sources
(tankcal.tank.deliveries).

Dip of a volume, by linear interpolation between two rows of the table.

A volume with more than one dip (rows of equal volume) has no result.
"""

import math
from bisect import bisect_left, bisect_right

import numpy as np

from tankcal.report.workbook.calculator.table import (
    NANOMETRE,
    Line,
    factor_formula,
    if_number,
    is_no_number,
    quoted,
)
from tankcal.text.digits import LITRE_DECIMALS, NOTHING
from tankcal.uncertainty import dof_of, least_of, sum_of_fourths

_MOST_BETA = 1000  # largest degrees of freedom for the beta distribution
_TERMS = (  # terms of the expansion: divisor, and coefficients of z, z^3, z^5, ...
    (4, (1, 1)),
    (96, (3, 16, 5)),
    (384, (-15, 17, 19, 3)),
    (92160, (-945, -1920, 1482, 776, 79)),
)


def normal(probability):
    """Return the formula of k for infinite degrees of freedom."""
    return f"NORMSINV((1+{probability!r})/2)"


def student(probability, dof, z):
    """Return the formula of k for finite degrees of freedom.

    Parameters
    ----------
    probability : float
        Coverage probability.
    dof : str
        Cell of the degrees of freedom.
    z : str
        Cell with k of the normal distribution (`normal`).

    Returns
    -------
    str
    """
    beta = f"BETAINV({probability!r},0.5,{dof}/2)"
    expansion = "0"
    # Horner's scheme in 1/dof, from the highest power.
    for divisor, coefficients in reversed(_TERMS):
        inner = "+".join(f"{c}*{z}^{2 * place + 1}" for place, c in enumerate(coefficients))
        expansion = f"(({inner})/{divisor}+{expansion})/{dof}"
    return f"IF({dof}>{_MOST_BETA},{z}+{expansion},SQRT({dof}*{beta}/(1-{beta})))"


_INFINITE = "1E+99"  # replaces infinite degrees of freedom in the workings
_SHOWN_INFINITE = "1E+15"  # degrees of freedom above which the form prints the sign of infinity


def state(table, number):
    """Return the line with the number of the sentence on the validity of the two dips."""
    both = "AND([low_dip_state]=#within,[high_dip_state]=#within)"
    formula = f"IF({both},IF([high_dip]-[low_dip]>1E-9,#delivery,#swapped),#no_delivery)"
    result = number("delivery" if table.low < table.at else "swapped")
    return Line("delivery_state", formula, result, 0)


def differences(table, names):
    """Return a line for each column of the factor: f(high) - f(low), m³ (list of Line).

    `names` are the names of the columns in the sheet of the factor.
    """
    lines = []
    for column, (name, value) in enumerate(zip(names, table.differences, strict=True), start=1):
        low, high = (_factor_at(dip, column) for dip in ("low_dip", "high_dip"))
        formula = f"IF([delivery_state]=#delivery,{high}-{low},{_NONE})"
        lines.append(Line(f"column_{column}", formula, _if(table, value), 6, "m³", label=name))
    return lines


_NONE = f'"{NOTHING}"'


def _if(table, value):
    """Return the value if the initial dips form a delivery, otherwise a dash."""
    return value if table.low < table.at else NOTHING


def _factor_at(dip, column):
    """Return the formula of a column of the factor at a dip, linear between two rows."""
    low, high = (
        f"SUM({factor_formula(f'[{dip}_{row}]', column, column)})" for row in ("row", "next")
    )
    return f"({low}*(1-[{dip}_part])+{high}*[{dip}_part])"


def combining(table, label):
    """Return the lines of u, degrees of freedom and k of a delivery (list of Line).

    `label` is a function of a `Group` that returns the label of the line of its variance.
    """
    groups = [group for group in table.groups() if math.isfinite(group.dof)]
    squares = [value**2 for value in table.differences]
    variances = [sum(squares[group.first : group.last + 1]) for group in groups]
    lines, shares = [], []
    for place, (group, variance) in enumerate(zip(groups, variances, strict=True), start=1):
        cells = f"[column_{group.first + 1}]:[column_{group.last + 1}]"
        formula = f"IF([delivery_state]=#delivery,SUMSQ({cells}),{_NONE})"
        name = label(group)
        lines.append(
            Line(f"variance_{place}", formula, _if(table, variance), "0.00E+00", "m⁶", label=name)
        )
        shares.append(f"[variance_{place}]^2/{group.dof!r}")
    dofs = [group.dof for group in groups]
    # Welch-Satterthwaite: dof = u^4 / sum(variance^2 / dof), at least the smallest dof.
    least = least_of(dofs)
    fourth = float(sum_of_fourths(np.array(variances), dofs))
    u = math.sqrt(sum(squares))
    dof = float(dof_of(sum(squares), fourth, least))
    z, k = table.coverage(dof)
    probability = table.job["table"]["coverage_probability"]
    every = f"[column_1]:[column_{len(squares)}]"
    is_delivery = "[delivery_state]=#delivery"
    shown_dof = dof if math.isfinite(dof) else float(_INFINITE)
    student_k = student(probability, "[delivery_dof]", "[normal]")
    return [
        *lines,
        Line(
            "delivery_u", f"IF({is_delivery},SQRT(SUMSQ({every})),{_NONE})", _if(table, u), 6, "m³"
        ),
        Line(
            "fourth",
            f"IF({is_delivery},{'+'.join(shares) or '0'},{_NONE})",
            _if(table, fourth),
            "0.00E+00",
        ),
        Line(
            "delivery_dof",
            if_number(
                "[fourth]",
                f"IF([fourth]>0,MAX([delivery_u]^4/[fourth],{least!r}),{_INFINITE})",
            ),
            _if(table, shown_dof),
            "0.0E+00",
        ),
        Line("normal", normal(probability), z, 6),
        Line("delivery_k", if_number("[delivery_dof]", student_k), _if(table, k), 6),
    ]


def _find_at_high(name):
    """Return the formula of a column of the table at the upper dip: the row with the larger U."""
    row, after = "[high_dip_row]", "[high_dip_next]"
    larger = f"IF(INDEX(capacity_U,{row})>INDEX(capacity_U,{after}),{row},{after})"
    return f"INDEX(capacity_{name},IF([high_dip_part]=0,{row},{larger}))"


def _choose_formula(of_delivery, of_volume):
    """Return the formula of a value of a delivery, or of its volume if that U is larger.

    Down to the empty tank, errors of two dips cancel in part only (docs/studies/propagation.md).
    """
    larger = f"{_find_at_high('U')}>=[delivery_k]*[delivery_u]*(1-1E-9)"  # equal to rounding
    is_whole = f"AND([low_dip_volume]=0,{larger})"
    return if_number("[delivery_k]", f"IF({is_whole},{of_volume},{of_delivery})")


def results(table, words):
    """Return the lines of the result of a delivery (list of Line)."""
    volume = table.volume_m3[table.at] - table.volume_m3[table.low]
    values = {line.key: line.result for line in combining(table, lambda group: "")}
    u, k, dof = values["delivery_u"], values["delivery_k"], values["delivery_dof"]
    U = NOTHING if u == NOTHING else k * u
    k_of_volume = _find_at_high("k")
    if table.has_interval:
        simulated = quoted(words["intervals"]["monte_carlo"])
        k_of_volume = f'IF({_find_at_high("interval")}="{simulated}",{_NONE},{k_of_volume})'
    is_empty = table.volume_m3[table.low] == 0
    if u != NOTHING and is_empty and table.U_m3[table.at] >= U * (1 - 1e-9):
        U, u, dof = table.U_m3[table.at], table.capacity["u_m3"][table.at], NOTHING
        k = NOTHING if table.k[table.at] is None else table.k[table.at]
    delivered = "[high_dip_volume]-[low_dip_volume]"
    looks = {"unit": "m³", "by": "delivered_U"}
    relative = NOTHING if U == NOTHING or not volume > 0 else U / volume
    endless = dof != NOTHING and dof > float(_SHOWN_INFINITE)
    return [
        Line(
            "delivered",
            f"IF([delivery_state]=#delivery,{delivered},{_NONE})",
            _if(table, volume),
            LITRE_DECIMALS,
            strong=True,
            remark="delivery_state",
            **looks,
        ),
        Line(
            "delivered_U",
            _choose_formula("[delivery_k]*[delivery_u]", _find_at_high("U")),
            U,
            0,
            strong=True,
            **looks,
        ),
        Line("delivered_k", _choose_formula("[delivery_k]", k_of_volume), k, 2),
        Line(
            "delivered_u",
            _choose_formula("[delivery_u]", _find_at_high("standard_u")),
            u,
            0,
            "m³",
            by="delivered_u",
        ),
        Line(
            "delivered_dof",
            _choose_formula(f'IF([delivery_dof]>{_SHOWN_INFINITE},"∞",[delivery_dof])', _NONE),
            "∞" if endless else dof,
            "[>=100]0;0.0",
        ),
        Line(
            "delivered_relative",
            if_number("[delivered]", f"IF([delivered]>0,[delivered_U]/[delivered],{_NONE})"),
            relative,
            "0.000 %",
        ),
    ]


_CUBIC_MICROMETRE = "1E-12"  # m³; tolerance for rounding


def finding(table, number):
    """Return the lines that determine the dip of the input `wanted` (list of Line)."""
    top = "MAX(MAX(capacity_volume),ROUND(MAX(capacity_volume),3))"
    inside = "IF([wanted_first]<[wanted_row],#no_single_dip,#wanted_within)"
    if table.critical is not None:
        low, high = table.critical
        zone = f"AND([wanted_dip]>{low!r}+{NANOMETRE},[wanted_dip]<{high!r}-{NANOMETRE})"
        inside = f"IF({zone},#wanted_critical,{inside})"
    if not table.rises:
        inside = "#volumes_fall"
    low, high = "INDEX(capacity_volume,[wanted_row])", "INDEX(capacity_volume,[wanted_next])"
    below, above = "INDEX(capacity_height,[wanted_row])", "INDEX(capacity_height,[wanted_next])"
    row, first = _rows(table)
    return [
        Line(
            "wanted_typed",
            f"IF(ISBLANK([wanted]),#wanted_blank,IF({is_no_number('[wanted]')},#no_number,"
            f"IF([wanted]<MIN(capacity_volume)-{_CUBIC_MICROMETRE},#wanted_below,"
            f"IF([wanted]>{top}+{_CUBIC_MICROMETRE},#wanted_above,#wanted_within))))",
            number("wanted_within"),
            0,
        ),
        _when_typed(
            "wanted_row",
            "MATCH(MAX([wanted],MIN(capacity_volume)),capacity_volume,1)",
            row + 1,
        ),
        _when_typed(
            "wanted_next", "MIN([wanted_row]+1,ROWS(capacity_volume))", table.after(row) + 1
        ),
        _when_typed(
            "wanted_first",
            f"IF([wanted]-{low}<={_CUBIC_MICROMETRE},MATCH({low},capacity_volume,0),[wanted_row])",
            first + 1,
        ),
        _when_typed(
            "wanted_dip",
            f"IF(OR([wanted_next]=[wanted_row],[wanted]<={low}),{below},"
            f"{below}+([wanted]-{low})/({high}-{low})*({above}-{below}))",
            table.height_m[row],
            6,
            "m",
        ),
        _when_typed("wanted_state", inside, number(_state(table)), otherwise="[wanted_typed]"),
    ]


def _rows(table):
    """Return (last, first) row with the initial volume."""
    volume = table.volume_m3[table.at]
    last = bisect_right(table.volume_m3, volume) - 1
    return last, min(bisect_left(table.volume_m3, volume), last)


def _state(table):
    """Return the key of the sentence on the initial volume."""
    row, first = _rows(table)
    if not table.rises:
        return "volumes_fall"
    return "no_single_dip" if first < row else "wanted_within"


def _when_typed(key, expression, result, digits=0, unit="", otherwise='"–"'):
    formula = f"IF([wanted_typed]=#wanted_within,{expression},{otherwise})"
    return Line(key, formula, result, digits, unit)


def reverse_results(table):
    """Return the line of the dip of the volume, in a list."""
    formula = 'IF([wanted_state]=#wanted_within,[wanted_dip],"–")'
    result = table.height_m[table.at] if _state(table) == "wanted_within" else NOTHING
    return [Line("dip_of_volume", formula, result, table.digits + 1, "m", strong=True)]
