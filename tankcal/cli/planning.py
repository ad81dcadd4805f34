"""`tankcal plan`: prediction of the uncertainty of a survey before the measurement."""

from pathlib import Path

from tankcal.errors import InputError, Problem, SolutionError, TankcalError
from tankcal.messages import message
from tankcal.terminal import (
    Progress,
    add_language,
    marks,
    parse_count,
    parse_several,
    parse_share,
    print_paths,
    say,
    speak,
    warn,
)
from tankcal.text.digits import fixed, format_significant, format_with_u

SHOWN = 12  # changes in the terminal
SCALES = ("meter_factor", "scale", "instrument_scale")  # parameters that metered liquid determines


def add(commands):
    """Add the parser of `tankcal plan`."""
    plan = commands.add_parser(
        "plan",
        help="plan a survey: predict the uncertainty of the table before the measurement",
        description="Read and check a plan (a job without measured values), determine which "
        "targets are visible from which station, and predict the uncertainty of points, sections "
        "and every row of the table. docs/planning.md describes the plan.",
        epilog="exit status: 0 done; 2 the plan must be corrected; 3 the survey would have no "
        "valid solution.",
    )
    plan.add_argument(
        "plan",
        metavar="PLAN",
        help="a plan's folder, or its plan.toml; a folder "
        "with upkeep.toml: the benefit of further data",
    )
    plan.add_argument(
        "--out",
        metavar="DIR",
        help="write prediction, field sheets and an empty job to this folder, all or nothing",
    )
    plan.add_argument(
        "--workbook",
        action="store_true",
        help="write the empty job as one Excel workbook in place of text files",
    )
    plan.add_argument(
        "--changes",
        action="store_true",
        help="evaluate every change of one item: the most useful additions and the dispensable "
        "items",
    )
    plan.add_argument(
        "--smallest",
        action="store_true",
        help="search for the smallest design that meets limits.relative_u",
    )
    plan.add_argument(
        "--simulate",
        metavar="N",
        type=parse_several,
        help="simulate the readings of N surveys, compute each survey, and compare the scatter "
        "with the prediction",
    )
    plan.add_argument(
        "--blunders",
        metavar="SHARE",
        type=parse_share,
        default=0.0,
        help="share of the simulated readings with a blunder of 20 standard deviations, such as "
        "0.01 (default: none)",
    )
    plan.add_argument(
        "--seed",
        metavar="N",
        type=parse_count,
        default=1,
        help="seed of the simulation (default 1)",
    )
    add_language(plan)
    plan.add_argument("--quiet", action="store_true", help="no progress, only problems")
    plan.set_defaults(command=_plan)


def _plan(options):
    if (Path(options.plan) / "upkeep.toml").is_file():
        _plan_upkeep(options)
        return
    from tankcal.planning import load_plan, predict
    from tankcal.planning.improvements import smallest, what_helps
    from tankcal.planning.model import WallPlan
    from tankcal.report import planning as planning_papers
    from tankcal.terminal import read_plan_language

    speak(options.language or read_plan_language(options.plan))
    _refuse_idle(options)
    show = Progress(options.quiet)
    show.step(message("plan_reading", "reading {plan}", plan=options.plan))
    plan = load_plan(options.plan)
    if options.out is not None:
        planning_papers.refuse_foreign(options.out)
    is_wall = isinstance(plan, WallPlan)
    if options.smallest:
        _refuse_unlimited(plan)
    if is_wall:
        _refuse_simulation(plan, options)
    show.step(message("plan_predicting", "predicting the survey"))
    try:
        prediction = predict(plan)
    except TankcalError as error:
        warn(plan.warnings)
        for line in _remedies(plan, error, options, show):
            say(line)
        raise
    effects, path = (), None
    if options.changes:
        effects = what_helps(plan, progress=show.part, before=prediction)
    if options.smallest:
        path = smallest(plan, progress=show.part)
    simulated = _simulate(prediction, options, show)
    written = ()
    if options.out is not None:
        written = planning_papers.write(
            prediction, options.out, show.step,
            effects=effects, design=path, simulated=simulated, language=options.language,
            workbook=options.workbook,
        )  # fmt: skip
    show.end()
    warn(prediction.warnings)
    summary = _wall_summary(prediction) if is_wall else _network_summary(prediction)
    scatter = _wall_scatter(simulated) if is_wall else _network_scatter(simulated)
    lines = (*summary, *_verdict(prediction), *_changes(effects), *_design(path), *scatter)
    for line in lines:
        say(line)
    if written:
        print_paths(Path(options.out), written)


def _plan_upkeep(options):
    """Print the benefit of further everyday data, for a tank kept up."""
    from tankcal.products.upkeep.planning import plan_folder

    speak(options.language)
    (low, high), gains, k = plan_folder(options.plan)
    words = {
        "now": message("upkeep_plan_now", "the steps so far"),
        "month": message("upkeep_plan_month", "with a further month like the last 30 days"),
        "prover": message("upkeep_plan_prover", "with all meters proved to u = 0.03 %"),
        "low_stock": message("upkeep_plan_low", "with the stock run down to half of this level"),
    }
    for gain in gains:
        say(message(
            "upkeep_plan_line", "{what}: delivery from {low} to {high} m, U = {delivery} L; "
            "content at {low} m, U = {content} L", what=words[gain.name],
            low=fixed(low, 3, marks()), high=fixed(high, 3, marks()),
            delivery=format_significant(1000 * k * gain.u_delivery_m3, 2, marks()),
            content=format_significant(1000 * k * gain.u_content_m3, 2, marks()),
        ))  # fmt: skip


def _refuse_idle(options):
    """Raise InputError for options that have no effect."""
    problems = []
    if options.blunders and options.simulate is None:
        expected = message(
            "plan_nothing_simulated",
            "has no effect without a simulation; expected --simulate N as well",
        )
        problems.append(Problem("--blunders", expected))
    if options.workbook and options.out is None:
        expected = message(
            "plan_nothing_written",
            "has no effect without an output folder; expected --out DIR as well",
        )
        problems.append(Problem("--workbook", expected))
    if problems:
        raise InputError(problems)


def _refuse_simulation(plan, options):
    if options.simulate is not None and plan.design.runs:
        expected = message(
            "plan_runs_not_simulated",
            "not possible for a plan with runs of liquid; expected a plan without [[runs]]",
        )
        raise InputError(Problem("--simulate", expected))


def _refuse_unlimited(plan):
    if plan.limits.relative_u is None:
        expected = message(
            "plan_no_limit",
            "missing; expected the relative uncertainty U/V that --smallest must meet",
        )
        raise InputError(Problem("plan.toml", expected, None, "limits.relative_u"))


def _remedies(plan, error, options, show):
    """Yield additions that would determine a survey of targets without a solution."""
    from tankcal.planning.improvements import what_would_do
    from tankcal.planning.model import Plan

    if not options.changes or not isinstance(error, SolutionError) or not isinstance(plan, Plan):
        return
    remedies = what_would_do(plan, progress=show.part)
    show.end()
    if remedies:
        yield message("plan_remedies", "additions that would determine the survey, best first:")
    for effect in remedies[:SHOWN]:
        yield message(
            "plan_remedy",
            "  {change}: U/V {relative}",
            change=describe_change(effect.change),
            relative=_percent(effect.relative_u),
        )


def _simulate(prediction, options, show):
    if options.simulate is None:
        return None
    from tankcal.planning.simulations import simulate, simulate_walls
    from tankcal.planning.wall.prediction import WallPrediction

    draw = simulate_walls if isinstance(prediction, WallPrediction) else simulate
    return draw(prediction, options.simulate, options.seed, options.blunders, show.part)


def _network_summary(prediction):
    """Yield the items of the plan and the predicted quality of its points."""
    from tankcal.planning.places import group_by_ends

    plan = prediction.plan
    solution = prediction.network.adjusted.solution
    counts = {
        "photographs": len(plan.photos),
        "setups": len(plan.setups),
        "ties": len(plan.ties),
        "bases": len(group_by_ends(plan.bases)),
        "control": len(plan.known),
        "targets": len(plan.targets.names),
    }
    yield describe_items(plan, counts)
    yield message(
        "plan_network",
        "network: {rows} observations, {unknowns} unknowns, redundancy {dof}; mean standard "
        "deviation of a target {sd} mm",
        rows=solution.rows,
        unknowns=solution.estimated,
        dof=solution.dof,
        sd=format_significant(1000 * prediction.precision.mean_sd_m, 3, marks()),
    )
    if prediction.datum.words:
        yield message(
            "plan_datum",
            "{datum}; held by {held}",
            datum=prediction.datum.words,
            held=[*prediction.datum.held],
        )
    if prediction.undetermined:
        yield message(
            "plan_not_determined",
            "points not determined: {count} ({points})",
            count=len(prediction.undetermined),
            points=_first(prediction.undetermined),
        )
    if prediction.weak:
        yield message(
            "plan_weak",
            "weak points: {count} ({points})",
            count=len(prediction.weak),
            points=_first(prediction.weak),
        )


def _verdict(prediction):
    """Yield the top of the table, the worst delivery, and the limit."""
    plan = prediction.plan
    yield _top(prediction.table)
    for delivery in prediction.result.stated.worst[:1]:
        worst = delivery.relative
        yield message(
            "plan_worst",
            "worst delivery of {least:g} m or more: {low:g} to {high:g} m, U/V = {relative}",
            least=delivery.minimum_m,
            low=worst.low_m,
            high=worst.high_m,
            relative=_percent(worst.relative),
        )
    if plan.limits.relative_u is not None:
        yield _describe_limit(_percent(plan.limits.relative_u), prediction.meets)


def _top(table):
    top = format_with_u(table.volume_m3[-1], table.U_m3[-1], marks(), least=0)
    return message(
        "plan_top",
        "table: {volume} m3 at {height} m, U = {uncertainty} m3 (k = {factor:.2f}), {relative}",
        volume=top.value,
        height=fixed(table.height_m[-1], 3, marks()),
        uncertainty=top.uncertainty,
        factor=table.k[-1],
        relative=_percent(table.U_m3[-1] / table.volume_m3[-1]),
    )


def _describe_limit(limit, meets):
    if meets is None:
        return message("plan_limit", "limit {limit}", limit=limit)
    if meets:
        return message("plan_limit_met", "limit {limit}: met", limit=limit)
    return message("plan_limit_missed", "limit {limit}: NOT met", limit=limit)


def _first(points):
    """Return the first names of points, with dots for further points."""
    return ", ".join(point.name for point in points[:SHOWN]) + ", ..." * (len(points) > SHOWN)


def _changes(effects):
    for effect in effects[:SHOWN]:
        if not effect.why:
            yield _effect(effect)
    if len(effects) > SHOWN:
        yield message("plan_more_changes", "  more changes: {more}", more=len(effects) - SHOWN)


def _effect(effect):
    """Return the line of a change; costs are shown if the plan states costs."""
    values = {
        "change": describe_change(effect.change),
        "relative": _percent(effect.relative_u),
        "difference": 1e6 * effect.difference,
    }
    if not any(effect.change.plan.costs.values()):
        return message(
            "plan_effect_without_cost",
            "  {change}: U/V {relative} ({difference:+.1f} ppm)",
            **values,
        )
    return message(
        "plan_effect",
        "  {change}: U/V {relative} ({difference:+.1f} ppm, cost {cost:+g})",
        **values,
        cost=effect.change.cost,
    )


def _design(path):
    if path is None:
        return
    steps = [describe_change(step.change) for step in path.steps]
    yield message(
        "plan_smallest",
        "smallest design: {steps}",
        steps=steps or message("plan_no_change", "no change"),
    )
    values = {
        "before": _percent(path.start_u),
        "after": _percent(path.relative_u),
        "tried": path.evaluations,
    }
    if path.start_cost or path.cost:
        yield message(
            "plan_smallest_worth",
            "  U/V {before} before, {after} after; cost {start_cost:g} before, {cost:g} after; "
            "plans evaluated: {tried}",
            **values,
            start_cost=path.start_cost,
            cost=path.cost,
        )
    else:
        yield message(
            "plan_smallest_without_cost",
            "  U/V {before} before, {after} after; plans evaluated: {tried}",
            **values,
        )
    if path.prediction.meets is False:
        yield message("plan_none_meets", "  no evaluated plan meets the limit")


def _network_scatter(scatter):
    if scatter is None:
        return
    yield message(
        "plan_scatter",
        "{runs} simulated surveys, ratio of scatter to prediction: coordinates {ratio:.3f}, "
        "volume {volume_ratio:.3f} (standard deviation {ratio_sd:.2g}); {aside:.1f} values "
        "rejected on average, without a solution: {failed}",
        runs=scatter.runs,
        ratio=scatter.ratio,
        volume_ratio=scatter.volume_ratio,
        ratio_sd=scatter.volume_ratio_sd,
        aside=scatter.set_aside.mean(),
        failed=len(scatter.failed),
    )


def _percent(share):
    return f"{format_significant(100 * float(share), 3, marks())} %"


def _wall_summary(prediction):
    """Yield the items of the plan and the predicted u of the course radii."""
    from tankcal.record.plan import survey_of

    plan = prediction.plan
    has = survey_of(plan)
    counts = {"straps": has.strap_readings}
    for kind in ("lines", "offsets", "setups", "hits", "tangents", "runs", "batches"):
        counts[kind] = getattr(has, kind)
    yield describe_items(plan, counts)
    for course in prediction.courses:
        yield message(
            "plan_course_radius",
            "course {course}: u of the mean radius {sd} mm",
            course=course.name,
            sd=format_significant(1000 * course.radius_sd_m, 2, marks()),
        )
    if prediction.filling is not None:
        yield from _describe_filling(prediction.filling)


def _describe_filling(outlook):
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


def _wall_scatter(scatter):
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


# ---- items of a plan in words

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
    from tankcal.planning.improvements import IMAGES, OF_COURSE, ROW

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
    from tankcal.planning.model import WallPlan
    from tankcal.planning.wall.changes import NUMBERED

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
