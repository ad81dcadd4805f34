"""Items and changes of a plan in words."""

from tankcal.messages import message
from tankcal.terminal.showing import marks

KINDS = (
    *("photographs", "setups", "ties", "bases", "control", "targets"),
    *("straps", "lines", "offsets", "hits", "tangents", "runs", "batches"),
)


def describe_items(plan, counts):
    """Return the items of a plan in words.

    counts  {kind, of KINDS: number}
    """
    parts = [describe_count(kind, count) for kind, count in counts.items() if count]
    return message("plan_holds", "{tank}: {parts}", tank=plan.job.tank.id, parts=parts)


def describe_count(kind, count):
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


def describe_change(change):
    """Return the action and the item of a change in words."""
    item = _wall_item(change) or _network_item(change.item, change.name)
    if change.action == "add":
        return message("plan_add", "add {item}", item=item)
    if change.action == "drop":
        return message("plan_drop", "drop {item}", item=item)
    return message("plan_repeat", "repeat {item}", item=item)


def _network_item(item, name):
    """Return an item of a plan (`planning.changes.ITEMS`) in words."""
    from tankcal.planning.changes import IMAGES, OF_COURSE, ROW

    if item == "photo_station":
        return message("plan_photo_station", "photo station {name}", name=name)
    if item == "setup":
        return message("plan_setup", "setup {name}", name=name)
    if item == "tape":
        return message("plan_tape", "tape {name}", name=name)
    if item == "base":
        return message("plan_base", "base {name}", name=name)
    if item == "control_point":
        return message("plan_control_point", "control point {name}", name=name)
    if item == "target_row" and name.startswith(OF_COURSE):
        course = name.removeprefix(OF_COURSE)
        return message("plan_row_of_course", "target row in course {course}", course=course)
    if item == "target_row":
        return message("plan_row", "target row {section}", section=name.removeprefix(ROW))
    if name == IMAGES:
        return message("plan_all_images", "measurement of all image points")
    return message("plan_all_sets", "measurement of all sets of the total station")


def _wall_item(change):
    """Return an item of a plan of the wall in words; None for other plans."""
    from tankcal.planning.wall.changes import NUMBERED
    from tankcal.planning.wall.model import WallPlan

    name = change.name
    if change.item in NUMBERED:
        name = name.replace(".", marks().decimal)
    items = {
        "strap": message("plan_item_strap", "circumference {name}", name=name),
        "line": message("plan_item_lines", "{name} reference lines", name=name),
        "face": message("plan_item_face", "the second face of the plummet"),
        "level": message("plan_item_level", "the level {name} of each course", name=name),
        "hit": message("plan_item_hits", "hits of ring {name}, half as many as planned", name=name),
        "accuracy": message("plan_item_accuracy", "each tape reading, with half its s_mm"),
        "station": message(
            "plan_item_station", "a station of the traverse, all {name} from the axis", name=name
        ),
        "traverse": message(
            "plan_item_traverse", "each reading between stations, with half its s_mm and s_arcsec"
        ),
        "bar": message("plan_item_bar", "{name} over the stations of the traverse", name=name),
        "ranging": message("plan_item_ranging", "distances between the stations"),
        "certificate": message(
            "plan_item_certificate", "the calibration of {name}, with half its u", name=name
        ),
    } | _run_items(name)
    if change.item == "setup" and isinstance(change.plan, WallPlan):
        return message("plan_item_ring_setup", "a set-up of ring {name}", name=name)
    if change.item == "reading" and name == "offsets":
        return message("plan_item_offsets", "all offsets")
    if change.item == "reading" and name == "tangents":
        return message("plan_item_tangents", "all tangents")
    if change.item == "accuracy" and name == "tangents":
        return message("plan_item_finer_tangents", "each tangent, with half its s_arcsec")
    if change.item == "accuracy" and name == "dips":
        return message("plan_item_finer_dips", "each dip, with half its s_dip_mm")
    if change.item == "half_steps" and change.action == "drop":
        return message("plan_item_every_second", "every second dip of run {name}", name=name)
    return items.get(change.item)


def _run_items(name):
    """Return the items of the runs of a plan."""
    return {
        "step": message("plan_item_step", "a step at the end of run {name}", name=name),
        "top_of_run": message(
            "plan_item_top_of_run", "steps of run {name} up to the full tank", name=name
        ),
        "half_steps": message(
            "plan_item_half_steps", "a dip in the middle of each step of run {name}", name=name
        ),
        "empty_start": message(
            "plan_item_empty_start", "a start of run {name} in the empty tank", name=name
        ),
        "run": message("plan_item_run", "a run like run {name}", name=name),
        "meter": message(
            "plan_item_meter", "the proving of meter {name}, with half its u", name=name
        ),
        "batches": message(
            "plan_item_batches", "each batch of meter {name}, with half its sd", name=name
        ),
    }
