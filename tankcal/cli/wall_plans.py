"""Terminal output for plans of straps, reference lines, wall hits, tangents or liquid."""

from tankcal.cli.planned_counts import plan_holds
from tankcal.cli.showing import marks
from tankcal.messages import message
from tankcal.text.digits import fixed, format_significant

SCALES = ("meter_factor", "scale", "instrument_scale")  # parameters that metered liquid determines


def wall_summary(prediction):
    """Yield the items of the plan and the predicted u of the course radii."""
    from tankcal.record.plan import survey_of

    plan = prediction.plan
    has = survey_of(plan)
    counts = {"straps": has.strap_readings}
    for kind in ("lines", "offsets", "setups", "hits", "tangents", "runs", "batches"):
        counts[kind] = getattr(has, kind)
    yield plan_holds(plan, counts)
    for course in prediction.courses:
        yield message(
            "plan_course_radius",
            "course {course}: u of the mean radius {sd} mm",
            course=course.name,
            sd=format_significant(1000 * course.radius_sd_m, 2, marks()),
        )
    if prediction.filling is not None:
        yield from _filling(prediction.filling)


def _filling(outlook):
    """Yield the effect of runs of liquid on the uncertainty of the geometry."""
    for dip in outlook.dips:
        yield message(
            "plan_dip_beside",
            "V({dip} m): U = {uncertainty} m3; from geometry alone {before} m3",
            dip=fixed(dip.dip_m, 3, marks()),
            uncertainty=format_significant(dip.U_m3, 2, marks()),
            before=format_significant(dip.U_geometry_m3, 2, marks()),
        )
    for cause in outlook.causes:
        if cause.kind in SCALES:
            yield message(
                "plan_told_by_liquid",
                "{name}: u {before} {unit} without the liquid, {after} {unit} with it",
                name=cause.name or message("plan_scale_of_all", "scale"),
                unit=cause.unit,
                before=format_significant(cause.u_before, 3, marks()),
                after=format_significant(cause.u_after, 3, marks()),
            )
    if outlook.detectable_radius_m is not None:
        yield message(
            "plan_radius_shown",
            "smallest detectable offset of all radii of the geometry: {radius} mm",
            radius=format_significant(1000 * outlook.detectable_radius_m, 2, marks()),
        )


def wall_scatter(scatter):
    """Yield the result of simulated surveys of random walls; nothing for None."""
    if scatter is None:
        return
    low, median, high = scatter.U_ratios
    yield message(
        "plan_wall_scatter",
        "{runs} simulated surveys of random walls: ratio of volume error to prediction "
        "{ratio:.3f} (standard deviation {ratio_sd:.2g}); ratio of U to prediction "
        "{median:.2f} ({low:.2f} to {high:.2f}); true volume within U in {covered} of full "
        "tanks, {rows} of all rows; {aside:.1f} readings rejected on average, without a "
        "solution: {failed}",
        runs=scatter.runs,
        ratio=scatter.volume_ratio,
        ratio_sd=scatter.volume_ratio_sd,
        median=median,
        low=low,
        high=high,
        covered=_share(scatter.covered),
        rows=_share(scatter.within.mean()),
        aside=scatter.set_aside.mean(),
        failed=len(scatter.failed),
    )


def _share(number):
    return f"{fixed(100 * float(number), 1, marks())} %"


def wall_item(change):
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
    } | _filling_items(name)
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


def _filling_items(name):
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
