"""Where a plan puts things and they cannot be: stations in the wall, targets above the shell."""

import numpy as np

from tankcal.job.checks.common import is_not_given, tell
from tankcal.job.tables import Log, nearest
from tankcal.messages import message
from tankcal.planning.checks.pattern import check_targets
from tankcal.planning.checks.tied import check_tied
from tankcal.planning.given import PLAN_FILE
from tankcal.planning.units import warn_of_places

NEAR_M = 0.05  # of the wall: a station nearer than this stands in it
WITHOUT_FORM = (
    "not given: U is without what the wall departs from a circle between its targets, and will be "
    "larger in the survey; expected its rms departure"
)


def check_plan(plan, given, raw, log):
    """Places that cannot be: stations in the wall, targets above the shell, ties through it."""
    if not plan.photos and not plan.setups:
        log.problem(
            PLAN_FILE,
            message("plan_no_station", "no station; expected [[photo_rings]] or [[setup_rings]]"),
        )
        return
    pattern = given.single["pattern"]
    check_targets(plan, pattern, log)
    _check_stations(plan, (*plan.photos, *plan.setups), log)
    _check_fixed_photo(plan, raw, log)
    check_tied(plan, given, log)
    warn_of_places(plan, given, log)
    if not plan.form.own_m2 and not plan.form.common_m2:
        pattern.tell(log.warning, "form_mm", message("plan_without_form", WITHOUT_FORM))


def _check_fixed_photo(plan, raw, log):
    """The photograph that holds the datum is one of the plan, and given with that datum only."""
    settings = plan.job.measurements.settings
    name, names = settings.fixed_photo, [one.name for one in plan.photos]
    if settings.datum != "fixed_photo":
        if name is not None:
            expected = message(
                "plan_fixed_photo_unused",
                "given with datum = {datum}; expected only with fixed_photo",
                datum=settings.datum,
            )
            tell(log.problem, raw, "adjustment", "fixed_photo", expected)
    elif not names:
        expected = message(
            "plan_fixed_without_photos",
            "found 'fixed_photo' in a plan without photographs; expected another datum",
        )
        tell(log.problem, raw, "adjustment", "datum", expected)
    elif is_not_given(raw, "adjustment", "fixed_photo"):
        expected = message(
            "plan_fixed_photo_missing",
            "missing; expected a photograph of the plan, such as {photo}",
            photo=names[0],
        )
        tell(log.problem, raw, "adjustment", "fixed_photo", expected)
    elif name not in names:
        expected = message(
            "plan_fixed_photo_unknown",
            "found {found!r}; expected a photograph of the plan, such as {photo}{hint}",
            found=name,
            photo=names[0],
            hint=nearest(name, names),
        )
        tell(log.problem, raw, "adjustment", "fixed_photo", expected)


def refuse_misplaced(plan, name):
    """Raise InputError where the station or set-up `name` of a plan cannot stand."""
    stands = [one for one in (*plan.photos, *plan.setups) if _station(one) == name]
    log = Log()
    _check_stations(plan, stands, log)
    log.stop_if_problems()


def _check_stations(plan, stands, log):
    """A station on the wrong side of the wall, in it, in an obstacle; one line a ring.

    stands  photographs and set-ups
    """
    told = set()
    for one in stands:
        why = _misplaced(plan, one.xyz_m)
        if why and one.place not in told:
            told.add(one.place)
            file, row, name = one.place
            log.problem(
                file,
                message(
                    "plan_misplaced", "station {station} {why}", station=_station(one), why=why
                ),
                row,
                name,
            )


def _station(one):
    """The name of the place of a photograph or a set-up."""
    return getattr(one, "station", one.name)


def _misplaced(plan, xyz):
    shell = plan.shell
    away = np.hypot(*(xyz[:2] - shell.axis_m))
    level = shell.low_m <= xyz[2] <= shell.high_m
    if abs(away - shell.radius_m) < NEAR_M and level:
        return message(
            "plan_in_the_wall",
            "stands inside the wall: {away:.3f} m from the axis, the wall is at "
            "{radius:.3f} m; expected it at least {near:g} m off",
            away=away,
            radius=shell.radius_m,
            near=NEAR_M,
        )
    if shell.outside and away < shell.radius_m and level:
        return message(
            "plan_in_the_tank",
            "stands inside the tank, {away:.3f} m from its axis (radius {radius:.3f} "
            "m), but survey.side is outside; expected it outside the wall",
            away=away,
            radius=shell.radius_m,
        )
    if shell.outside and away < shell.radius_m and xyz[2] < shell.low_m:
        return message(
            "plan_under_the_floor",
            "stands under the floor of the tank, {away:.3f} m from its axis, z = "
            "{z:.3f} m; expected it outside the wall",
            away=away,
            z=xyz[2],
        )
    if not shell.outside and (away > shell.radius_m or not level):
        return message(
            "plan_outside_the_tank",
            "stands outside the tank, {away:.3f} m from its axis (radius "
            "{radius:.3f} m), z = {z:.3f} m, but survey.side is inside; expected it "
            "within the shell",
            away=away,
            radius=shell.radius_m,
            z=xyz[2],
        )
    for obstacle in plan.obstacles:
        if _within(obstacle, xyz):
            return message(
                "plan_in_an_obstacle", "stands in the obstacle {obstacle}", obstacle=obstacle.name
            )
    return ""


def _within(obstacle, xyz):
    if hasattr(obstacle, "radius_m"):
        near = np.hypot(*(xyz[:2] - obstacle.axis_m)) < obstacle.radius_m
        return bool(near and obstacle.low_m < xyz[2] < obstacle.high_m)
    return bool(((xyz > obstacle.low_m) & (xyz < obstacle.high_m)).all())
