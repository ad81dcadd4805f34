"""Search for improvements of a plan: effects of changes, a greedy search, the smallest design.

A change is judged by U over volume of the quantity in the plan's limit. If the targets do not
change, the wall and its outlines are taken from the plan before. Only the covariance is new.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import TankcalError
from tankcal.messages import message
from tankcal.planning.changes import ITEMS, Change, changes_of, cost_of
from tankcal.planning.measurements import measurements_of, nominal_of
from tankcal.planning.position_checks import refuse_misplaced
from tankcal.planning.prediction import Prediction, predict
from tankcal.planning.table import predict_table, recompute_table, relative_u_of
from tankcal.planning.visibility import find_visible, refuse_blind
from tankcal.planning.wall.changes import SEARCHED
from tankcal.planning.wall.model import WallPlan
from tankcal.survey import predict_survey

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
    tried : int
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
