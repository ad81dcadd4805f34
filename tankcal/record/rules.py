"""The part of the record that says what the decision rule says of the table."""

from tankcal.record.schema import Saved, filled_from, key


class RuleOfTable(Saved):
    """The decision rule."""

    name: str = key("as shipped or written")
    source: str = key("where its values were read")
    verified: bool = key("whether all of them were read in the legal text itself")
    remark: str = key("what is to stand beside it")
    largest_capacity_m3: float | None = key("tanks up to which it is for; null: all")


class UncertaintyJudged(Saved):
    """A limit of the expanded uncertainty U, and what became of it."""

    name: str = key("of the limit", of="limit.name")
    of: str = key('"volumes", "capacity" or "deliveries"', of="limit.of")
    limit: float | None = key("part of relative_to; null: only stated", of="limit.limit")
    relative_to: str = key('"itself" or "capacity"', of="limit.relative_to")
    minimum_height_m: float | None = key("of a delivery", of="limit.minimum_height_m")
    clause: str = key("where it stands", of="limit.clause")
    verified: bool = key("whether it was read there", of="limit.verified")
    code: str = key("of the verdict")
    passed: bool | None = key("null: nothing is limited, or nothing was judged")
    from_m: float | None = key("dip from which the limit is kept")
    from_m3: float | None = key("volume there")
    worst_low_m: float | None = key("lower dip of the worst delivery")
    worst_m: float | None = key("dip of the worst volume")
    worst_m3: float | None = key("the worst volume")
    worst_U_m3: float | None = key("its expanded uncertainty")
    worst_ratio: float | None = key("U over what it is relative to; null: also infinite")


class DeviationJudged(Saved):
    """A limit of the deviation from a stated volume, and what became of it."""

    name: str = key("of the limit", of="limit.name")
    of: str = key('"volumes", "capacity" or "deliveries"', of="limit.of")
    limit: float | None = key("part of the stated volume", of="limit.limit")
    limit_m3: float | None = key("or an amount", of="limit.limit_m3")
    side: str = key('"both", "upper" or "lower"', of="limit.side")
    guard: str = key('guard band: "none" or "U"', of="limit.guard")
    clause: str = key("where it stands", of="limit.clause")
    verified: bool = key("whether it was read there", of="limit.verified")
    stated_m3: float = key("stated volume", of="stated.volume_m3")
    low_m: float | None = key("lower dip of a delivery", of="stated.low_m")
    high_m: float = key("dip", of="stated.high_m")
    code: str = key("of the verdict")
    passed: bool | None = key("null: the dip is not for use")
    volume_m3: float = key("of the table")
    u_m3: float = key("as printed")
    U_m3: float = key("as printed")
    k: float = key("of the table")
    dof: float = key("of the table; null: infinite")
    deviation_m3: float = key("table less stated")
    tolerance_m3: list[float] = key("T_L and T_U of the volume; null: not limited")
    accepted_m3: list[float] = key("A_L and A_U; null: not limited")
    guard_m3: float = key("guard band w")
    probability: float = key("of conformity")


class TableJudged(Saved):
    """The verdict of the job's decision rule on the table."""

    rule: RuleOfTable = key("the rule")
    tank: str = key("kind of tank that it was asked for")
    code: str = key("of the verdict, see below")
    verified: bool = key("whether every value that was used was read in the legal text itself")
    capacity_m3: float = key("of the highest row for use; null: no row is")
    uncertainty: list[UncertaintyJudged] = key("limits of U")
    deviation: list[DeviationJudged] = key("limits of the deviation from stated volumes")
    unjudged: list[str] = key("names of limits that nothing was held against")


def rule_of(verdict):
    """`TableJudged` of a `RuleVerdict`; None without one."""
    return verdict and filled_from(
        TableJudged,
        verdict,
        rule=filled_from(RuleOfTable, verdict.rule),
        uncertainty=[filled_from(UncertaintyJudged, one) for one in verdict.uncertainty],
        deviation=[filled_from(DeviationJudged, one) for one in verdict.deviation],
    )
