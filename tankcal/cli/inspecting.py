"""`tankcal inspect`: plumb, roundness, welds and settlement of a tank by its survey."""

from pathlib import Path

from tankcal.cli.arguments import add_language, positive
from tankcal.cli.machine import add_json, print_json
from tankcal.cli.showing import (
    Progress,
    marks,
    prepare_for_small_work,
    print_paths,
    say,
    speak,
    warn,
    words_of_run,
)
from tankcal.messages import message
from tankcal.text.digits import fixed
from tankcal.text.words import message_sentence

MOST_WARNINGS = 10  # that are shown
FILE = "inspection.json"
NOMINALS = ("drawing", "mean")


def add(commands):
    """The parser of `tankcal inspect`."""
    inspect = commands.add_parser(
        "inspect",
        help="plumb, roundness, welds and settlement of a tank by its survey",
        description="Inspect an upright tank by the survey that calibrates it: plumb, roundness, "
        "peaking and banding where it was scanned, settlement where it was levelled; each with its "
        "U, judged by a rule. It is no part of the certificate. docs/inspection.md says how.",
        epilog="exit status: 0 done, whatever the verdict; 2 the input must be mended; 3 the "
        "survey has no sound solution.",
    )
    inspect.add_argument(
        "source", metavar="JOB", help="a job, a record.json, or a folder of results"
    )
    inspect.add_argument(
        "--rule", metavar="RULE", help="a rule by its name, or a .toml file (default: api_653)"
    )
    inspect.add_argument(
        "--nominal",
        choices=NOMINALS,
        default=NOMINALS[0],
        help="what radii are compared with: the drawing's, or their own mean",
    )
    inspect.add_argument(
        "--settlement",
        metavar="FILE",
        help="elevations round the foot (default: settlement.csv beside the job, if any)",
    )
    inspect.add_argument(
        "--edges",
        metavar="FILE",
        help="levelled lines across the bottom (default: edge_profiles.csv beside the job, if any)",
    )
    inspect.add_argument(
        "--yield-mpa",
        metavar="MPA",
        type=positive,
        help="yield stress of the steel, for the limits of settlement (default: as the job says)",
    )
    inspect.add_argument("--out", metavar="DIR", help="write inspection.json there, all or nothing")
    add_language(inspect)
    inspect.add_argument("--quiet", action="store_true", help="no progress, only problems")
    add_json(inspect)
    inspect.set_defaults(command=_inspect)


def _inspect(options):
    prepare_for_small_work()
    speak(options.language)
    from tankcal.inspection.inspecting import Asked, inspect_files
    from tankcal.record.inspection import plain_of_inspection

    if options.out is not None:
        from tankcal.report.folders import refuse_foreign

        refuse_foreign(options.out, (FILE,))
    show = Progress(options.quiet or options.machine)
    show.step(message("inspect_reading", "inspecting {source}", source=options.source))
    asked = Asked(
        options.source, options.rule, options.nominal, options.settlement, options.edges,
        None if options.yield_mpa is None else 1e6 * options.yield_mpa,
    )  # fmt: skip
    found = plain_of_inspection(inspect_files(asked, show.step, show.part))
    written = ()
    if options.out is not None:
        written = _write(found, options.out)
    show.end()
    if options.machine:
        print_json(exit_status=0, **found)
        return
    _tell(found)
    if written:
        print_paths(Path(options.out), [path.name for path in written])


def _write(found, out):
    """Write inspection.json, all or nothing."""
    from tankcal.record import save
    from tankcal.report.folders import replaced

    with replaced(out) as folder:
        save(found, folder / FILE)
    return [Path(out) / FILE]


def _tell(found):
    """Warnings, then a line for each check."""
    warn(_warning(one) for one in found["warnings"][:MOST_WARNINGS])
    rule = found["rule"]
    if rule is not None:
        say(message("inspect_by", "judged by {rule} ({file})", rule=rule["name"],
                    file=rule["file"]))  # fmt: skip
        if not rule["verified"]:
            say(message("inspect_not_read", "its limits were not read in the text itself: {remark}",
                        remark=rule["remark"]))  # fmt: skip
    for one in found["checks"]:
        say(_line(one))


CHECK_NAMES = {
    "plumbness_axis": message("check_plumbness_axis", "plumb of the axis"),
    "plumbness_generatrix": message("check_plumbness_generatrix", "plumb of the generatrices"),
    "plumbness_course": message("check_plumbness_course", "plumb of a course"),
    "roundness_low": message("check_roundness_low", "roundness 0.3 m above the bottom"),
    "roundness_high": message("check_roundness_high", "roundness higher up"),
    "peaking": message("check_peaking", "peaking at vertical welds"),
    "banding": message("check_banding", "banding at horizontal welds"),
    "settlement_cosine": message(
        "check_settlement_cosine", "settlement: share of the tilted plane"
    ),
    "settlement_all": message("check_settlement_all", "settlement out of the plane, all points"),
    "settlement_subset": message("check_settlement_subset", "settlement out of the plane, subset"),
    "settlement_curvature": message("check_settlement_curvature", "curvature of the settlement"),
    "settlement_de_beer": message("check_settlement_de_beer", "settlement by De Beer"),
    "edge_settlement": message("check_edge_settlement", "settlement of the edge"),
    "bottom_bulge": message("check_bottom_bulge", "bulge of the bottom"),
}
VERDICTS = {
    "passed": message("inspect_passed", "passed"),
    "guard_band": message("inspect_guard_band", "in the guard band (kept, but by less than U)"),
    "failed": message("inspect_failed", "failed"),
    "not_determined": message("inspect_not_determined", "not determined"),
}
REASONS = {  # remarks of what is not determined
    "gap_no_weld": message("inspect_gap_no_weld", "no weld is known"),
    "gap_no_cloud": message("inspect_gap_no_cloud", "it needs a point cloud"),
    "gap_too_sparse": message("inspect_gap_too_sparse", "the cloud is too sparse there"),
    "gap_too_uncertain": message("inspect_gap_too_uncertain", "u exceeds a quarter of the limit"),
    "one_level": message("inspect_one_level", "it needs two levels whose centres are known"),
    "one_level_a_course": message("inspect_one_level_a_course", "it needs two levels in a course"),
    "no_level_there": message("inspect_no_level_there", "no level was surveyed there"),
    "wall_not_surveyed": message(
        "inspect_wall_not_surveyed", "the wall was not surveyed by points"
    ),
}


def _line(check):
    """One check: its name and epoch, the value with U, the limit, the verdict, where it is."""
    name = CHECK_NAMES[check["code"]]
    if check["epoch"] is not None:
        name = message("inspect_of_epoch", "{check} ({epoch})", check=name, epoch=check["epoch"])
    verdict = VERDICTS[check["verdict"]]
    if check["value"] is None:
        why = REASONS.get(check["remark"])
        if why is None:
            return message("inspect_no_value", "{check}: {verdict}", check=name, verdict=verdict)
        return message("inspect_no_value_for", "{check}: {verdict}: {why}",
                       check=name, verdict=verdict, why=why)  # fmt: skip
    values = {
        "check": name,
        "value": _number(check["value"], check["unit"]),
        "U": "?" if check["U"] is None else _number(check["U"], check["unit"]),
        "unit": f" {check['unit']}" if check["unit"] else "",
        "verdict": verdict,
        "place": _place(check),
    }
    if check["limit"] is None:
        return message(
            "inspect_bare_figure", "{check}: {value}{unit}, U {U}{unit}, no limit{place}", **values
        )
    return message(
        "inspect_check",
        "{check}: {value}{unit}, U {U}{unit}, limit {limit}{unit}: {verdict}{place}",
        limit=_number(check["limit"]["value"], check["unit"]),
        **values,
    )


def _number(value, unit):
    """A number as a line shows it: tenths of a millimetre, three figures of what is small."""
    if unit == "mm":
        return fixed(value, 1, marks())
    return f"{value:.3g}".replace(".", marks().decimal)


def _place(check):
    """Where the deciding place is."""
    parts = []
    if check["course"] is not None:
        parts.append(message("inspect_course", "course {course}", course=check["course"]))
    if check["height_m"] is not None:
        parts.append(message("inspect_height", "{height} m up",
                             height=fixed(check["height_m"], 2, marks())))  # fmt: skip
    if check["azimuth_deg"] is not None:
        parts.append(message("inspect_azimuth", "azimuth {azimuth} deg",
                             azimuth=fixed(check["azimuth_deg"], 2, marks())))  # fmt: skip
    if not parts:
        return ""
    return message("inspect_place", " ({parts})", parts=parts)


def _warning(one):
    """A warning of the file in the language of the run."""
    said = message_sentence(words_of_run(), one["text"], one["code"], one["values"])
    return f"{one['file']}: {said}" if one["file"] else said
