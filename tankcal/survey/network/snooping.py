"""Finding blunders: a robust start for many, iterative data snooping for the rest.

Whole image points are set aside (both coordinates), other observations one by one. An observation
that agrees after all, once others have gone, comes back. Source: Baarda 1968; Krarup, Juhl & Kubik
1980 (the Danish method); Huber 1964.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from tankcal.adjust import CRITICAL
from tankcal.adjust import snoop as search
from tankcal.errors import SolutionError
from tankcal.survey.network.adjustment import adjust
from tankcal.survey.network.reliability import tau_limit

HUBER_ROUNDS, ROUNDS = 5, 25
HUBER, DANISH = 2.0, 3.0
AT_ONCE = 0.6  # those whose test quantity is above this share of the largest go together
RETURNS = 3  # times that one observation may come back, else the search could circle


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
    candidates = _Candidates(survey)

    def tests(now):
        return candidates.tests(now, _limit(now, critical, test))

    def readjust(now, goes, comes):
        changed = candidates.shares(now.survey, goes, comes)
        return adjust(with_use(started(now.survey, now), changed), **options)

    found = search(
        adjusted, tests, readjust, at_once=AT_ONCE, returns=RETURNS,
        choose=candidates.one_of_each_point, keep=True, rounds=max_rounds,
    )  # fmt: skip
    survey = found.adjustment.survey
    gone = np.concatenate([np.zeros(0, dtype=bool), *(s == 0 for s in _shares(survey).values())])
    removed = candidates.listed(gone, found.statistic)
    needed = candidates.listed(found.needed, found.statistic)
    return Cleaned(found.adjustment, survey, removed, rounds + found.rounds, suspects, needed)


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


class _Candidates:
    """The observations of a Survey in one row, those of one source after those of another."""

    def __init__(self, survey):
        self.kinds = {number: one.kind for number, one in enumerate(survey.observations)}
        self.count, self.slices = 0, {}
        for source, share in _shares(survey).items():
            self.slices[source] = slice(self.count, self.count + len(share))
            self.count += len(share)

    def places(self, table):
        """(n,) places of the rows of Residuals."""
        return self.slices[table.source].start + table.rows

    def tests(self, adjusted, critical):
        """Whether each is used, its test statistic (nan: it does not occur), and the limit."""
        used, statistic = np.zeros(self.count, dtype=bool), np.full(self.count, np.nan)
        for table in _tables(adjusted):
            mine = self.places(table)
            used[mine], statistic[mine] = table.used, table.test_statistic
        return used, statistic, critical

    def shares(self, survey, goes, comes):
        """{source: (n,)} the shares of a survey when some go and others come back."""
        shares = _shares(survey)
        for source, share in shares.items():
            share[comes[self.slices[source]]] = 1.0
            share[goes[self.slices[source]]] = 0.0
        return shares

    def one_of_each_point(self, adjusted, goes, off):
        """Mask of what goes, at most one of each point: the others may only follow its blunder."""
        survey = adjusted.survey
        n, tied = len(survey.points), []
        for table in _tables(adjusted):
            images = table.source == "image points"
            of = survey.image_points if images else survey.observations[table.source]
            ties = ("point",) if images else of.ties
            owners = [np.asarray(getattr(of, name))[table.rows] for name in ties]
            tied.append((self.places(table), owners))
        counts = sum(
            (np.bincount(one, minlength=n) for _, owners in tied for one in owners), np.zeros(n)
        )
        fixed = (adjusted.problem.layout.points < 0).all(axis=1)
        counts[fixed] = np.inf  # fixed points follow nothing
        owner = n + np.arange(self.count)  # what belongs to no point
        for mine, owners in tied:
            if owners:
                owners = np.array(owners)
                least = np.argmin(counts[owners], axis=0)[None]
                owner[mine] = np.take_along_axis(owners, least, 0)[0]
        order = np.lexsort((-np.where(goes, off, 0.0), owner))
        largest = np.zeros(self.count, dtype=bool)
        largest[order[np.append(True, np.diff(owner[order]) > 0)]] = True
        return goes & largest

    def listed(self, which, statistic):
        """Removed for each of `which`, the worst first."""
        w = np.where(np.isnan(statistic), 0.0, statistic)
        found = [
            Removed(self.kinds.get(source, "image coordinate"), source, int(i), float(w[mine][i]))
            for source, mine in self.slices.items()
            for i in np.flatnonzero(which[mine])
        ]
        return tuple(sorted(found, key=lambda one: -one.w))
