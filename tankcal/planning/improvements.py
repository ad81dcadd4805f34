"""Changes of a plan by one item, and the search for those that improve it.

Search for improvements of a plan: effects of changes, a greedy search, the smallest design.

A change is judged by U over volume of the quantity in the plan's limit. If the targets do not
change, the wall and its outlines are taken from the plan before. Only the covariance is new.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import TankcalError
from tankcal.messages import message
from tankcal.planning.assembly import tape_of
from tankcal.planning.measurements import measurements_of, nominal_of
from tankcal.planning.model import ControlPoint, Plan, WallPlan
from tankcal.planning.places import (
    find_visible,
    group_by_ends,
    new_bases,
    places_around,
    refuse_blind,
    row_heights_m,
)
from tankcal.planning.position_checks import refuse_misplaced
from tankcal.planning.prediction import Prediction, predict
from tankcal.planning.table import predict_table, recompute_table, relative_u_of
from tankcal.planning.wall.changes import SEARCHED, WALL_ITEMS, wall_changes_of, wall_count
from tankcal.survey import predict_survey

ITEMS = ("photo_station", "setup", "tape", "base", "control_point", "target_row", "reading")
IMAGES, SETS = "all image points", "all sets of the total station"  # names of repeated readings
ROW, OF_COURSE = "row ", "row in course "  # prefixes of the names of rows
NEW = "N-"  # prefix of the name of an added item
MOST_READINGS = 100  # largest number of readings of one item, as in plan.toml
# Standard deviations of an added control point or tape if the plan has none to copy.
CONTROL_SD_M, TAPE_SD_M = 0.002, 0.001


@dataclass(frozen=True)
class Change:
    """One change of a Plan.

    Attributes
    ----------
    action : str
        "add", "drop" or "repeat".
    item : str
        One of ITEMS.
    name : str
        Name of the item.
    plan : Plan
        The plan after the change.
    cost : float
        Cost of the plan after the change minus its cost before.
    why : str
        Reason why the change is impossible; "" if it is possible.
    """

    action: str
    item: str
    name: str
    plan: Plan
    cost: float
    why: str = ""


def cost_of(plan):
    """Total cost of the items of a plan.

    Returns
    -------
    float
        Number of items times the unit costs of the plan; 0 if the plan states no costs.
    """
    if isinstance(plan, WallPlan):
        return _price(plan, wall_count(plan))
    count = {
        "photo_station": len(plan.stations),
        "photograph": len(plan.photos),
        "setup": len(plan.setups),
        "tape": sum(tie.table == "distances" for tie in plan.ties),
        "base": len(plan.bases),
        "control_point": len(plan.known),
        "target": len(plan.targets.names),
        "reading": sum(item.readings - 1 for item in (*plan.photos, *plan.ties, *plan.bases))
        + sum(setup.sets - 1 for setup in plan.setups),
    }
    return _price(plan, count)


def _price(plan, count):
    return float(sum(plan.costs.get(name, 0.0) * number for name, number in count.items()))


def changes_of(plan, actions=("add", "drop", "repeat"), items=ITEMS):
    """Return every Change of one item of a Plan or a WallPlan.

    Parameters
    ----------
    plan : Plan or WallPlan
    actions : tuple of str, optional
        Actions to include: "add", "drop", "repeat".
    items : tuple of str, optional
        Items to include.

    Returns
    -------
    tuple of Change
    """
    if isinstance(plan, WallPlan):
        return tuple(_changes_of_wall(plan, actions, WALL_ITEMS if items is ITEMS else items))
    changes = []
    for item in items:
        changes += [change for change in _CHANGES_OF[item](plan) if change[0] in actions]
    before = cost_of(plan)
    return tuple(
        Change(action, item, name, after, cost_of(after) - before)
        for action, item, name, after in changes
    )


def _changes_of_wall(plan, actions, items):
    before = cost_of(plan)
    for action, item, name, apply_change in wall_changes_of(plan):
        if action not in actions or item not in items:
            continue
        try:
            after, why = apply_change(), ""
        except TankcalError as error:  # invalid job: a course would have no readings left
            after, why = plan, str(error).splitlines()[0]
        yield Change(action, item, name, after, cost_of(after) - before, why)


def _stations(plan):
    for station in plan.stations:
        others = tuple(photo for photo in plan.photos if photo.station != station)
        if others or plan.setups:
            yield "drop", "photo_station", station, replace(plan, photos=others)
    places = {photo.station: photo.xyz_m for photo in plan.photos}
    for station, _, place in _halfway_positions(plan, places):
        name = f"{NEW}{station}"
        if name in plan.stations:
            continue
        copied = [photo for photo in plan.photos if photo.station == station]
        # The new station sees the tank as the copied station does, turned about the axis.
        turn = _azimuth(plan, place) - _azimuth(plan, copied[0].xyz_m)
        c, s = np.cos(turn), np.sin(turn)  # clockwise as seen from above
        rotation = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        added = tuple(
            replace(
                photo, name=f"{name}.{k}", station=name, xyz_m=place,
                rotation=photo.rotation @ rotation.T,
            )
            for k, photo in enumerate(copied, 1)
        )  # fmt: skip
        yield "add", "photo_station", name, replace(plan, photos=(*plan.photos, *added))


def _azimuth(plan, place):
    x, y = place[:2] - plan.shell.axis_m
    return np.arctan2(x, y)


def _halfway_positions(plan, places):
    """Yield (name, next name, position (3,)) half-way in azimuth between neighbours of one height.

    places: {name: position (3,)}.
    """
    levels = {}
    for name, xyz in places.items():
        levels.setdefault(round(float(xyz[2]), 3), []).append(name)
    for names in levels.values():
        names = sorted(names, key=lambda name: _azimuth(plan, places[name]))
        if len(names) < 2:
            continue
        for name, next_name in zip(names, names[1:] + names[:1], strict=True):
            here, there = places[name], places[next_name]
            gap = (_azimuth(plan, there) - _azimuth(plan, here)) % (2 * np.pi)
            radius = [np.hypot(*(place[:2] - plan.shell.axis_m)) for place in (here, there)]
            at = places_around(plan.shell.axis_m, _azimuth(plan, here) + gap / 2, np.mean(radius))
            yield name, next_name, np.array([*at, (here[2] + there[2]) / 2])


def _setups(plan):
    for setup in plan.setups:
        others = tuple(
            replace(other, sights=tuple(name for name in other.sights if name != setup.name))
            for other in plan.setups
            if other is not setup
        )
        if others or plan.photos:
            ties = tuple(tie for tie in plan.ties if setup.name not in (tie.start, tie.end))
            bases = tuple(base for base in plan.bases if setup.name not in (base.setup, base.to))
            after = replace(plan, setups=others, ties=ties, bases=bases)
            yield "drop", "setup", setup.name, after
    places = {setup.name: setup.xyz_m for setup in plan.setups}
    for name, other, place in _halfway_positions(plan, places):
        template = next(setup for setup in plan.setups if setup.name == name)
        new = f"{NEW}{name}"
        if new in places:
            continue
        sights = (name, other) if template.sights else ()
        added = replace(template, name=new, xyz_m=place, sights=sights)
        beside = tuple(
            replace(setup, sights=(*setup.sights, new)) if setup.name in sights else setup
            for setup in plan.setups
        )
        yield "add", "setup", new, replace(plan, setups=(*beside, added))


def _tapes(plan):
    for tie in plan.ties:
        yield "drop", "tape", tie.name, _drop_tie(plan, tie)
        again = replace(tie, readings=2 * tie.readings)
        ties = tuple(again if other is tie else other for other in plan.ties)
        if again.readings <= MOST_READINGS:
            yield "repeat", "tape", tie.name, replace(plan, ties=ties)
    yield from _new_tapes(plan)


def _drop_tie(plan, tie):
    """Return the Plan without a tape, and without marks at its ends that no other item uses."""
    others = tuple(other for other in plan.ties if other is not tie)
    needed = {point.name for point in plan.known}
    needed |= {end for other in others for end in (other.start, other.end)}
    spare = {tie.start, tie.end} - needed
    extra, facing = (
        {name: value for name, value in values.items() if name not in spare}
        for values in (plan.extra, plan.facing)
    )
    return replace(plan, ties=others, extra=extra, facing=facing)


def _new_tapes(plan):
    """Yield a tape of each kind that the plan lacks: vertical along the shell, and horizontal."""
    tapes = [tie for tie in plan.ties if tie.table == "distances"]
    tool = tapes[0].instrument if tapes else None
    sd = min((existing.sd_m for existing in tapes), default=TAPE_SD_M)
    tall = plan.shell.high_m - plan.shell.low_m
    for kind, length, low in (("vertical", 0.9 * tall, 0.05 * tall), ("horizontal", None, 1.5)):
        length = plan.shell.radius_m if length is None else length
        for quarter in range(4):
            azimuth = 22.5 + 90.0 * quarter
            name = f"{NEW}{kind[0].upper()}{quarter + 1}"
            entry = {
                "name": name, "kind": kind, "azimuth_deg": azimuth,
                "length_m": length, "low_m": min(low, tall / 2), "off_m": None, "s_mm": 1000 * sd,
                "readings": 1, "instrument": tool,
            }  # fmt: skip
            if any(tie.name == entry["name"] for tie in plan.ties):
                continue
            tie, ends, out = tape_of(entry, plan.shell)
            after = replace(
                plan, ties=(*plan.ties, tie), extra=plan.extra | ends,
                facing=plan.facing | dict.fromkeys(ends, out),
            )  # fmt: skip
            yield "add", "tape", tie.name, after


def _bases(plan):
    """Yield changes of bases; the readings of a base from either end change together."""
    for ends, group in group_by_ends(plan.bases).items():
        name = "-".join(ends)
        others = tuple(base for base in plan.bases if base not in group)
        yield "drop", "base", name, replace(plan, bases=others)
        again = [replace(base, readings=2 * base.readings) for base in group]
        if max(base.readings for base in again) <= MOST_READINGS:
            yield "repeat", "base", name, replace(plan, bases=(*others, *again))
    for pair in new_bases(plan):
        yield "add", "base", pair[0].name, replace(plan, bases=(*plan.bases, *pair))


def _control(plan):
    for point in plan.known:
        others = tuple(other for other in plan.known if other is not point)
        yield "drop", "control_point", point.name, replace(plan, known=others)
    sds = [sd for point in plan.known for sd in point.sd_m.tolist() if sd > 0]
    sd = min(sds, default=CONTROL_SD_M)
    names = {point.name for point in plan.known}
    for number in _spread_targets(plan, 8):
        name = plan.targets.names[number]
        if name not in names:
            point = ControlPoint(name, plan.targets.xyz_m[number], np.full(3, sd))
            yield "add", "control_point", name, replace(plan, known=(*plan.known, point))


def _spread_targets(plan, count):
    """Indices of targets around the shell, alternating between its foot and its top."""
    sections = list(dict.fromkeys(plan.targets.section))
    for k in range(count):
        row = sections[0] if k % 2 == 0 else sections[-1]
        members = [i for i, name in enumerate(plan.targets.section) if name == row]
        yield members[(k * len(members)) // count]


def _row_changes(plan):
    """Yield changes of target rows: drop one unless it is the last of a course, or add one."""
    targets = plan.targets
    for course in dict.fromkeys(targets.course.tolist()):
        after = _add_row(plan, course)
        if after is not None:
            name = f"{OF_COURSE}{plan.job.courses[course].name}"
            yield "add", "target_row", name, after
    for name in dict.fromkeys(targets.section):
        in_row = np.array([section == name for section in targets.section])
        rest = targets.select(~in_row)
        if set(rest.course) == set(targets.course):
            gone = set(targets.select(in_row).names)
            known = tuple(point for point in plan.known if point.name not in gone)
            ties = tuple(tie for tie in plan.ties if not {tie.start, tie.end} & gone)
            after = replace(plan, targets=rest, known=known, ties=ties)
            yield "drop", "target_row", f"{ROW}{name}", after


def _add_row(plan, course):
    """Return the Plan with another row in a course, all rows at Gauss levels; None if too low."""
    targets = plan.targets
    in_course = targets.course == course
    sections = np.array(targets.section)[in_course]
    rows = sorted({*zip(targets.height_m[in_course], sections, strict=True)})
    below = sum(lower.height_m for lower in plan.job.courses[:course])
    levels, _ = row_heights_m([plan.job.courses[course]], len(rows) + 1, targets.clearance_m)
    if len(levels) <= len(rows):
        return None
    xyz, heights = targets.xyz_m.copy(), targets.height_m.copy()
    for (height, section), level in zip(rows, levels, strict=False):
        row = np.array([name == section for name in targets.section])
        xyz[row, 2] += below + level - height
        heights[row] = below + level
    moved = replace(targets, xyz_m=xyz, height_m=heights)
    last = moved.select([name == rows[-1][1] for name in moved.section])
    section, rise = f"{NEW}{len(set(targets.section)) + 1}", levels[-1] - levels[-2]
    added = replace(
        last,
        names=tuple(f"{line}-{section}" for line in last.generatrix),
        section=(section,) * len(last.names),
        height_m=last.height_m + rise,
        xyz_m=last.xyz_m + [0.0, 0.0, rise],
    )
    places = dict(zip(moved.names, moved.xyz_m, strict=True))
    known = tuple(replace(point, xyz_m=places.get(point.name, point.xyz_m)) for point in plan.known)
    return replace(plan, targets=moved.append(added), known=known)


def _readings(plan):
    if plan.photos and max(photo.readings for photo in plan.photos) <= MOST_READINGS / 2:
        photos = tuple(replace(photo, readings=2 * photo.readings) for photo in plan.photos)
        yield "repeat", "reading", IMAGES, replace(plan, photos=photos)
    if plan.setups and max(setup.sets for setup in plan.setups) <= MOST_READINGS / 2:
        setups = tuple(replace(setup, sets=2 * setup.sets) for setup in plan.setups)
        yield "repeat", "reading", SETS, replace(plan, setups=setups)


_CHANGES_OF = {
    "photo_station": _stations,
    "setup": _setups,
    "tape": _tapes,
    "base": _bases,
    "control_point": _control,
    "target_row": _row_changes,
    "reading": _readings,
}


OF_FRAME = ("tape", "base", "control_point")  # items that can determine datum, scale or vertical
REPEATED = 10  # largest number of steps of a greedy search
LEAST_GAIN = 1e-3  # smallest relative reduction of U for which an item is added


@dataclass(frozen=True)
class Effect:
    """Effect of one Change.

    Attributes
    ----------
    change : Change
    relative_u : float
        U over volume after the change; inf if the survey would have no solution.
    difference : float
        Difference of U over volume from the plan before.
    U_m3 : float
        U of the full tank after the change, m3.
    poor : int
        Number of targets that are not determined, or have too few rays.
    why : str
        Reason why the survey has no solution; "" otherwise.
    """

    change: Change
    relative_u: float
    difference: float
    U_m3: float
    poor: int
    why: str = ""


@dataclass(frozen=True)
class _NoPrediction:
    """Placeholder for the Prediction of a plan without a solution."""

    result: None = None
    relative_u: float = np.nan


NO_PREDICTION = _NoPrediction()


@dataclass(frozen=True)
class SearchPath:
    """Sequence of changes, each the best of its round.

    Attributes
    ----------
    start : Prediction
        Prediction before the first change.
    steps : tuple of Effect
    prediction : Prediction
        Prediction after the last change.
    evaluations : int
        Number of plans computed.
    """

    start: Prediction
    steps: tuple[Effect, ...]
    prediction: Prediction
    evaluations: int

    @property
    def plan(self):
        """The Plan at the end."""
        return self.prediction.plan

    @property
    def start_u(self):
        """U over volume at the start."""
        return self.start.relative_u

    @property
    def relative_u(self):
        """U over volume at the end."""
        return self.prediction.relative_u

    @property
    def start_cost(self):
        """Cost at the start."""
        return cost_of(self.start.plan)

    @property
    def cost(self):
        """Cost at the end."""
        return cost_of(self.plan)


def what_helps(plan, changes=None, progress=None, before=None):
    """Return the effects of changes of a plan, largest improvement first.

    Parameters
    ----------
    plan : Plan
    changes : tuple of Change, optional
        None: all changes of one item.
    progress : callable, optional
        progress(text, done, total).
    before : Prediction, optional
        Prediction of the plan, if already computed.

    Returns
    -------
    tuple of Effect
    """
    changes = changes_of(plan) if changes is None else changes
    before = predict(plan) if before is None else before
    progress = progress or (lambda text, done, total: None)
    effects = []
    for number, change in enumerate(changes, 1):
        progress(message("plan_trying_changes", "trying changes"), number, len(changes))
        effects.append(_effect(change, before))
    return tuple(sorted(effects, key=lambda effect: effect.relative_u))


def what_would_do(plan, progress=None):
    """Return the effects of additions that give a solution to a plan without one, best first.

    Parameters
    ----------
    plan : Plan
        Plan whose survey does not determine its datum, its scale or the vertical.
    progress : callable, optional
        progress(text, done, total).

    Returns
    -------
    tuple of Effect
        Their difference is nan, as the plan has no U before.
    """
    effects = what_helps(plan, changes_of(plan, ("add",), OF_FRAME), progress, NO_PREDICTION)
    return tuple(effect for effect in effects if not effect.why)


def greedy(plan, *, add=True, steps=REPEATED, items=ITEMS, changes=None, progress=None):
    """Search greedily: apply the best change of each round.

    Parameters
    ----------
    plan : Plan
    add : bool, optional
        True: add and repeat items until the limit of the plan is met or `steps` rounds are done.
        False: drop items while the limit is met, in order of the cost saved for the loss of U.
    steps : int, optional
        Largest number of rounds.
    items : tuple of str, optional
        Items that may change.
    changes : callable, optional
        Function plan -> tuple of Change; None: all changes of `items`.
    progress : callable, optional
        progress(text, done, total).

    Returns
    -------
    Path
    """
    start = now = predict(plan)
    limit, steps_done, evaluations = plan.limits.relative_u, [], 0
    actions = ("add", "repeat") if add else ("drop",)
    if isinstance(plan, WallPlan) and items is ITEMS:
        items = SEARCHED
    choose = changes or (lambda now: changes_of(now, actions, items))
    for _ in range(steps):
        if add and now.meets:
            break
        effects = what_helps(now.plan, choose(now.plan), progress, now)
        evaluations += len(effects)
        step, after = _best(effects, now, limit, add)
        if step is None:
            break
        steps_done.append(step)
        now = after
    return SearchPath(start, tuple(steps_done), now, evaluations)


def smallest(plan, progress=None, items=ITEMS):
    """Find the smallest design that meets the limit of a plan.

    Items are added until the limit is met, then dropped while it remains met.

    Parameters
    ----------
    plan : Plan
    progress : callable, optional
        progress(text, done, total).
    items : sequence, optional
        Items that may be added and dropped.

    Returns
    -------
    Path

    Raises
    ------
    ValueError
        For a plan without limits.relative_u.
    """
    if plan.limits.relative_u is None:
        raise ValueError("a search needs limits.relative_u in the plan")
    first = greedy(plan, add=True, steps=100, items=items, progress=progress)
    if not first.prediction.meets:
        return first
    last = greedy(first.plan, add=False, steps=1000, items=items, progress=progress)
    steps = first.steps + last.steps
    return SearchPath(first.start, steps, last.prediction, first.evaluations + last.evaluations)


def _best(effects, now, limit, add):
    """Return the Effect of a round and the Prediction after it; (None, None) if none qualifies.

    Effects are computed with the outlines of the wall before the change. The selected change is
    therefore predicted anew and must still qualify. Dropping an item must not leave a controlled
    reading without control, as a blunder in it would enter the table.
    """
    for effect in _candidates(effects, now, limit, add):
        after = predict(effect.change.plan)
        u = after.relative_u
        if (
            u < now.relative_u
            if add
            else u <= limit and _count_uncontrolled(after) <= _count_uncontrolled(now)
        ):
            top = float(after.table.U_m3[-1])
            return replace(effect, relative_u=u, difference=u - now.relative_u, U_m3=top), after
    return None, None


def _count_uncontrolled(prediction):
    """Number of uncontrolled readings."""
    return sum(group.uncontrolled for group in prediction.reliability)


def _candidates(effects, now, limit, add):
    """Return the effects that reduce U enough, or whose items can be dropped, best first.

    Dropping an item must not add to the targets that are weak already.
    """
    possible, before = [effect for effect in effects if not effect.why], now.relative_u
    if add:
        gains = [effect for effect in possible if effect.relative_u < (1 - LEAST_GAIN) * before]
        return sorted(gains, key=lambda gain: _worth(gain, before), reverse=True)
    keeps = [effect for effect in possible if limit is not None and effect.relative_u <= limit]
    if not isinstance(now.plan, WallPlan):
        poor = count_poor_targets(now.plan, now.visibility, now.result)
        keeps = [effect for effect in keeps if effect.poor <= poor]
    return sorted(keeps, key=lambda effect: _saving(effect, before), reverse=True)


def count_poor_targets(plan, seen, result):
    """Number of targets of a plan that are not determined, or have fewer rays than the limit.

    Parameters
    ----------
    plan : Plan
    seen : Visibility
    result : PredictedTable

    Returns
    -------
    int
        With set-ups, rays are not counted, as one set-up determines a target.
    """
    count = len(plan.targets.names)
    lost = count - len(result.points)
    wanted = 0 if plan.setups else plan.limits.rays
    return max(lost, int(np.sum(seen.rays[:count] < wanted)))


def _worth(effect, now):
    """Sort key of additions: free ones first, by their gain; the others by gain over cost."""
    gain, cost = now - effect.relative_u, effect.change.cost
    return cost <= 0, gain / cost if cost > 0 else gain


def _saving(effect, now):
    """Sort key of removals: first by saving over loss if cost is saved, then by loss."""
    loss, cost = max(effect.relative_u - now, 1e-12), effect.change.cost
    return cost < 0, -cost / loss if cost < 0 else 1.0 / loss


def _effect(change, before):
    """Return the Effect of a Change, given the Prediction before it."""
    plan = change.plan
    if isinstance(plan, WallPlan):
        return _effect_on_wall(change, before)
    try:
        if change.action == "add":
            refuse_misplaced(plan, change.name)
        seen = find_visible(plan)
        refuse_blind(plan, seen)
        network = predict_survey(measurements_of(plan, seen), nominal_of(plan))
        result = before.result and recompute_table(plan, network, before.result)
        result = result or predict_table(plan, network)
    except TankcalError as error:
        why, inf = str(error).splitlines()[0], float("inf")
        return Effect(change, inf, inf, inf, len(plan.targets.names), why)
    u = relative_u_of(result, plan.limits)
    top = float(result.computed_table.table.U_m3[-1])
    return Effect(change, u, u - before.relative_u, top, count_poor_targets(plan, seen, result))


def _effect_on_wall(change, before):
    """Return the Effect of a Change of a WallPlan, by computing its job again."""
    why, inf = change.why, float("inf")
    if not why:
        try:
            result = predict(change.plan).result
        except TankcalError as error:
            why = str(error).splitlines()[0]
    if why:
        return Effect(change, inf, inf, inf, 0, why)
    u, top = relative_u_of(result, change.plan.limits), float(result.computed_table.table.U_m3[-1])
    return Effect(change, u, u - before.relative_u, top, 0)
