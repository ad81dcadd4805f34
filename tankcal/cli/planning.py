"""`tankcal plan`: what a survey will be worth, before anyone drives to the site."""

from pathlib import Path

from tankcal.cli.arguments import several, share, whole
from tankcal.cli.showing import Progress, listed, prepare_for_small_work, warn
from tankcal.digits import PROGRAM, fixed, with_digits, written

SHOWN = 12  # changes in the terminal


def add(commands):
    """The parser of `tankcal plan`."""
    plan = commands.add_parser(
        "plan",
        help="plan a survey: the uncertainty of the table before anything is measured",
        description="Read and check a plan (a job without measured values), find out what is seen "
        "from where, and predict how well points, sections and every row of the table will be "
        "known. docs/planning.md says what a plan holds.",
        epilog="exit status: 0 done; 2 the plan must be mended; 3 the survey would have no sound "
        "solution.",
    )
    plan.add_argument("plan", metavar="PLAN", help="a plan's folder, or its plan.toml")
    plan.add_argument(
        "--out",
        metavar="DIR",
        help="write prediction, field sheets and an empty job there, all or nothing",
    )
    plan.add_argument(
        "--changes",
        action="store_true",
        help="try every change of one item: what helps most, what can be spared",
    )
    plan.add_argument(
        "--smallest",
        action="store_true",
        help="search for the smallest design that meets limits.relative_u",
    )
    plan.add_argument(
        "--simulate",
        metavar="N",
        type=several,
        help="draw the readings of N surveys, compute each: do they scatter as predicted?",
    )
    plan.add_argument(
        "--blunders",
        metavar="SHARE",
        type=share,
        default=0.0,
        help="share of the simulated readings that are off by 20 sds, such as 0.01 (default: none)",
    )
    plan.add_argument("--seed", type=whole, default=1, help="of the simulation (default 1)")
    plan.add_argument("--quiet", action="store_true", help="no progress, only problems")
    plan.set_defaults(command=_plan)


def _plan(options):
    prepare_for_small_work()
    from tankcal import planning_papers
    from tankcal.errors import TankcalError
    from tankcal.planning import load_plan, predict

    _refuse_idle(options)
    show = Progress(options.quiet)
    show.step(f"reading {options.plan}")
    plan = load_plan(options.plan)
    if options.out is not None:
        planning_papers.refuse_foreign(options.out)
    if options.smallest:
        _refuse_unlimited(plan)
    show.step("predicting the survey")
    try:
        prediction = predict(plan)
    except TankcalError:
        warn(plan.warnings)
        raise
    effects, path = _studied(plan, prediction, options, show)
    simulated = _simulated(prediction, options, show)
    written = ()
    if options.out is not None:
        written = planning_papers.write(
            prediction, options.out, show.step,
            effects=effects, design=path, simulated=simulated,
        )  # fmt: skip
    show.end()
    warn(prediction.warnings)
    found = (*_summary(prediction), *_changes(effects), *_design(path), *_scatter(simulated))
    for line in found:
        print(line)
    if written:
        listed(Path(options.out), written)


def _refuse_idle(options):
    from tankcal.errors import InputError, Problem

    if options.blunders and options.simulate is None:
        raise InputError(
            Problem("--blunders", "nothing is simulated; expected --simulate N as well")
        )


def _refuse_unlimited(plan):
    from tankcal.errors import InputError, Problem

    if plan.limits.relative_u is None:
        expected = "missing; expected the U over volume that --smallest is to meet"
        raise InputError(Problem("plan.toml", expected, None, "limits.relative_u"))


def _studied(plan, prediction, options, show):
    """Effects of all changes, and the path to the smallest design; () and None: not asked for."""
    from tankcal.planning.helping import smallest, what_helps

    effects = what_helps(plan, tell=show.part, before=prediction) if options.changes else ()
    return effects, smallest(plan, tell=show.part) if options.smallest else None


def _simulated(prediction, options, show):
    from tankcal.planning.simulations import simulate

    if options.simulate is None:
        return None
    return simulate(prediction, options.simulate, options.seed, options.blunders, show.part)


def _summary(prediction):
    """What was planned, how well points will be known, and the top of the table."""
    plan, table = prediction.plan, prediction.table
    solution = prediction.predicted.adjusted.solution
    parts = [
        (len(plan.photos), "photographs"), (len(plan.setups), "set-ups"), (len(plan.ties), "ties"),
        (len(plan.known), "control points"), (len(plan.targets.names), "targets"),
    ]  # fmt: skip
    yield f"{plan.job.tank.id}: " + ", ".join(f"{count} {what}" for count, what in parts if count)
    mean = with_digits(1000 * prediction.precision.mean_sd_m, 3, PROGRAM)
    yield (
        f"network: {solution.rows} observations, {solution.unknowns} unknowns, redundancy "
        f"{solution.dof}; mean sd of a target {mean} mm"
    )
    if prediction.datum.words:
        yield f"{prediction.datum.words}; held by {', '.join(prediction.datum.held)}"
    for what, points in (("not determined", prediction.undetermined), ("weak", prediction.weak)):
        if points:
            first = ", ".join(one.name for one in points[:SHOWN])
            yield f"{what}: {len(points)} points ({first}{', ...' * (len(points) > SHOWN)})"
    top = written(table.volume_m3[-1], table.U_m3[-1], PROGRAM, least=0)
    verdict = {None: "", True: ": met", False: ": NOT met"}[prediction.meets]
    limit = plan.limits.relative_u
    yield (
        f"table: {top.value} m3 at {table.height_m[-1]:.3f} m, U = {top.uncertainty} m3 "
        f"(k = {fixed(table.k[-1], 2, PROGRAM)}), {_percent(table.U_m3[-1] / table.volume_m3[-1])}"
    )
    for one in prediction.tabled.stated.worst[:1]:
        worst = one.relative
        yield (
            f"worst delivery of {one.minimum_m:g} m or more: {worst.low_m:g} to {worst.high_m:g} m,"
            f" U/V = {_percent(worst.relative)}"
        )
    if limit is not None:
        yield f"limit {_percent(limit)}{verdict}"


def _changes(effects):
    for one in effects[:SHOWN]:
        if not one.why:
            yield (
                f"  {called(one.change)}: U/V {_percent(one.relative_u)} "
                f"({1e6 * one.difference:+.1f} ppm, cost {one.change.cost:+g})"
            )
    if len(effects) > SHOWN:
        yield f"  and {len(effects) - SHOWN} more changes"


def called(change):
    """What is done to which item of a plan; rows of targets have theirs in their names."""
    item = change.item.replace("_", " ").removesuffix(" row")
    return f"{change.action} {item} {change.name}"


def _design(path):
    if path is None:
        return
    steps = ", ".join(f"{one.change.action} {one.change.name}" for one in path.steps) or "no change"
    yield f"smallest design: {steps}"
    yield (
        f"  U/V {_percent(path.start_u)} before, {_percent(path.relative_u)} after; cost "
        f"{path.start_cost:g} before, {path.cost:g} after; {path.tried} plans tried"
    )
    if path.prediction.meets is False:
        yield "  no plan that was tried meets the limit"


def _scatter(found):
    if found is None:
        return
    yield (
        f"{found.runs} simulated surveys, scatter over prediction: coordinates {found.ratio:.3f}, "
        f"volume {found.volume_ratio:.3f} (known to {found.volume_ratio_sd:.2g}); "
        f"{found.set_aside.mean():.1f} values set aside in the mean, {len(found.failed)} surveys "
        "without a solution"
    )


def _percent(share):
    return f"{with_digits(100 * float(share), 3, PROGRAM)} %"
