"""Finding blunders: a robust start for many, iterative data snooping for the rest.

Whole image points are set aside (both coordinates), other observations one by one. An observation
that agrees after all, once others have gone, comes back. Source: Baarda 1968; Krarup, Juhl & Kubik
1980 (the Danish method); Huber 1964.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.survey.network.adjustment import adjust
from tankcal.survey.network.reliability import tau_limit

CRITICAL = 3.29  # two-sided normal, 0.1 %
HUBER_ROUNDS, ROUNDS = 5, 25
HUBER, DANISH = 2.0, 3.0
AT_ONCE = 0.6  # those whose test quantity is above this share of the largest go together
RETURNS = 3  # times that one observation may come back


@dataclass(frozen=True)
class Cleaned:
    """A survey without its blunders.

    adjusted  Adjusted of what is left      survey   with `use` filled in
    removed   tuple of Removed              rounds   adjustments that this took
    suspects  tuple of Removed: what holds exactly (and is never set aside) but disagreed with all
              others in the first adjustment; what was removed may be their victim
    needed    tuple of Removed: what disagrees like a blunder, but was kept because without it
              something would not be determined
    """

    adjusted: object
    survey: object
    removed: tuple
    rounds: int
    suspects: tuple = ()
    needed: tuple = ()


@dataclass(frozen=True)
class Removed:
    """An observation that was set aside: kind, source, row there, and its test quantity."""

    kind: str
    source: object
    row: int
    w: float


def snoop(survey, *, critical=CRITICAL, test="w", robust=True, max_rounds=200, **options):
    """Adjust a Survey without the observations that disagree with the others.

    critical  of the w-test          robust   whether to start with the robust rounds
    test      "w": the sds hold as declared (Baarda); "tau": up to a common factor, which sigma0
              estimates (Pope); its critical value has the same probability of a false alarm
    options   of tankcal.survey.network.adjust

    What holds exactly (sd 0) is never set aside. Returns a Cleaned. Raises SolutionError when the
    adjustment fails.
    """
    if test not in ("w", "tau"):
        raise ValueError(f"test {test!r}: w or tau")
    adjusted, rounds = adjust(survey, **options), 1
    suspects = _suspects(adjusted, _limit(adjusted, critical, test))
    if robust and _worst(adjusted).max(initial=0) > _limit(adjusted, critical, test):
        try:
            thinner, rounds = _robust(survey, adjusted, critical, options)
            adjusted, survey = adjust(thinner, **options), thinner
        except SolutionError:
            rounds += 1  # too much went at once: one by one then
    seen, back, needed, few = {}, {}, {}, False
    for _ in range(max_rounds):
        before = _shares(survey)
        uses, changed = _verdict(adjusted, _limit(adjusted, critical, test), back, needed, few)
        for table in _tables(adjusted):
            seen.update(_quantities(table))
        if not changed:
            kept = _listed(survey, seen, needed)
            return Cleaned(adjusted, survey, _removed(survey, seen), rounds, suspects, kept)
        rounds += 1
        try:
            thinner = with_use(started(survey, adjusted), uses)
            adjusted, survey, few = adjust(thinner, **options), thinner, False
        except SolutionError:
            goes = {
                source: np.flatnonzero((was > 0) & (uses[source] == 0))
                for source, was in before.items()
            }
            if few or sum(map(len, goes.values())) == 1:
                for source, rows in goes.items():
                    needed.setdefault(source, set()).update(rows.tolist())
            few = True
    raise SolutionError(
        message(
            "snooping_unsteady",
            "data snooping did not come to rest in {rounds} rounds",
            rounds=max_rounds,
        )
    )


def _suspects(adjusted, limit):
    """Observations that hold exactly against the others, the worst first."""
    found = [
        Removed(table.kind, table.source, int(table.rows[i]), float(table.test_statistic[i]))
        for table in adjusted.residuals
        if table.exact
        for i in np.flatnonzero(table.test_statistic > limit)
    ]
    return tuple(sorted(found, key=lambda one: -one.w))


def _limit(adjusted, critical, test):
    """Critical value of the test quantities |w|: as given, or sigma0 times that of tau."""
    if test == "w" or adjusted.dof < 2:
        return critical
    alpha = 2 * float(ndtr(-critical))
    return adjusted.sigma0 * tau_limit(alpha, adjusted.dof)


def started(survey, adjusted):
    """The survey with the adjusted values as its start values, where there are any."""
    state, centre = adjusted.solution.unknowns, adjusted.problem.centre_m
    found = np.isfinite(adjusted.xyz_m)
    changes = {"xyz_m": np.where(found, centre + state.xyz_m, survey.xyz_m)}
    changes["sets"] = state.orientation_rad
    if survey.photos is not None:
        changes["photos"] = replace(
            survey.photos, xyz_m=centre + state.photo_xyz_m, rotation=state.rotation
        )
    return replace(survey, **changes)


def with_use(survey, uses):
    """The survey with the share of each observation; uses {source: (n,)}."""
    observations = [
        one.using(uses[number]) if number in uses else one
        for number, one in enumerate(survey.observations)
    ]
    images = survey.image_points
    if "image points" in uses:
        images = replace(images, use=uses["image points"])
    return replace(survey, observations=tuple(observations), image_points=images)


def _shares(survey):
    """{source: (n,)} the shares that a survey has now."""
    shares = {
        number: np.ones(len(one)) if one.use is None else np.array(one.use, dtype=float)
        for number, one in enumerate(survey.observations)
    }
    images = survey.image_points
    if images is not None:
        n = len(images.point)
        shares["image points"] = np.ones(n) if images.use is None else np.array(images.use, float)
    return shares


def _tables(adjusted):
    tables = adjusted.residuals
    return [t for t in tables if t.source != "known beforehand" and not t.exact]


def _worst(adjusted):
    """Largest |w| of each observation, all groups one after the other."""
    return np.concatenate([table.test_statistic for table in _tables(adjusted)])


def _robust(survey, adjusted, critical, options):
    """A survey in which what disagrees has a share of zero, found by weights that fall off."""
    for turn in range(ROUNDS):
        size = max(1.0, 1.4826 * float(np.median(_worst(adjusted))) / 1.4)
        shares, change = _shares(survey), 0.0
        for table in _tables(adjusted):
            away = table.test_statistic / size
            if turn < HUBER_ROUNDS:
                share = np.minimum(1.0, HUBER / np.maximum(away, 1e-9))
            else:
                share = np.exp(-0.5 * np.maximum(0.0, (away / DANISH) ** 2 - 1))
            share = np.maximum(share, 1e-6)
            mine = shares[table.source]
            change = max(change, float(np.abs(share - mine[table.rows]).max(initial=0)))
            mine[table.rows] = share
        survey = with_use(started(survey, adjusted), shares)
        adjusted = adjust(survey, **{**options, "tolerance": 1e-2})
        if turn > HUBER_ROUNDS and change < 0.02:
            break
    shares = _shares(survey)
    for table in _tables(adjusted):
        good = table.test_statistic / size <= critical
        shares[table.source][table.rows] = good.astype(float)
    return with_use(survey, shares), turn + 2


def _verdict(adjusted, critical, back, needed, few):
    """The shares that the residuals ask for, and whether they differ from those there are.

    back    {source: {row: times}} that came back before: `RETURNS` times, else the search could
            circle
    needed  {source: rows} that stay whatever they say
    few     True: only what is furthest off goes
    """
    shares, tables = _shares(adjusted.survey), _tables(adjusted)
    may = [
        table.used & ~np.isin(table.rows, list(needed.get(table.source, ()))) for table in tables
    ]
    off = [
        np.where(mine, table.test_statistic, 0.0) for table, mine in zip(tables, may, strict=True)
    ]
    worst = max((float(one.max(initial=0)) for one in off), default=0.0)
    least = max(critical, (1.0 if few else AT_ONCE) * worst)
    goes = [(one > critical) & (one >= least) for one in off]
    goes = _one_of_each_point(adjusted, tables, goes)
    comes = _coming_back(tables, critical, back) if worst <= critical else goes
    for table, out, into in zip(tables, goes, comes, strict=True):
        shares[table.source][table.rows[into]] = 1.0
        shares[table.source][table.rows[out]] = 0.0
    return shares, any(one.any() for one in (*goes, *comes))


def _one_of_each_point(adjusted, tables, goes):
    """Masks of what goes, at most one of each point: the others may only follow its blunder."""
    survey = adjusted.survey
    n, tied = len(survey.points), []
    for table in tables:
        images = table.source == "image points"
        of = survey.image_points if images else survey.observations[table.source]
        ties = ("point",) if images else of.ties
        tied.append([np.asarray(getattr(of, name))[table.rows] for name in ties])
    counts = sum((np.bincount(one, minlength=n) for owners in tied for one in owners), np.zeros(n))
    counts[(adjusted.problem.layout.points < 0).all(axis=1)] = np.inf  # fixed points follow nothing
    off = np.concatenate(
        [np.where(o, t.test_statistic, 0.0) for t, o in zip(tables, goes, strict=True)]
    )
    alone = n + np.arange(len(off))  # what belongs to no point
    parts, first = [], 0
    for table, owners in zip(tables, tied, strict=True):
        mine = alone[first : first + len(table.rows)]
        first += len(table.rows)
        if owners:
            owners = np.array(owners)
            mine = np.take_along_axis(owners, np.argmin(counts[owners], axis=0)[None], 0)[0]
        parts.append(mine)
    owner = np.concatenate(parts)
    order = np.lexsort((-off, owner))
    largest = np.zeros(len(off), dtype=bool)
    largest[order[np.append(True, np.diff(owner[order]) > 0)]] = True
    cuts = np.cumsum([len(table.rows) for table in tables])[:-1]
    return [out & one for out, one in zip(goes, np.split(largest, cuts), strict=True)]


def _coming_back(tables, critical, back):
    """Masks of what agrees after all: all of it the first time, later one by one."""
    times = [
        np.array([back.get(table.source, {}).get(row, 0) for row in table.rows.tolist()], dtype=int)
        for table in tables
    ]
    agrees = [~table.used & (table.test_statistic < critical) for table in tables]
    comes = [one & (n == 0) for one, n in zip(agrees, times, strict=True)]
    if not any(one.any() for one in comes):
        again = [
            np.where(one & (n < RETURNS), table.test_statistic, np.inf)
            for table, one, n in zip(tables, agrees, times, strict=True)
        ]
        nearest = min((float(one.min(initial=np.inf)) for one in again), default=np.inf)
        comes = [(one == nearest) & np.isfinite(one) for one in again]
    for table, one in zip(tables, comes, strict=True):
        mine = back.setdefault(table.source, {})
        for row in table.rows[one].tolist():
            mine[row] = mine.get(row, 0) + 1
    return comes


def _quantities(table):
    """{(source, row): test quantity} of a table of residuals."""
    rows, values = table.rows.tolist(), table.test_statistic.tolist()
    return {(table.source, row): value for row, value in zip(rows, values, strict=True)}


def _removed(survey, seen):
    """Every observation that is set aside, with the last test quantity it had, the worst first."""
    gone = {source: np.flatnonzero(share == 0) for source, share in _shares(survey).items()}
    return _listed(survey, seen, {source: rows.tolist() for source, rows in gone.items()})


def _listed(survey, seen, rows_of):
    """Removed for each of {source: rows}, the worst first."""
    kinds = {number: one.kind for number, one in enumerate(survey.observations)}
    found = [
        Removed(kinds.get(source, "image coordinate"), source, row, seen.get((source, row), 0))
        for source, rows in rows_of.items()
        for row in rows
    ]
    return tuple(sorted(found, key=lambda one: -one.w))
