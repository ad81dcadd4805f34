"""What is given in a plan and cannot be meant: names, keys that belong together, accuracies."""

from tankcal.job.checking import is_not_given, refuse_repeated
from tankcal.job.tables import nearest
from tankcal.messages import message
from tankcal.pipeline.wall_warnings import ADVISED_POINTS, FEWEST_POINTS
from tankcal.planning.fields import check_form, no_such_name
from tankcal.planning.given import PLAN_FILE
from tankcal.planning.obstacles import check_obstacles
from tankcal.planning.units import warn_of_units

UNFIT = {  # kinds of instruments that cannot be meant
    "setup_rings": ("tape", "level", "stadia"),
    "tapes": ("total_station", "theodolite", "level", "stadia"),
}
_NAMED = {
    "tape": message("plan_named_tape", "tape"),
    "level": message("plan_named_level", "level"),
    "total_station": message("plan_named_total_station", "total station"),
    "theodolite": message("plan_named_theodolite", "theodolite"),
    "stadia": message("plan_named_stadia", "stadia"),
}


def check_given(values, registers, given, raw, log):
    """Names that must be defined, keys that belong together, accuracies that are not all zero."""
    for section, key, register in (
        ("photo_rings", "camera", "cameras"),
        ("setup_rings", "instrument", "instruments"),
        ("tapes", "instrument", "instruments"),
    ):
        known = registers[register]
        for one in given.repeated[section]:
            if one[key] is not None and one[key] not in known:
                hint = nearest(one[key], known)
                one.tell(log.problem, key, no_such_name(one[key], f"{register}.toml", hint))
    _check_kinds(registers["instruments"], given, log)
    _check_pattern(given.single["pattern"], log)
    for section in ("photo_rings", "setup_rings"):
        for one in given.repeated[section]:
            if len(one.filled & {"distance_m", "radius_m"}) != 1:
                expected = message(
                    "plan_one_radius",
                    "expected one of distance_m (from the wall) and radius_m (from the axis)",
                )
                one.tell(log.problem, "distance_m", expected)
    check_obstacles(given, log)
    _check_tapes(given, log)
    _check_tables(given, log)
    _check_accuracies(values, given, raw, log)
    warn_of_units(given, raw, values, log)


def _check_kinds(instruments, given, log):
    """A tape is no instrument of a set-up, nor a total station a tape."""
    for section, unfit in UNFIT.items():
        for one in given.repeated[section]:
            kind = (instruments.get(one["instrument"]) or {}).get("kind")
            if kind in unfit:
                fit = message("plan_total_station", "a total station or a theodolite")
                if section == "tapes":
                    fit = message("plan_a_tape", "a tape")
                expected = message(
                    "plan_unfit_instrument",
                    "{instrument} is a {named}; expected {fit}",
                    instrument=one["instrument"],
                    named=_NAMED[kind],
                    fit=fit,
                )
                one.tell(log.problem, "instrument", expected)


def _check_pattern(pattern, log):
    """Lines enough for a section, heights or levels, and a form that is larger than its part."""
    lines = pattern["generatrices"]
    if lines in range(FEWEST_POINTS):
        expected = message(
            "plan_few_lines",
            "found {lines:g} points in each section of the wall; expected at least {fewest} "
            "({advised} or more are advised)",
            lines=lines,
            fewest=FEWEST_POINTS,
            advised=ADVISED_POINTS,
        )
        pattern.tell(log.problem, "generatrices", expected)
    if {"levels", "heights_m"} <= pattern.filled:
        expected = message(
            "plan_levels_or_heights", "given together with heights_m; expected one of the two"
        )
        pattern.tell(log.problem, "levels", expected)
    check_form(pattern, log)


def _check_tapes(given, log):
    seen = set()
    for one in given.repeated["tapes"]:
        if one["name"] in seen:
            one.tell(
                log.problem,
                "name",
                message(
                    "plan_tape_twice", "found {found!r} again; expected it once", found=one["name"]
                ),
            )
        seen.add(one["name"])


def _check_tables(given, log):
    """Ties between two points, control points that stand there once, in one frame."""
    for table in given.ties.values():
        if table is None:
            continue
        for row, start, end in zip(table.rows, table.of("from"), table.of("to"), strict=True):
            if start is not None and start == end:
                expected = message(
                    "plan_tie_to_itself",
                    "found {end!r} on both sides; expected two points",
                    end=end,
                )
                log.problem(table.file, expected, row, "to")
    if given.control is not None:
        refuse_repeated(given.control, "point", log)
        for row, system in zip(given.control.rows, given.control.of("system"), strict=True):
            if system is not None:
                expected = message(
                    "plan_own_frame",
                    "found {system!r}; expected a blank: a plan is in the frame of the survey",
                    system=system,
                )
                log.problem(given.control.file, expected, row, "system")


def _check_accuracies(values, given, raw, log):
    """Each ring says how well it measures; not everything may be exact."""
    has_common = values is None or not is_not_given(raw, "adjustment", "image_sd_um")
    for one in given.repeated["photo_rings"]:
        if "s_um" not in one.filled and not has_common:
            expected = message(
                "plan_image_sd_missing", "missing; expected s_um here, or adjustment.image_sd_um"
            )
            one.tell(log.problem, "s_um", expected)
        elif one["s_um"] == 0:
            expected = message(
                "plan_exact_image",
                "found 0; an image point cannot be exact: expected micrometres above 0",
            )
            one.tell(log.problem, "s_um", expected)
    keys = ("s_direction_arcsec", "s_zenith_arcsec", "s_mm")
    for one in given.repeated["setup_rings"]:
        if not one.filled & {*keys}:
            expected = message(
                "plan_measures_nothing",
                "measures nothing; expected at least one of {keys}",
                keys=", ".join(keys),
            )
            log.problem(PLAN_FILE, expected, one.row, one.name)
        elif not any(one[key] or one.is_refused(key) for key in keys):
            expected = message(
                "plan_ring_exact",
                "an accuracy of zero for everything: expected standard deviations above 0",
            )
            log.problem(PLAN_FILE, expected, one.row, one.name)
        if "s_mm" in one.filled and "s_zenith_arcsec" not in one.filled:
            expected = message(
                "plan_zenith_missing",
                "missing; expected zenith angles together with slope distances (s_mm)",
            )
            one.tell(log.problem, "s_zenith_arcsec", expected)
