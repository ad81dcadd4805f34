"""What the terminal says of a plan of straps, reference lines, wall hits or tangents."""

from tankcal.cli.showing import marks
from tankcal.messages import message
from tankcal.text.digits import format_significant


def planned_setups(count):
    """That many set-ups."""
    return message("plan_setups", "{count} set-ups", count=count)


def plan_holds(plan, parts):
    """What a plan has, of what it may have."""
    parts = [part for part in parts if part.values["count"]]
    return message("plan_holds", "{tank}: {parts}", tank=plan.job.tank.id, parts=parts)


def wall_summary(prediction):
    """What was planned, and how well the radius of its courses will be known."""
    from tankcal.record.wall_plan import survey_of

    plan = prediction.plan
    has = survey_of(plan)
    parts = [
        message("plan_straps", "{count} readings of the tape", count=has.strap_readings),
        message("plan_lines", "{count} reference lines", count=has.lines),
        message("plan_offsets", "{count} offsets", count=has.offsets),
        planned_setups(has.setups),
        message("plan_hits", "{count} hits of the wall", count=has.hits),
        message("plan_tangents", "{count} tangents", count=has.tangents),
    ]
    yield plan_holds(plan, parts)
    for one in prediction.courses:
        yield message(
            "plan_course_radius",
            "course {course}: u of its mean radius {sd} mm",
            course=one.name,
            sd=format_significant(1000 * one.radius_sd_m, 2, marks()),
        )


def wall_item(change):
    """An item of a plan of the wall; None of other plans."""
    from tankcal.planning.wall.model import WallPlan

    name = change.name
    told = {
        "strap": message("plan_item_strap", "circumference {name}", name=name),
        "line": message("plan_item_lines", "{name} reference lines", name=name),
        "face": message("plan_item_face", "the second face of the plummet"),
        "level": message("plan_item_level", "the level {name} of each course", name=name),
        "hit": message("plan_item_hits", "hits of ring {name}, half as many as it has", name=name),
        "accuracy": message("plan_item_accuracy", "each reading of the tape, with half its s_mm"),
        "station": message(
            "plan_item_station", "a station of the traverse, all {name} from the axis", name=name
        ),
        "traverse": message(
            "plan_item_traverse", "each reading between stations, with half its s_mm and s_arcsec"
        ),
        "certificate": message(
            "plan_item_certificate", "the calibration of {name}, with half its u", name=name
        ),
    }
    if change.item == "setup" and isinstance(change.plan, WallPlan):
        return message("plan_item_ring_setup", "a set-up of ring {name}", name=name)
    if change.item == "reading" and name == "offsets":
        return message("plan_item_offsets", "all offsets")
    if change.item == "reading" and name == "tangents":
        return message("plan_item_tangents", "all tangents")
    if change.item == "accuracy" and name == "tangents":
        return message("plan_item_finer_tangents", "each tangent, with half its s_arcsec")
    return told.get(change.item)
