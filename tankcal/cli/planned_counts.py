"""Numbers of the items of a plan in words: 1 photograph, 2 photographs."""

from tankcal.messages import message

KINDS = (
    *("photographs", "setups", "ties", "bases", "control", "targets"),
    *("straps", "lines", "offsets", "hits", "tangents", "runs", "batches"),
)


def plan_holds(plan, counts):
    """Return the items of a plan in words.

    counts  {kind, of KINDS: number}
    """
    parts = [counted(kind, count) for kind, count in counts.items() if count]
    return message("plan_holds", "{tank}: {parts}", tank=plan.job.tank.id, parts=parts)


def counted(kind, count):
    """Return the number of items of a kind, of KINDS, in words."""
    singular, plural = {
        "photographs": (
            message("plan_one_photograph", "{count} photograph", count=count),
            message("plan_photographs", "{count} photographs", count=count),
        ),
        "setups": (
            message("plan_one_setup", "{count} set-up", count=count),
            message("plan_setups", "{count} set-ups", count=count),
        ),
        "ties": (
            message("plan_one_tie", "{count} tie", count=count),
            message("plan_ties", "{count} ties", count=count),
        ),
        "bases": (
            message("plan_one_base", "{count} base of a stadia", count=count),
            message("plan_bases", "{count} bases of a stadia", count=count),
        ),
        "control": (
            message("plan_one_control_point", "{count} control point", count=count),
            message("plan_control", "{count} control points", count=count),
        ),
        "targets": (
            message("plan_one_target", "{count} target", count=count),
            message("plan_targets", "{count} targets", count=count),
        ),
        "straps": (
            message("plan_one_strap", "{count} tape reading", count=count),
            message("plan_straps", "{count} tape readings", count=count),
        ),
        "lines": (
            message("plan_one_line", "{count} reference line", count=count),
            message("plan_lines", "{count} reference lines", count=count),
        ),
        "offsets": (
            message("plan_one_offset", "{count} offset", count=count),
            message("plan_offsets", "{count} offsets", count=count),
        ),
        "hits": (
            message("plan_one_hit", "{count} hit of the wall", count=count),
            message("plan_hits", "{count} hits of the wall", count=count),
        ),
        "tangents": (
            message("plan_one_tangent", "{count} tangent", count=count),
            message("plan_tangents", "{count} tangents", count=count),
        ),
        "runs": (
            message("plan_one_run", "{count} run of liquid", count=count),
            message("plan_runs", "{count} runs of liquid", count=count),
        ),
        "batches": (
            message("plan_one_batch", "{count} batch", count=count),
            message("plan_batches", "{count} batches", count=count),
        ),
    }[kind]
    return singular if count == 1 else plural
