"""What helps most: changes of a plan one at a time, the best ones in turn, the smallest that does.

A change is judged by U over volume of what the plan's limit is for. Where the targets stay the
same, the wall with its outlines is that of the plan before, and only its covariance is new.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import TankcalError
from tankcal.messages import message
from tankcal.planning.changes import ITEMS, Change, changes_of, cost_of
from tankcal.planning.checks.placed import refuse_misplaced
from tankcal.planning.checks.seen import refuse_blind
from tankcal.planning.limits import limited_u
from tankcal.planning.measurements import measurements_of, nominal_of
from tankcal.planning.prediction import Prediction, predict
from tankcal.planning.table import predicted_table, recompute_table
from tankcal.planning.visibility import visible
from tankcal.planning.wall.changes import SEARCHED
from tankcal.planning.wall.model import WallPlan
from tankcal.survey import predict_survey

OF_FRAME = ("tape", "base", "control_point")  # items that may tell what a survey leaves open
REPEATED = 10  # steps of a greedy search, where nothing else ends it
LEAST_GAIN = 1e-3  # of U over volume, for which an item is added


@dataclass(frozen=True)
class Effect:
    """What one Change does.

    relative_u  of the plan after it; inf: the survey would not work any more, `why` says so
    difference  to the plan before        U_m3  of the full tank after it
    poor        targets that are not determined, or weak for want of rays
    """

    change: Change
    relative_u: float
    difference: float
    U_m3: float
    poor: int
    why: str = ""


@dataclass(frozen=True)
class _NothingBefore:
    """In place of the Prediction of a plan that has none."""

    tabled: None = None
    relative_u: float = np.nan


NOTHING_BEFORE = _NothingBefore()


@dataclass(frozen=True)
class Path:
    """Changes made one after the other, each the best of its round.

    start       Prediction before the first, prediction  after the last
    steps       tuple of Effect                          tried  plans computed
    """

    start: Prediction
    steps: tuple[Effect, ...]
    prediction: Prediction
    tried: int

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
    """Effect of each change of a plan, the one that helps most first.

    Parameters
    ----------
    plan : Plan
    changes : tuple of Change, optional
        None: all of one item.
    progress : callable, optional
        progress(text, done, total).
    before : Prediction, optional
        Of the plan, where it is known.

    Returns
    -------
    tuple of Effect
    """
    changes = changes_of(plan) if changes is None else changes
    before = predict(plan) if before is None else before
    progress = progress or (lambda text, done, total: None)
    found = []
    for number, one in enumerate(changes, 1):
        progress(message("plan_trying_changes", "trying changes"), number, len(changes))
        found.append(_effect(one, before))
    return tuple(sorted(found, key=lambda one: one.relative_u))


def what_would_do(plan, progress=None):
    """Effect of each addition that gives a solution to a plan that has none, the best first.

    Parameters
    ----------
    plan : Plan
        Whose survey would leave its datum, its scale or the vertical open.
    progress : callable, optional
        progress(text, done, total).

    Returns
    -------
    tuple of Effect
        Their difference is nan: there is nothing before.
    """
    found = what_helps(plan, changes_of(plan, ("add",), OF_FRAME), progress, NOTHING_BEFORE)
    return tuple(one for one in found if not one.why)


def greedy(plan, *, add=True, steps=REPEATED, items=ITEMS, changes=None, progress=None):
    """Path of the best change of each round.

    Parameters
    ----------
    plan : Plan
    add : bool, optional
        True: items are added and repeated until the plan's limit is met, or `steps` are done;
        False: items are dropped as long as the limit is met, the dearest for its loss first.
    steps, items, progress : optional
        Most rounds, what may be changed, progress(text, done, total).
    changes : callable, optional
        Function plan -> tuple of Change; None: all of `items`.

    Returns
    -------
    Path
    """
    start = now = predict(plan)
    limit, made, tried = plan.limits.relative_u, [], 0
    actions = ("add", "repeat") if add else ("drop",)
    if isinstance(plan, WallPlan) and items is ITEMS:
        items = SEARCHED
    choose = changes or (lambda now: changes_of(now, actions, items))
    for _ in range(steps):
        if add and now.meets:
            break
        effects = what_helps(now.plan, choose(now.plan), progress, now)
        tried += len(effects)
        step, after = _best(effects, now, limit, add)
        if step is None:
            break
        made.append(step)
        now = after
    return Path(start, tuple(made), now, tried)


def smallest(plan, progress=None, items=ITEMS):
    """Path to the smallest design that meets the limit of a plan.

    Items are added until the limit is met, then dropped as long as it is.

    Parameters
    ----------
    plan : Plan
    progress : callable, optional
        progress(text, done, total).
    items : sequence, optional
        What may be added and dropped.

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
    return Path(first.start, steps, last.prediction, first.tried + last.tried)


def _best(effects, now, limit, add):
    """The Effect of a round and the Prediction after it; None, None: nothing is left to be gained.

    Effects were judged with the outlines of the wall before: the one that is taken is predicted
    anew, and has to do then, too, what it was chosen for. What is dropped leaves no reading without
    control that had some: a blunder in it would go into the table.
    """
    for one in _candidates(effects, now, limit, add):
        after = predict(one.change.plan)
        u = after.relative_u
        if u < now.relative_u if add else u <= limit and _uncontrolled(after) <= _uncontrolled(now):
            top = float(after.table.U_m3[-1])
            return replace(one, relative_u=u, difference=u - now.relative_u, U_m3=top), after
    return None, None


def _uncontrolled(prediction):
    """How many readings nothing controls."""
    return sum(one.uncontrolled for one in prediction.reliability)


def _candidates(effects, now, limit, add):
    """Effects that gain something, or that can be spared, the best first.

    What is dropped leaves no target weaker than it may be, beside those that are weak already.
    """
    works, before = [one for one in effects if not one.why], now.relative_u
    if add:
        gains = [one for one in works if one.relative_u < (1 - LEAST_GAIN) * before]
        return sorted(gains, key=lambda one: _worth(one, before), reverse=True)
    keeps = [one for one in works if limit is not None and one.relative_u <= limit]
    if not isinstance(now.plan, WallPlan):
        poor = poor_targets(now.plan, now.seen, now.tabled)
        keeps = [one for one in keeps if one.poor <= poor]
    return sorted(keeps, key=lambda one: _saving(one, before), reverse=True)


def poor_targets(plan, seen, tabled):
    """How many targets of a plan are not determined, or have fewer rays than its limit."""
    count = len(plan.targets.names)
    lost = count - len(tabled.covariance.points)
    wanted = 0 if plan.setups else plan.limits.rays
    return max(lost, int(np.sum(seen.rays[:count] < wanted)))


def _worth(effect, now):
    """What is free comes first, by its gain; the rest by gain for cost, whatever money is in."""
    gain, cost = now - effect.relative_u, effect.change.cost
    return cost <= 0, gain / cost if cost > 0 else gain


def _saving(effect, now):
    """What saves money comes first, by saving for loss; the rest by its loss."""
    loss, cost = max(effect.relative_u - now, 1e-12), effect.change.cost
    return cost < 0, -cost / loss if cost < 0 else 1.0 / loss


def _effect(change, before):
    """The Effect of a Change, from the Prediction before it."""
    plan = change.plan
    if isinstance(plan, WallPlan):
        return _effect_on_wall(change, before)
    try:
        if change.action == "add":
            refuse_misplaced(plan, change.name)
        seen = visible(plan)
        refuse_blind(plan, seen)
        predicted = predict_survey(measurements_of(plan, seen), nominal_of(plan))
        tabled = before.tabled and recompute_table(plan, predicted, before.tabled)
        tabled = tabled or predicted_table(plan, predicted)
    except TankcalError as error:
        why, inf = str(error).splitlines()[0], float("inf")
        return Effect(change, inf, inf, inf, len(plan.targets.names), why)
    u = limited_u(tabled, plan.limits)
    top = float(tabled.made.table.U_m3[-1])
    return Effect(change, u, u - before.relative_u, top, poor_targets(plan, seen, tabled))


def _effect_on_wall(change, before):
    """The Effect of a Change of a WallPlan: its job, computed again."""
    why, inf = change.why, float("inf")
    if not why:
        try:
            tabled = predict(change.plan).tabled
        except TankcalError as error:
            why = str(error).splitlines()[0]
    if why:
        return Effect(change, inf, inf, inf, 0, why)
    u, top = limited_u(tabled, change.plan.limits), float(tabled.made.table.U_m3[-1])
    return Effect(change, u, u - before.relative_u, top, 0)
