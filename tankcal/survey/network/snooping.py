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
from tankcal.survey.network.survey import IMAGES

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

    What holds exactly (sd 0), and what the Survey keeps, is never set aside. Returns a Cleaned.
    Raises SolutionError when the adjustment fails.
    """
    if test not in ("w", "tau"):
        raise ValueError(f"test {test!r}: w or tau")
    candidates = _Candidates(survey)
    survey = candidates.with_kept(survey)
    adjusted, rounds = adjust(survey, **options), 1
    limit = _limit(adjusted, critical, test)
    suspects = _suspects(adjusted, limit)
    if robust and np.nanmax(candidates.statistic(adjusted)[1], initial=0) > limit:
        try:
            thinner, rounds = _robust(candidates, adjusted, critical, options)
            adjusted = adjust(thinner, **options)
        except SolutionError:
            rounds += 1  # too much went at once: one by one then

    def tests(now):
        return *candidates.statistic(now), _limit(now, critical, test)

    def readjust(now, goes, comes):
        share = candidates.shares(now.survey)
        share[comes], share[goes] = 1.0, 0.0
        return adjust(
            candidates.with_shares(start_from_adjusted(now.survey, now), share), **options
        )

    found = search(
        adjusted, tests, readjust, at_once=AT_ONCE, returns=RETURNS,
        choose=candidates.one_of_each_point, keep=True, rounds=max_rounds,
    )  # fmt: skip
    survey = found.adjustment.survey
    removed = candidates.listed(candidates.shares(survey) == 0, found.statistic)
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


def kept_of(one, kept):
    """(n,) which of some observations are readings that are kept, (file, row) each."""
    trace = one.trace
    if trace is None:
        return np.zeros(len(one), dtype=bool)
    return np.array([(trace.file, row) in kept for row in trace.rows], dtype=bool)


def start_from_adjusted(survey, adjusted):
    """The survey with the adjusted values as its start values, where there are any."""
    state, centre = adjusted.solution.unknowns, adjusted.problem.centre_m
    found = np.isfinite(adjusted.xyz_m)
    changes = {"xyz_m": np.where(found, centre + state.xyz_m, survey.xyz_m)}
    changes["sets"] = state.nuisance["orientation_rad"]
    if survey.photos is not None:
        changes["photos"] = replace(
            survey.photos, xyz_m=centre + state.photo_xyz_m, rotation=state.rotation
        )
    return replace(survey, **changes)


def set_use(survey, uses):
    """The survey with the share of each observation; uses {source: (n,)}."""
    observations = [
        one.using(uses[number]) if number in uses else one
        for number, one in enumerate(survey.observations)
    ]
    images = survey.image_points
    if IMAGES in uses:
        images = images.using(uses[IMAGES])
    return replace(survey, observations=tuple(observations), image_points=images)


def _tables(adjusted):
    tables = adjusted.residuals
    return [t for t in tables if t.source != "known beforehand" and not t.exact]


def _robust(candidates, adjusted, critical, options):
    """A survey in which what disagrees has a share of zero, found by weights that fall off."""
    for turn in range(ROUNDS):
        statistic = candidates.statistic(adjusted)[1]
        size = max(1.0, 1.4826 * float(np.nanmedian(statistic)) / 1.4)
        away, share = statistic / size, candidates.shares(adjusted.survey)
        if turn < HUBER_ROUNDS:
            new = np.minimum(1.0, HUBER / np.maximum(away, 1e-9))
        else:
            new = np.exp(-0.5 * np.maximum(0.0, (away / DANISH) ** 2 - 1))
        new = np.where(np.isnan(away), share, np.maximum(new, 1e-6))
        change = np.abs(new - share).max(initial=0)
        survey = candidates.with_shares(start_from_adjusted(adjusted.survey, adjusted), new)
        adjusted = adjust(survey, **{**options, "tolerance": 1e-2})
        if turn > HUBER_ROUNDS and change < 0.02:
            break
    away, share = candidates.statistic(adjusted)[1] / size, candidates.shares(survey)
    share = np.where(np.isnan(away), share, away <= critical)
    return candidates.with_shares(survey, share), turn + 2


class _Candidates:
    """The observations of a Survey in one row, those of one source after those of another."""

    def __init__(self, survey):
        tables = survey.tables
        counts = {source: len(one) for source, one in tables.items()}
        ends = np.cumsum([0, *counts.values()]).tolist()
        self.count = ends[-1]
        self.slices = dict(zip(counts, map(slice, ends, ends[1:]), strict=False))
        self.kinds = {source: one.kind for source, one in tables.items()}
        self.kept = np.zeros(self.count, dtype=bool)
        for source, one in tables.items() if survey.kept else ():
            self.kept[self.slices[source]] = kept_of(one, survey.kept)

    def with_kept(self, survey):
        """The survey in which whatever it keeps takes part, even if it begins set aside."""
        if not self.kept.any():
            return survey
        return self.with_shares(survey, np.where(self.kept, 1.0, self.shares(survey)))

    def places(self, table):
        """(n,) places of the rows of Residuals."""
        return self.slices[table.source].start + table.rows

    def statistic(self, adjusted):
        """Whether each is used, and its test statistic; nan: it does not occur."""
        used, statistic = np.zeros(self.count, dtype=bool), np.full(self.count, np.nan)
        for table in _tables(adjusted):
            mine = self.places(table)
            used[mine], statistic[mine] = table.used, table.test_statistic
        statistic[self.kept] = np.nan  # its word stands, though all others are tested against it
        return used, statistic

    def shares(self, survey):
        """(k,) with which each takes part."""
        share = np.ones(self.count)
        for source, mine in self.slices.items():
            use = survey.table(source).use
            if use is not None:
                share[mine] = use
        return share

    def with_shares(self, survey, share):
        """The survey with the share (k,) of each."""
        return set_use(survey, {source: share[mine] for source, mine in self.slices.items()})

    def one_of_each_point(self, adjusted, goes, share):
        """Mask of what goes, at most one of each point: the others may only follow its blunder.

        Of two that are alike (each other's only control), the one that was read first.
        """
        survey = adjusted.survey
        n, tied = len(survey.points), []
        for table in _tables(adjusted):
            of = survey.table(table.source)
            owners = [np.asarray(getattr(of, name))[table.rows] for name in of.ties]
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
        order = np.lexsort((-np.where(goes, share, 0.0), owner))
        largest = np.zeros(self.count, dtype=bool)
        largest[order[np.append(True, np.diff(owner[order]) > 0)]] = True
        return goes & largest

    def listed(self, which, statistic):
        """Removed for each of `which`, the worst first."""
        w = np.where(np.isnan(statistic), 0.0, statistic)
        found = [
            Removed(self.kinds[source], source, int(i), float(w[mine][i]))
            for source, mine in self.slices.items()
            for i in np.flatnonzero(which[mine])
        ]
        return tuple(sorted(found, key=lambda one: -one.w))
