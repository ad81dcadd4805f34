"""Decision rules, per jurisdiction, and their verdicts on a capacity table.

Data model of a decision rule: limits of the expanded uncertainty, limits of a deviation.

`PrintedU` holds printed expanded uncertainties, where they differ from those of the table.

Verdicts of a rule on a table: for expanded uncertainty, for deviation, and for the whole rule.

Limits of the expanded uncertainty
----------------------------------

U(h) <= limit V(h), or limit V(top). With a constant k, U is convex between rows and the limit is
linear, so a limit met at two neighbouring rows is met between them. No quantity is divided, so the
empty tank (V = 0) meets a limit only if U = 0 as well. Deliveries are judged over all dips by the
law of propagation, and simulated deliveries by their printed U. The simulated deliveries are the
worst one, and some to the lowest dip (`deliveries_to_judge`). There the volume cannot be negative,
and the errors of the two dips do not cancel according to the law of propagation.

Agreement with a stated volume
------------------------------

The tolerance interval about the stated volume is [T_L, T_U], and the guard band is U or 0; see
`tankcal.gum.conformity`.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.errors import HeightError
from tankcal.gum.conformity import Limit, RuleSet, conformity_probability, decide
from tankcal.messages import message
from tankcal.tank.deliveries import (
    Delivery,
    deliveries,
    least_delivery_m,
    ratio_of,
    worst_deliveries,
)

TANKS = (
    "vertical_fixed_roof",
    "vertical_floating_roof",
    "horizontal",
    "inclined",
    "sphere",
    "other",
)
UNCERTAINTY_OF = ("volumes", "capacity", "deliveries")
DEVIATION_OF = ("volumes", "capacity", "deliveries")
RELATIVE_TO = ("itself", "capacity")
SIDES = ("both", "upper", "lower")
GUARDS = ("none", "U")
FROM_LEVEL = ("lower_accurate",)
PERIOD_OF = ("all", "bottom_course")
PLATE = (  # entries of the identification plate of a tank
    *("laboratory", "tank_id", "certificate_number", "certificate_number_and_year"),
    *("survey_date", "date_of_issue", "nominal_volume", "capacity", "zero"),
    *("reference_height", "reference_temperature"),
)
LAYOUT = {  # layouts of a capacity table: key of [table] and its value
    "centimetres": ("heights_in", "cm"),
    "litres": ("volume_unit", "L"),
    "ullages": ("ullage", True),
}


@dataclass(frozen=True, kw_only=True)
class TankLimit(Limit):
    """Limit for some kinds of tank; (): for all."""

    tanks: tuple[str, ...]

    def applies_to(self, tank):
        """Whether the limit applies to a kind of tank."""
        return not self.tanks or tank in self.tanks


@dataclass(frozen=True, kw_only=True)
class UncertaintyLimit(TankLimit):
    """Limit of the expanded uncertainty U.

    Attributes
    ----------
    of : str
        "volumes": every row; "capacity": the highest row; "deliveries": all deliveries of at least
        minimum_height_m.
    limit : float or None
        Limit of U over the quantity in `relative_to`; None: U is to be stated, without limit.
    relative_to : str
        "itself": the row, the capacity, the delivered volume; "capacity".
    minimum_height_m : float or None
        Least height of a delivery; None for other limits.
    from_level : str or None
        "lower_accurate": the limit is valid from the lower limit of accurate capacity, the level
        from which all rows meet it and which the certificate states; None: everywhere.
    name, tanks, clause, verified
        As for a TankLimit.
    """

    of: str
    limit: float | None
    relative_to: str
    minimum_height_m: float | None
    from_level: str | None = None


@dataclass(frozen=True, kw_only=True)
class DeviationLimit(TankLimit):
    """Limit of the deviation of a volume from a stated volume.

    Attributes
    ----------
    of : str
        "volumes": at any dip; "capacity": of the highest row; "deliveries".
    limit : float or None
        Fraction of the stated volume.
    limit_m3 : float or None
        Absolute limit; one of limit and limit_m3 is None.
    side : str
        "both"; "upper": only larger volumes are limited; "lower": only smaller volumes.
    guard : str
        "none": accepted up to the limit; "U": up to the limit less U (JCGM 106:2012 8.3.2).
    in_service_factor : float
        Factor of the limit for a table in use, such as 2 for twice the limit of verification.
    name, tanks, clause, verified
        As for a TankLimit.
    """

    of: str
    limit: float | None
    limit_m3: float | None
    side: str
    guard: str
    in_service_factor: float = 1.0

    def in_service(self):
        """Return the limit for a table in use."""
        factor, limits = self.in_service_factor, (self.limit, self.limit_m3)
        limit, limit_m3 = (None if value is None else factor * value for value in limits)
        return replace(self, limit=limit, limit_m3=limit_m3, in_service_factor=1.0)


@dataclass(frozen=True, kw_only=True)
class ReferenceHeightLimit(TankLimit):
    """Limit of the change of the reference height since the previous calibration.

    Attributes
    ----------
    limit_m : float
    name, tanks, clause, verified
        As for a TankLimit.
    """

    limit_m: float


@dataclass(frozen=True, kw_only=True)
class Period(TankLimit):
    """Period of validity of a table.

    Attributes
    ----------
    of : str
        "all": the whole tank; "bottom_course": its lowest course.
    years : float
    name, tanks, clause, verified
        As for a TankLimit.
    """

    of: str
    years: float


@dataclass(frozen=True, kw_only=True)
class Rule(RuleSet):
    """Decision rule of a jurisdiction.

    Attributes
    ----------
    largest_capacity_m3 : float or None
        Largest capacity to which the rule applies; None: no limit.
    uncertainty, deviation
        Limits of a table.
    reference_height, periods
        Additional limits of a new table relative to the previous table.
    statements : tuple of str
        Sentences that the rule requires in a certificate, in the language of the rule.
    plate : tuple of str
        Entries of the identification plate, some of PLATE, in their order.
    layout : tuple of str
        Layouts that the rule requires of the table, some of LAYOUT.
    name, source, verified, remark
        As for a RuleSet.
    """

    largest_capacity_m3: float | None
    uncertainty: tuple[UncertaintyLimit, ...]
    deviation: tuple[DeviationLimit, ...]
    reference_height: tuple[ReferenceHeightLimit, ...] = ()
    periods: tuple[Period, ...] = ()
    statements: tuple[str, ...] = ()
    plate: tuple[str, ...] = ()
    layout: tuple[str, ...] = ()

    @property
    def limits(self):
        """All limits of the rule."""
        return (*self.uncertainty, *self.deviation, *self.reference_height, *self.periods)


@dataclass(frozen=True)
class PrintedU:
    """U of rows and deliveries as printed in reports: Monte Carlo where the GUM does not apply.

    Attributes
    ----------
    rows_m3 : ndarray, shape (rows,)
        U of the rows.
    by_gum : ndarray, shape (rows,), or None
        Whether U of a row is that of the table; None: all rows.
    pairs_m3 : dict
        {(low_m, high_m): U} of simulated deliveries.
    factor : float
        Factor on U of all other deliveries: the largest ratio among simulated deliveries with
        smooth volumes at both dips, at least 1.
    """

    rows_m3: np.ndarray
    by_gum: np.ndarray | None = None
    pairs_m3: dict = field(default_factory=dict)
    factor: float = 1.0

    def of(self, table, low_m, high_m, U_m3):
        """Return the printed U of a volume or of a delivery.

        Parameters
        ----------
        table : Capacity
        low_m : float or None
            Lower dip of a delivery, m; None: the volume below high_m.
        high_m : float
            Dip, m.
        U_m3 : float
            U of the table.

        Returns
        -------
        float
            For a delivery, the simulated U, otherwise `factor` times U of the table. For a volume
            at a row, U of the row. Between two rows, of which at least one differs from the table,
            the largest U of the rows and the table.
        """
        if low_m is not None:
            return self.pairs_m3.get((low_m, high_m), self.factor * U_m3)
        rows = table.rows_of(high_m)
        if self.by_gum is None or np.all(self.by_gum[rows]):
            return U_m3
        largest = float(self.rows_m3[rows].max())
        return largest if len(rows) == 1 else max(U_m3, largest)


def printed_of_table(table):
    """Return the `PrintedU` with the uncertainties of the table."""
    return PrintedU(table.U_m3)


AT_TOP_M = 1e-3  # a dip within a millimetre of the last row counts as the top
_ROUNDING = 1e-12  # relative tolerance: U equal to the limit meets it
_SAME_M = 1e-6  # heights of deliveries with a smaller difference are equal
# Codes of a legal limit: beyond it a value fails, whether or not U reaches back to it.
_CODES = {
    "passed": "conforms",
    "guard_band": "guard_band",
    "guard_band_beyond": "fails",
    "failed": "fails",
}
TO_LOWEST = 12  # number of simulated deliveries to the lowest dip for a limit


@dataclass(frozen=True)
class StatedVolume:
    """Stated volume for comparison with the table.

    Attributes
    ----------
    volume_m3 : float
    high_m : float
        Dip of the volume, or higher dip of a delivery.
    low_m : float or None
        Lower dip of a delivery; None: the volume below `high_m`.
    """

    volume_m3: float
    high_m: float
    low_m: float | None = None


@dataclass(frozen=True)
class DeviationVerdict:
    """Result of a DeviationLimit for a stated volume.

    Attributes
    ----------
    limit : DeviationLimit
    stated : StatedVolume
    code : str
        "conforms": in the acceptance interval; "guard_band": in the tolerance but not accepted;
        "fails": outside the tolerance; "not_for_use": the dip is in the critical zone of a roof.
    passed : bool or None
        True for "conforms", None for "not_for_use", else False.
    volume_m3, k, dof : float
        Volume of the table, coverage factor and degrees of freedom.
    U_m3, u_m3 : float
        As printed; if the printed U exceeds that of the table, u is increased in proportion.
    deviation_m3 : float
        Table less stated volume.
    tolerance_m3 : tuple[float, float]
        (T_L, T_U) of the volume; infinite on a side without limit.
    accepted_m3 : tuple[float, float]
        (A_L, A_U); A_L > A_U if the guard bands leave no acceptance interval.
    guard_m3 : float
        w.
    probability : float
        Probability of conformity, 0 to 1.
    """

    limit: DeviationLimit
    stated: StatedVolume
    code: str
    passed: bool | None
    volume_m3: float
    u_m3: float
    U_m3: float
    k: float
    dof: float
    deviation_m3: float
    tolerance_m3: tuple[float, float]
    accepted_m3: tuple[float, float]
    guard_m3: float
    probability: float


def judge_deviation(limit, table, stated, printed=None):
    """Return the DeviationVerdict of a limit, a Capacity and a StatedVolume, or None.

    None: the limit does not apply. A limit of deliveries applies to stated volumes with low_m,
    other limits to volumes without low_m. A limit of the capacity applies only within a millimetre
    of the last row of the table. Raises HeightError for a dip outside the table.

    Parameters
    ----------
    limit : DeviationLimit
    table : Capacity
    stated : StatedVolume
    printed : PrintedU, optional
        Printed uncertainties; None: those of the table.
    """
    if (limit.of == "deliveries") != (stated.low_m is not None):
        return None
    if limit.of == "capacity" and stated.high_m < table.height_m[-1] - AT_TOP_M:
        return None
    if stated.low_m is None:
        quantity = table.at(stated.high_m)
    else:
        quantity = table.delivery(stated.low_m, stated.high_m)
    U = (printed or printed_of_table(table)).of(table, stated.low_m, stated.high_m, quantity.U_m3)
    return judge_volume(limit, stated, quantity, U)


def judge_volume(limit, stated, quantity, U):
    """Return the DeviationVerdict of a limit and a StatedVolume for a volume.

    Parameters
    ----------
    limit : DeviationLimit
    stated : StatedVolume
    quantity : Quantity
        Volume for comparison, see `tankcal.tank.capacity`.
    U : float
        Printed expanded uncertainty, m3.
    """
    # The printed U may be that of Monte Carlo: u grows in proportion.
    u = quantity.u_m3 * U / quantity.U_m3 if quantity.U_m3 else 0.0
    tolerance = limit.limit * abs(stated.volume_m3) if limit.limit_m3 is None else limit.limit_m3
    # A one-sided limit has an infinite tolerance on the other side.
    lower = -math.inf if limit.side == "upper" else stated.volume_m3 - tolerance
    upper = math.inf if limit.side == "lower" else stated.volume_m3 + tolerance
    guard = U if limit.guard == "U" else 0.0
    decision = decide(quantity.value_m3, lower, upper, guard)
    code = _CODES[decision] if quantity.for_use else "not_for_use"
    return DeviationVerdict(
        limit=limit,
        stated=stated,
        code=code,
        passed=None if code == "not_for_use" else code == "conforms",
        volume_m3=quantity.value_m3,
        u_m3=u,
        U_m3=U,
        k=quantity.k,
        dof=quantity.dof,
        deviation_m3=quantity.value_m3 - stated.volume_m3,
        tolerance_m3=(lower, upper),
        accepted_m3=(lower + guard, upper - guard),
        guard_m3=guard,
        probability=float(conformity_probability(quantity.value_m3, u, lower, upper, quantity.dof)),
    )


@dataclass(frozen=True)
class UncertaintyVerdict:
    """Result of an UncertaintyLimit.

    Attributes
    ----------
    limit : UncertaintyLimit
    code : str
        "holds": everywhere; "holds_from": only from `from_m` on; "holds_accurate": from there on,
        and the limit is valid only from this level; "fails": nowhere; "stated": no limit is given;
        "nothing_to_judge": no row or delivery is for use.
    passed : bool or None
        True for "holds" and "holds_accurate", False for "holds_from" and "fails", else None.
    from_m : float or None
        Least dip from which on all rows meet the limit, or least height of such deliveries; None:
        none, or no limit is given.
    from_m3 : float or None
        Volume at that dip; None for deliveries.
    worst_low_m, worst_m : float or None
        Dips of the row or delivery closest to the limit or farthest beyond it; worst_low_m is None
        except for deliveries; both are None if no row or delivery is judged.
    worst_m3, worst_U_m3 : float or None
        Volume and U of that row or delivery.
    worst_ratio : float or None
        U over the quantity in relative_to (equal to the limit if it is just met); inf for an empty
        tank.
    """

    limit: UncertaintyLimit
    code: str
    passed: bool | None
    from_m: float | None = None
    from_m3: float | None = None
    worst_low_m: float | None = None
    worst_m: float | None = None
    worst_m3: float | None = None
    worst_U_m3: float | None = None
    worst_ratio: float | None = None


def judge_uncertainty(limit, table, lowest_m=None, printed=None):
    """Return the UncertaintyVerdict of an UncertaintyLimit for a Capacity.

    Parameters
    ----------
    limit : UncertaintyLimit
    table : Capacity
    lowest_m : float, optional
        Dip at the start of the calibrated zone; only rows from there on, and deliveries between
        them, are judged. None: all.
    printed : PrintedU, optional
        Printed uncertainties; None: those of the table. The search for deliveries uses the U of the
        table; the worst delivery and all simulated deliveries have their printed U.

    Raises
    ------
    HeightError
        For a lowest_m above the last row of the table.
    """
    if lowest_m is not None and lowest_m > table.height_m[-1]:
        raise HeightError(
            message(
                "lowest_above_table",
                "lowest level {lowest_m:g} m: the table ends at {end_m:g}",
                lowest_m=lowest_m,
                end_m=table.height_m[-1],
            )
        )
    judged_rows = table.for_use(table.height_m)
    if not np.any(judged_rows):
        return UncertaintyVerdict(limit, "nothing_to_judge", None)
    printed = printed or printed_of_table(table)
    capacity = float(table.volume_m3[judged_rows][-1])
    if lowest_m is not None:
        judged_rows &= table.height_m >= lowest_m
    if limit.of == "deliveries":
        return _judge_deliveries(limit, _restrict_table(table, lowest_m), capacity, printed)
    if limit.of == "capacity":
        judged_rows &= np.arange(len(judged_rows)) == np.flatnonzero(judged_rows).max(initial=-1)
    if not np.any(judged_rows):
        return UncertaintyVerdict(limit, "nothing_to_judge", None)
    return _judge_rows(limit, table, printed.rows_m3, np.flatnonzero(judged_rows), capacity)


def _restrict_table(table, lowest_m):
    """Return the table from a dip on."""
    if lowest_m is None:
        return table
    selected = table.height_m >= lowest_m
    sources = tuple(
        replace(source, columns_m3=source.columns_m3[selected]) for source in table.sources
    )
    rows = {name: getattr(table, name)[selected] for name in ("height_m", "volume_m3", "area_m2")}
    return replace(table, sources=sources, **rows)


def _judge_rows(limit, table, printed, rows, capacity):
    """Return the verdict of the rows of a table."""
    volume, U = table.volume_m3[rows], printed[rows]
    base = volume if limit.relative_to == "itself" else np.full(len(rows), capacity)
    ratio = ratio_of(U, base)
    # A product instead of a quotient: an empty tank has no ratio.
    is_met = limit.limit * base * (1 + _ROUNDING) >= U
    exceeded = np.flatnonzero(~is_met)
    # The limit is met from the row after the last row that exceeds it.
    first = exceeded[-1] + 1 if len(exceeded) else 0
    partly = "holds_accurate" if limit.from_level == "lower_accurate" else "holds_from"
    code = "holds" if not len(exceeded) else partly if first < len(rows) else "fails"
    worst = int(np.argmax(ratio))
    return UncertaintyVerdict(
        limit,
        code,
        code in ("holds", "holds_accurate"),
        from_m=None if code == "fails" else float(table.height_m[rows[first]]),
        from_m3=None if code == "fails" else float(volume[first]),
        worst_m=float(table.height_m[rows[worst]]),
        worst_m3=float(volume[worst]),
        worst_U_m3=float(U[worst]),
        worst_ratio=float(ratio[worst]),
    )


def deliveries_to_judge(limit, table):
    """Return ((low_m, high_m), ...) of the deliveries that decide a limit of deliveries.

    They are the deliveries with the largest U and the largest U over volume, and some to the lowest
    dip, from the least height to the whole table; only dips for use.
    """
    worst = worst_deliveries(table, limit.minimum_height_m)
    if worst is None:
        return ()
    lowest, top = table.height_m[0], table.height_m[-1]
    heights = np.linspace(limit.minimum_height_m, top - lowest, TO_LOWEST)
    highs = np.minimum(lowest + heights, top)
    usable = table.for_use(highs) & table.for_use(lowest)
    pairs = [(delivery.low_m, delivery.high_m) for delivery in (worst.absolute, worst.relative)]
    return (*pairs, *((float(lowest), float(high)) for high in highs[usable]))


def _judge_deliveries(limit, table, capacity, printed):
    """Return the verdict of the deliveries of a table."""
    worst_of_table = worst_deliveries(table, limit.minimum_height_m)
    if worst_of_table is None:
        return UncertaintyVerdict(limit, "nothing_to_judge", None)
    is_relative = limit.relative_to == "itself" or limit.limit is None
    judged = _list_printed_deliveries(
        worst_of_table.relative if is_relative else worst_of_table.absolute, limit, table, printed
    )

    def size(delivery):
        return delivery.relative if is_relative else delivery.U_m3

    worst = max(judged, key=size)
    ratio = worst.relative if is_relative else float(ratio_of(worst.U_m3, capacity))
    if limit.limit is None:
        return _delivery_verdict(limit, "stated", worst, ratio)
    bound = (limit.limit if is_relative else limit.limit * capacity) * (1 + _ROUNDING)
    exceeded_heights = [_height(delivery) for delivery in judged if size(delivery) > bound]
    if not exceeded_heights:
        return _delivery_verdict(limit, "holds", worst, ratio, limit.minimum_height_m)
    # The factor of printed over propagated U reduces the limit for deliveries without simulation.
    from_m = least_delivery_m(table, bound / printed.factor, is_relative)
    met_heights = [
        _height(delivery)
        for delivery in judged
        if _height(delivery) > max(exceeded_heights) + _SAME_M
    ]
    # A simulated delivery exceeds the limit above that height: use simulated heights only.
    if from_m is not None and max(exceeded_heights) > from_m - _SAME_M:
        from_m = float(np.ceil(1000 * min(met_heights) - 1e-6) / 1000) if met_heights else None
    code = "fails" if from_m is None else "holds_from"
    return _delivery_verdict(limit, code, worst, ratio, from_m)


def _list_printed_deliveries(worst, limit, table, printed):
    """Return the worst Delivery of the table and all simulated deliveries, with their printed U."""
    first, last = table.height_m[[0, -1]]
    least = limit.minimum_height_m - _SAME_M
    pairs = {(worst.low_m, worst.high_m): printed.of(table, worst.low_m, worst.high_m, worst.U_m3)}
    pairs |= {
        (low, high): U
        for (low, high), U in printed.pairs_m3.items()
        if low >= first and high <= last and high - low >= least
    }
    low, high = np.array(list(pairs)).T
    computed, U = deliveries(table, low, high), np.array(list(pairs.values()))
    k = ratio_of(U, computed.u_m3)
    fields = (low, high, computed.volume_m3, computed.u_m3, computed.dof, k, U)
    rows = zip(*fields, ratio_of(U, computed.volume_m3), strict=True)
    return [
        Delivery(*map(float, row))
        for row, for_use in zip(rows, computed.for_use, strict=True)
        if for_use
    ]


def _height(delivery):
    """Return the height of a delivery."""
    return delivery.high_m - delivery.low_m


def _delivery_verdict(limit, code, worst: Delivery, ratio, from_m=None):
    """Return the verdict for the worst delivery."""
    return UncertaintyVerdict(
        limit,
        code,
        {"holds": True, "stated": None}.get(code, False),
        from_m=from_m,
        worst_low_m=worst.low_m,
        worst_m=worst.high_m,
        worst_m3=worst.volume_m3,
        worst_U_m3=worst.U_m3,
        worst_ratio=ratio,
    )


@dataclass(frozen=True)
class RuleVerdict:
    """Verdict of a Rule for a table.

    Attributes
    ----------
    rule : Rule
    tank : str
        Kind of tank.
    code : str
        "passed": every limit is met everywhere; "passed_in_part": the uncertainty meets its limits
        from some level on; "failed"; "not_accepted": no limit fails, but a deviation is in a guard
        band; "stated": the rule has no numerical limit; "nothing_to_judge"; "not_all_judged": no
        limit failed, but `unjudged` limits could not be applied; "not_for_this_tank": no limit for
        the kind or capacity.
    verified : bool
        Whether all values in use were read in the legal text itself.
    capacity_m3 : float
        Volume of the highest row for use; nan: no row is for use.
    uncertainty, deviation
        Verdicts of the limits for this kind of tank.
    unjudged : tuple of str
        Names of the limits without a row, delivery or stated volume.
    """

    rule: Rule
    tank: str
    code: str
    verified: bool
    capacity_m3: float
    uncertainty: tuple[UncertaintyVerdict, ...]
    deviation: tuple[DeviationVerdict, ...]
    unjudged: tuple[str, ...]


def judge(rule, table, tank, lowest_m=None, stated=(), printed=None):
    """Return the RuleVerdict of a Rule for a Capacity of a kind of tank.

    Parameters
    ----------
    rule : Rule
    table : Capacity
    tank : str
        One of tankcal.tank.rules.TANKS.
    lowest_m : float, optional
        Dip at the start of the calibrated zone, see `judge_uncertainty`.
    stated : sequence of StatedVolume, optional
        Stated volumes for the deviations.
    printed : PrintedU, optional
        Printed uncertainties, such as Monte Carlo's; None: those of the table.

    Raises
    ------
    ValueError
        For an unknown kind of tank.
    HeightError
        For a dip outside the table.
    """
    if tank not in TANKS:
        raise ValueError(f"kind of tank {tank!r}: expected one of {', '.join(TANKS)}")
    printed = printed or printed_of_table(table)
    # The capacity is the volume of the highest row for use.
    rows = np.flatnonzero(table.for_use(table.height_m))
    capacity = float(table.volume_m3[rows[-1]]) if len(rows) else np.nan
    is_too_large = rule.largest_capacity_m3 is not None and capacity > rule.largest_capacity_m3
    limits = [] if is_too_large else [item for item in rule.uncertainty if item.applies_to(tank)]
    others = [] if is_too_large else [item for item in rule.deviation if item.applies_to(tank)]
    uncertainty = tuple(judge_uncertainty(item, table, lowest_m, printed) for item in limits)
    pairs = [judge_deviation(limit, table, item, printed) for limit in others for item in stated]
    deviation = tuple(verdict for verdict in pairs if verdict is not None)
    verdicts = (*uncertainty, *deviation)
    applied = [verdict.limit for verdict in verdicts]
    judged_limits = [v.limit for v in verdicts if v.code not in ("nothing_to_judge", "not_for_use")]
    # A limit without any verdict must be visible to the user.
    unjudged = tuple(item.name for item in (*limits, *others) if item not in judged_limits)
    return RuleVerdict(
        rule=rule,
        tank=tank,
        code=_rule_code(verdicts, unjudged) if limits or others else "not_for_this_tank",
        verified=all(limit.verified for limit in applied) if applied else rule.verified,
        capacity_m3=capacity,
        uncertainty=uncertainty,
        deviation=deviation,
        unjudged=unjudged,
    )


def deliveries_to_check(rule, table, tank):
    """Return the deliveries that decide the limits of a rule, each once.

    Parameters
    ----------
    rule : Rule
    table : Capacity
    tank : str
        Kind of tank.

    Returns
    -------
    tuple of (float, float)
        Lower and higher dip, m.
    """
    limits = [
        candidate
        for candidate in rule.uncertainty
        if candidate.of == "deliveries" and candidate.applies_to(tank)
    ]
    pairs = [pair for limit in limits for pair in deliveries_to_judge(limit, table)]
    return tuple(dict.fromkeys(pairs))


def _rule_code(verdicts, unjudged):
    """Return the code of the rule from the codes of its limits, the most severe first."""
    codes = {verdict.code for verdict in verdicts}
    if "fails" in codes:
        return "failed"
    if "guard_band" in codes:
        return "not_accepted"
    if "holds_from" in codes:
        return "passed_in_part"
    if any(verdict.passed for verdict in verdicts):
        return "not_all_judged" if unjudged else "passed"
    return "stated" if "stated" in codes else "nothing_to_judge"


__all__ = [
    "TANKS",
    "DeviationLimit",
    "DeviationVerdict",
    "PrintedU",
    "Rule",
    "RuleVerdict",
    "StatedVolume",
    "UncertaintyLimit",
    "UncertaintyVerdict",
    "deliveries_to_check",
    "judge",
]
