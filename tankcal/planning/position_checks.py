"""Checks of the positions in a plan: stations, targets, ties, bases, control, obstacles."""

import numpy as np

from tankcal.job.checking import has_rows, is_not_given, tell
from tankcal.job.checks.survey.readings import refuse_itself
from tankcal.job.contract.registers import LEAST
from tankcal.job.tables import Log, nearest
from tankcal.messages import join_with_and, list_some, message
from tankcal.planning.contract import PLAN_FILE
from tankcal.planning.model import Box, Pillar
from tankcal.planning.places import (
    GRAZE_M,
    STADIA_FILE,
    TOUCH_M,
    base_m,
    find_hidden,
    find_in_sight,
    joints_m,
    message_of_cut_line,
    message_of_misplaced_station,
    message_of_obstacle_at,
    plate_m,
)
from tankcal.survey.measurements import distance_of_angle_m

NEAR_M = 0.05  # smallest distance of a station from the wall
SHOWN = 5  # largest number of lines, rows or obstacles listed in a message
ROUNDING_M = 1e-6
THINNER_M = 0.02  # reduction of the tank radius, so that points on the wall are accepted
OFF_M = 0.5  # largest distance of a control point from its position in the plan
OUT_OF_PLUMB_M = 0.5  # largest horizontal distance between the ends of a plumb line
WIDEST_RAD, NARROWEST_RAD = np.pi / 2, 2 * np.pi * LEAST  # range of angles that a job accepts
FAR_M = 1000.0  # largest plausible distance of an obstacle from the wall


def check_positions(plan, plan_input, raw, log):
    """Check all positions: stations in the wall, targets above the shell, obstructed ties.

    Parameters
    ----------
    plan : Plan
    plan_input : PlanInput
        Valid sections and tables, for the places of messages.
    raw : RawJob
        Content of the plan's folder.
    log : Log
    """
    if not plan.photos and not plan.setups:
        log.problem(
            PLAN_FILE,
            message("plan_no_station", "no station; expected [[photo_rings]] or [[setup_rings]]"),
        )
        return
    pattern = plan_input.sections["pattern"]
    _check_targets(plan, pattern, log)
    _check_stations(plan, (*plan.photos, *plan.setups), log)
    _check_fixed_photo(plan, raw, log)
    _check_ties(plan, plan_input, log)
    _check_bases(plan, plan_input, log)
    _warn_of_places(plan, plan_input, log)


def _check_fixed_photo(plan, raw, log):
    """Check that the photograph that holds the datum exists, and is stated only with that datum."""
    settings = plan.job.measurements.settings
    name, names = settings.fixed_photo, [photo.name for photo in plan.photos]
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


# ---- stations


def refuse_misplaced(plan, name):
    """Raise InputError if the station or set-up `name` of a plan has an impossible position."""
    stands = [stand for stand in (*plan.photos, *plan.setups) if _station(stand) == name]
    log = Log()
    _check_stations(plan, stands, log)
    log.stop_if_problems()


def _check_stations(plan, stands, log):
    """Report stations in the wall, on its wrong side or in an obstacle; one message per ring.

    stands: photographs and set-ups.
    """
    reported = set()
    for stand in stands:
        why = _explain_misplacement(plan, stand.xyz_m)
        if why and stand.place not in reported:
            reported.add(stand.place)
            file, row, name = stand.place
            log.problem(file, message_of_misplaced_station(_station(stand), why), row, name)


def _station(stand):
    """Name of the position of a photograph or set-up."""
    return getattr(stand, "station", stand.name)


def _explain_misplacement(plan, xyz):
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
    if shell.is_outside and away < shell.radius_m and level:
        return message(
            "plan_in_the_tank",
            "stands inside the tank, {away:.3f} m from its axis (radius {radius:.3f} "
            "m), but survey.side is outside; expected it outside the wall",
            away=away,
            radius=shell.radius_m,
        )
    if shell.is_outside and away < shell.radius_m and xyz[2] < shell.low_m:
        return message(
            "plan_under_the_floor",
            "stands under the floor of the tank, {away:.3f} m from its axis, z = "
            "{z:.3f} m; expected it outside the wall",
            away=away,
            z=xyz[2],
        )
    if not shell.is_outside and (away > shell.radius_m or not level):
        return message(
            "plan_outside_the_tank",
            "stands outside the tank, {away:.3f} m from its axis (radius {radius:.3f} m), z = "
            "{z:.3f} m, but survey.side is inside; expected it within the shell",
            away=away,
            radius=shell.radius_m,
            z=xyz[2],
        )
    return message_of_obstacle_at(plan.obstacles, xyz)


# ---- targets: within the shell, apart from each other and from welds


def _check_targets(plan, pattern, log):
    """Check that rows lie within the shell, and that no lines, rows or welds touch."""
    heights = plan.targets.height_m
    top = plan.shell.high_m - plan.shell.low_m
    for height in np.unique(heights[(heights > top) | (heights < 0)]):
        where = message("plan_below_shell", "below the shell")
        if height > top:
            where = message("plan_above_shell", "above the shell")
        expected = message(
            "plan_row_off_shell",
            "a row of targets at {height:g} m is {where}; expected 0 to {top:g} m",
            height=height,
            where=where,
            top=top,
        )
        pattern.report(log.problem, "heights_m", expected)
    _check_lines(plan, pattern, log)
    _check_rows(plan, pattern, log)


def _check_lines(plan, pattern, log):
    """Report lines that touch, and lines moved off one weld onto another."""
    targets, radius = plan.targets, plan.shell.radius_m
    first = [name == targets.section[0] for name in targets.section]
    names = [name for name, is_first in zip(targets.generatrix, first, strict=True) if is_first]
    east, north, _ = targets.outwards[first].T * (1.0 if plan.shell.is_outside else -1.0)
    azimuth = np.arctan2(east, north)
    order = np.argsort(azimuth)
    gap = np.diff(azimuth[order], append=azimuth[order[0]] + 2 * np.pi) * radius
    after = np.roll(order, -1)
    touching = [
        message("plan_two_lines", "{one} and {other}", one=names[line], other=names[next_line])
        for line, next_line, off in zip(order, after, gap, strict=True)
        if off < TOUCH_M and line != next_line
    ]
    clearance = 1000 * targets.clearance_m
    if touching:
        expected = message(
            "plan_lines_touch",
            "lines {names} come nearer than {touch_mm:g} mm to one another when they are "
            "kept {clearance:g} mm from welds; expected fewer generatrices, another "
            "first_azimuth_deg or a smaller weld_clearance_mm",
            names=_list_first(touching),
            touch_mm=1000 * TOUCH_M,
            clearance=clearance,
        )
        pattern.report(log.problem, "generatrices", expected)
    welds = np.array(targets.welds_rad)
    off = np.abs(np.angle(np.exp(1j * (azimuth[:, None] - welds)))) * radius
    close = (off < targets.clearance_m - ROUNDING_M).any(axis=1)
    if close.any():
        near = _list_first([names[i] for i in np.flatnonzero(close)])
        expected = message(
            "plan_lines_on_weld",
            "lines {names} are as near as {off_mm:.0f} mm to a weld, moved away from another one; "
            "expected welds further apart, or a weld_clearance_mm below {clearance:g}",
            names=near,
            off_mm=1000 * off.min(),
            clearance=clearance,
        )
        pattern.report(log.problem, "weld_azimuths_deg", expected)


def _check_rows(plan, pattern, log):
    """Report rows that touch; warn of requested rows on a horizontal weld."""
    if not pattern["heights_m"]:
        return
    rows = np.sort(pattern["heights_m"])
    touching = np.flatnonzero(np.diff(rows) < TOUCH_M)
    if len(touching):
        pairs = _list_first(
            [
                message("plan_two_rows", "{low:g} and {high:g} m", low=rows[i], high=rows[i + 1])
                for i in touching
            ]
        )
        expected = message(
            "plan_rows_touch",
            "rows at {pairs}; expected rows at least {touch_mm:g} mm apart",
            pairs=pairs,
            touch_mm=1000 * TOUCH_M,
        )
        pattern.report(log.problem, "heights_m", expected)
    clearance = plan.targets.clearance_m
    off = np.abs(rows[:, None] - joints_m(plan)).min(axis=1)
    close = rows[off < clearance - ROUNDING_M]
    if len(close):
        text = message(
            "plan_targets_on_welds",
            "rows of targets nearer than {clearance_mm:g} mm to a horizontal weld ({count}): "
            "{heights} m; is that intended?",
            count=len(close),
            clearance_mm=1000 * clearance,
            heights=list_some([f"{height:g}" for height in close], SHOWN),
        )
        pattern.report(log.warning, "heights_m", text)


def _list_first(names):
    """Return the first names of a sequence and the number of the remaining names."""
    return message("plan_first", "{names}", names=list_some(names, SHOWN))


# ---- ties and control: known names, free lines, consistent positions


def _check_ties(plan, plan_input, log):
    """Check the ends of ties, tapes through the tank, and positions of control points."""
    points = plan.points
    for table in plan_input.ties.values():
        for end in ("from", "to") if table is not None else ():
            for row, name in zip(table.rows, table.of(end), strict=True):
                if name not in points:
                    expected = message(
                        "plan_no_such_end",
                        "found {found!r}; expected a target, or a point of control.csv{hint}",
                        found=name,
                        hint=nearest(name, points),
                    )
                    log.problem(table.file, expected, row, end)
    _check_distances(plan, plan_input, log)
    _check_plumb_lines(plan, plan_input, log)
    if plan_input.control is not None:
        _check_control(plan, plan_input.control, log)


def _tie_rows(plan, table):
    """Yield (row, end names, end positions (2, 3)) of a table for ties between known points."""
    points = plan.points
    rows = () if table is None else zip(table.rows, table.of("from"), table.of("to"), strict=True)
    for row, *ends in rows:
        if all(name in points for name in ends):
            yield row, ends, np.array([points[name] for name in ends])


def _check_distances(plan, plan_input, log):
    for row, ends, xyz in _tie_rows(plan, plan_input.ties["distances"]):
        if why := _explain_barred_tape(plan, ends, xyz):
            log.problem("distances.csv", why, row, "to")
    for entry in plan_input.sections["tapes"]:
        ends = [f"{entry['name']}{end}" for end in "ab"]
        if why := _explain_barred_tape(plan, ends, np.array([plan.extra[name] for name in ends])):
            entry.report(log.problem, "length_m", why)


def _explain_barred_tape(plan, ends, xyz):
    """Return the reason why no tape can connect two positions (2, 3); "" if it can."""
    shell, (start, end) = plan.shell, ends
    if shell.is_outside:
        plates = [plate_m(course, True) for course in plan.job.courses]
        radius = shell.radius_m + min(plates) - plates[0] - THINNER_M
        tank = Pillar(shell.axis_m, radius, shell.low_m, shell.high_m, "tank")
        if find_hidden(tank, xyz[0], xyz[1:])[0]:
            return message(
                "plan_line_through_tank",
                "the line from {one} to {other} runs through the tank; expected it outside",
                one=start,
                other=end,
            )
        return ""
    away = np.hypot(*(xyz[:, :2] - shell.axis_m).T)
    beyond = [name for name, off in zip(ends, away, strict=True) if off > shell.radius_m + GRAZE_M]
    if beyond:
        return message(
            "plan_tape_beyond_wall",
            "{ends} beyond the wall of the tank; expected both ends inside it",
            ends=join_with_and(beyond),
        )
    return ""


def _check_plumb_lines(plan, plan_input, log):
    for row, (start, end), xyz in _tie_rows(plan, plan_input.ties["plumb_lines"]):
        off = np.hypot(*(xyz[1, :2] - xyz[0, :2]))
        if off > OUT_OF_PLUMB_M:
            expected = message(
                "plan_out_of_plumb",
                "{one} and {other} are {off:.3f} m apart in plan; a plumb line hangs: "
                "expected at most {most:g} m",
                one=start,
                other=end,
                off=off,
                most=OUT_OF_PLUMB_M,
            )
            log.problem("plumb_lines.csv", expected, row, "to")


def _check_control(plan, control, log):
    """Check control against positions in the plan.

    Points placed by control only need x, y and z.
    """
    points, setups = plan.points, [setup.name for setup in plan.setups]
    placed = {name: points[name] for name in (*plan.targets.names, *plan.facing, *setups)}
    constraining = {point.name for point in plan.known}
    stated = np.column_stack([control.numbers(f"{axis}_m") for axis in "xyz"])
    for row, name, xyz in zip(control.rows, control.of("point"), stated, strict=True):
        if name in placed:
            off = np.nan_to_num(xyz - placed[name])
            if np.linalg.norm(off) > OFF_M:
                where = ", ".join(f"{value:.3f}" for value in placed[name])
                expected = message(
                    "plan_control_off",
                    "{point} is given {off:.3f} m from its place in the plan ({where}); "
                    "expected it within {most:g} m, or blank",
                    point=name,
                    off=np.linalg.norm(off),
                    where=where,
                    most=OFF_M,
                )
                column = f"{'xyz'[np.argmax(np.abs(off))]}_m"
                log.problem(control.file, expected, row, column)
        elif name in constraining and np.isnan(xyz).any():
            expected = message(
                "plan_control_no_target",
                "{point} is no target of the plan; expected all its coordinates",
                point=name,
            )
            log.problem(control.file, expected, row, "point")


# ---- bases: end points, sight, distance


def _check_bases(plan, plan_input, log):
    """Check that every base connects a set-up to a visible station at a measurable distance.

    plan_input: valid PlanInput.
    """
    if not has_rows(plan_input.stadia):
        return
    setups = [setup.name for setup in plan.setups]
    stations = [name for name in plan.points if name not in plan.targets.names]
    for base in plan.bases:
        is_known = True
        for column, name, known in (("setup", base.setup, setups), ("to", base.to, stations)):
            if name not in known:
                is_known = False
                log.problem(STADIA_FILE, _unknown_station(column, name, known), base.row, column)
        if base.setup == base.to:
            refuse_itself(log, plan_input.stadia, base.row, base.to)
        elif is_known and (why := _explain_unreadable_bar(plan, base)):
            log.problem(STADIA_FILE, why, base.row, "to")


def _unknown_station(column, name, known):
    hint = nearest(name, known)
    if column == "setup":
        return message(
            "plan_no_such_setup",
            "found {found!r}; expected a set-up of the plan{hint}",
            found=name,
            hint=hint,
        )
    return message(
        "plan_no_such_station",
        "found {found!r}; expected a set-up of the plan or a point of control.csv{hint}",
        found=name,
        hint=hint,
    )


def _explain_unreadable_bar(plan, base):
    """Return the reason why the bar of a Base cannot be read; "" if it can."""
    length, distance = plan.bars[base.bar], base_m(plan, base)
    least, most = distance_of_angle_m(np.array([WIDEST_RAD, NARROWEST_RAD]), length)
    if not least <= distance <= most:
        return message(
            "plan_base_length",
            "a base of {base:.2f} m; expected {least:.2f} to {most:.0f} m: the bar is {length:g} m"
            " long",
            base=distance,
            least=float(least),
            most=float(most),
            length=length,
        )
    here, there = plan.points[base.setup], plan.points[base.to]
    if not find_in_sight(plan, here, there[None], np.full((1, 3), np.nan))[0]:
        return message_of_cut_line(base.setup, base.to)
    # Horizontal positions (2, 2) of the ends of a bar over a station, square to the sight.
    east, north = (there - here)[:2] / np.hypot(*(there - here)[:2])
    half = length / 2 * np.array([north, -east])
    ends = there[:2] + np.array([half, -half])
    off = np.hypot(*(ends - plan.shell.axis_m).T) - plan.shell.radius_m
    is_level = plan.shell.low_m <= there[2] <= plan.shell.high_m
    if is_level and (off < GRAZE_M if plan.shell.is_outside else off > -GRAZE_M).any():
        return message(
            "plan_bar_in_wall",
            "the bar over {other}, square to the sight from {one}, would reach through the wall;"
            " expected a station further off it",
            one=base.setup,
            other=base.to,
        )
    return ""


# ---- obstacles and tapes


def _warn_of_places(plan, plan_input, log):
    """Warn of obstacles far from the tank, and of tapes that cannot hang on the shell."""
    shell = plan.shell
    heights = [shell.low_m, shell.high_m]
    heights += [stand.xyz_m[2] for stand in (*plan.photos, *plan.setups)]
    far = []
    for obstacle in plan.obstacles:
        low, high = (float(np.ravel(end)[-1]) for end in (obstacle.low_m, obstacle.high_m))
        away = _distance_to_wall_m(obstacle, shell)
        if away > FAR_M or low > max(heights) or high < min(heights):
            far.append(
                message(
                    "plan_obstacle_place",
                    "{obstacle} ({away_m:.6g} m from the wall, z {low_m:.6g} to {high_m:.6g} m)",
                    obstacle=obstacle.name,
                    away_m=away,
                    low_m=low,
                    high_m=high,
                )
            )
    if far:
        text = message(
            "plan_obstacles_far",
            "hide nothing, because the shell is at z = {bottom_m:.6g} to {top_m:.6g} m: "
            "{obstacles}; are they in the frame of the survey, in metres?",
            bottom_m=float(shell.low_m),
            top_m=float(shell.high_m),
            obstacles=list_some(far, SHOWN),
        )
        log.warning(PLAN_FILE, text, plan_input.sections["obstacles"][0].row, "obstacles")
    for entry in plan_input.sections["tapes"]:
        _warn_of_tape(plan, entry, log)


def _distance_to_wall_m(obstacle, shell):
    """Horizontal distance of an obstacle from the wall, m; 0 if it reaches the wall."""
    if isinstance(obstacle, Box):
        low, high = obstacle.low_m[:2], obstacle.high_m[:2]
        away = np.hypot(*(np.clip(shell.axis_m, low, high) - shell.axis_m))
    else:
        away = np.hypot(*(obstacle.axis_m - shell.axis_m)) - obstacle.radius_m
    return max(float(away) - shell.radius_m, 0.0)


def _warn_of_tape(plan, entry, log):
    """Warn of a tape with ends above the shell, or farther from the wall than the tank radius."""
    shell = plan.shell
    ends = np.array([plan.extra[f"{entry['name']}{end}"] for end in "ab"])
    off = np.abs(np.hypot(*(ends[:, :2] - shell.axis_m).T) - shell.radius_m).max()
    above = ends[:, 2].max() - shell.high_m
    if off > shell.radius_m or above > 0:
        text = message(
            "plan_tape_off",
            "the ends of {tape} are up to {off_m:.1f} m from the wall and {above_m:+.1f} m from the"
            " top of the shell: can it hang there?",
            tape=entry["name"],
            off_m=float(off),
            above_m=float(above),
        )
        log.warning(PLAN_FILE, text, entry.row, entry.name)
