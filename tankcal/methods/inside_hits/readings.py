"""Wall hits inside a horizontal tank or a sphere: checks as a whole, and `WallHits` in SI."""

from dataclasses import replace

from tankcal.job.checking import has_rows, tell
from tankcal.job.checks.extent import has_survey
from tankcal.messages import message
from tankcal.methods.hits.readings import check_hits, make_hits
from tankcal.methods.points.readings import MIN_POINTS_OF_SCAN

TIES = ("directions", "slope_distances")  # tables that tie a set-up to a network


def check_inside_hits(values, tables, registers, raw, log):
    """Check hits, set-ups, instruments and settings; parameters as for `Method.check`."""
    check_hits(values, tables, registers, raw, log, undeclared_offset=offset_undeclared())
    hits = tables["wall_hits"]
    if not has_rows(hits):
        return
    if values is not None:
        _check_count(hits, values["tank"]["kind"], log)
        _refuse_outside(values, raw, log)
    _refuse_targets(tables, log)
    _refuse_declared_offset(tables["uncertainty"], log)
    _refuse_untied_setups(tables, log)


def offset_undeclared():
    """Message about an offset that is neither declared nor determined by a network."""
    return message(
        "inside_offset_undeclared",
        "not given; expected the standard uncertainty of the offset without reflector, or slope"
        " distances of a network that determine it: every radius contains the whole offset",
    )


def untied_setup(name):
    """Message about a set-up that only the wall would tie to the other set-ups."""
    return message(
        "inside_setup_untied",
        "found {name!r}, which is tied to the tank by the wall alone; expected directions and"
        " distances from it to targets of the other set-ups or to known points (directions.csv,"
        " slope_distances.csv), or a single set-up",
        name=name,
    )


def _check_count(hits, kind, log):
    """Require enough hits for the fit of a solid; unreadable rows count."""
    count = sum(use != "check" for use in hits.of("use"))
    fewest = MIN_POINTS_OF_SCAN.get(kind, 0)
    if count + hits.skipped < fewest:
        expected = message(
            "inside_hits_few",
            "found {count} hits to be adjusted; expected {fewest} or more on the wall",
            count=count,
            fewest=fewest,
        )
        log.problem(hits.file, expected)


def _refuse_outside(values, raw, log):
    """Refuse a survey of the outside: the set-ups are inside the tank."""
    if values["survey"]["side"] == "outside":
        expected = message(
            "inside_hits_outside",
            "found outside; expected inside: wall hits of a horizontal tank or a sphere are taken"
            " from inside",
        )
        tell(log.problem, raw, "survey", "side", expected)


def _refuse_targets(tables, log):
    """Refuse targets on the wall beside hits; targets of a network alone are allowed."""
    targets = tables["targets"]
    if has_rows(targets) and has_survey(tables):  # without a network, check_hits reports them
        expected = message(
            "inside_hits_targets",
            "given together with wall hits; expected only one of them: remove the file, so that"
            " its targets only tie the set-ups",
        )
        log.problem(targets.file, expected)


def _refuse_declared_offset(inputs, log):
    """Refuse an offset of all radii beside the offsets of the instruments."""
    if not has_rows(inputs):
        return
    for row, name in zip(inputs.rows, inputs.of("input"), strict=True):
        if name == "offset":
            expected = message(
                "inside_offset_twice",
                "found offset; expected it only as u_offset_mm in instruments.toml, because the"
                " offset of the instrument is the offset of all radii",
            )
            log.problem(inputs.file, expected, row, "input")


def _refuse_untied_setups(tables, log):
    """Refuse set-ups without readings of a network, if there are several set-ups."""
    hits, setups = tables["wall_hits"], tables["setups"]
    if setups is None:
        return
    rows = dict(zip(setups.of("setup"), setups.rows, strict=True))
    names = [name for name in dict.fromkeys(hits.of("setup")) if name in rows]
    if len(names) < 2:
        return
    tied = {name for table in TIES if has_rows(tables[table]) for name in tables[table].of("setup")}
    # One line is sufficient: with one set-up tied, the first set-up without ties is reported.
    untied = [name for name in names if name not in tied]
    if untied:
        log.problem(setups.file, untied_setup(untied[0]), rows[untied[0]], "setup")


def make_inside_hits(tables, registers):
    """Build `WallHits` from tables and registers without problems."""
    table = tables["wall_hits"]
    # A tank of one solid has no courses, so that its table lacks the column.
    without_courses = replace(table, columns=table.columns | {"course": None})
    return make_hits(tables | {"wall_hits": without_courses}, registers)
