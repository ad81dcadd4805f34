"""The part of the record that says what was decided against the search for blunders, and why."""

from tankcal.record.schema import Saved, filled_from, key


class OverrulingRecord(Saved):
    """A point or a reading that was decided by hand."""

    what: str = key("its name: a point, or table and row of a reading")
    kind: str = key('"point" or "reading"')
    decision: str = key('"keep" or "leave_out"')
    reason: str = key("as given")
    by: str = key('who decided; "": not given')
    date: str = key('when; "": not given')
    searched: str | None = key(
        'what the search alone does with it: "" it uses it, "removed" a reading, "no_solution", or'
        " the reason of a rejected point; null: not computed"
    )
    off_m: float | None = key("from the wall as the search alone has it, outwards; null: a reading")
    w: float | None = key("its normalised residual there; null: none was computed")
    moved_m3: float | None = key(
        "volume of the top row less that without this decision; null: not computed"
    )
    is_outrageous: bool = key("kept, and so far off that it is told as a warning")
    row: int | None = key("of the file")


class OverrulingsRecord(Saved):
    """All decisions, and what they change together."""

    each: list[OverrulingRecord] = key("in the order of the file")
    moved_m3: float | None = key(
        "volume of the top row less that of the search alone; null: not computed, or that has no"
        " sound solution"
    )
    others: list[str] = key("points and readings without decision that changed sides")


def overrulings_of(result):
    """`OverrulingsRecord` of a result; None where nothing was decided."""
    found = result.overrulings
    if found is None:
        return None
    return filled_from(
        OverrulingsRecord,
        found,
        each=[
            _saved(
                one.decision,
                searched=one.searched,
                off_m=one.off_m,
                w=one.w,
                moved_m3=one.moved_m3,
                is_outrageous=one.is_outrageous,
            )
            for one in found.each
        ],
    )


def overrulings_of_adjustment(job):
    """The same of a survey that was only adjusted: its readings, without what that changed."""
    decided = [one for one in getattr(job, "overrulings", ()) if one.table is not None]
    if not decided:
        return None
    nothing = dict.fromkeys(("searched", "off_m", "w", "moved_m3"))
    each = [_saved(one, is_outrageous=False, **nothing) for one in decided]
    return OverrulingsRecord(each=each, moved_m3=None, others=[])


def _saved(decision, **found):
    return OverrulingRecord(
        what=decision.what,
        kind="point" if decision.table is None else "reading",
        decision=decision.decision,
        reason=decision.reason,
        by=decision.by,
        date=decision.date,
        row=decision.row,
        **found,
    )
