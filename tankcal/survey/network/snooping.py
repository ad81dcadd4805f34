"""Detection of blunders: a robust start for many, iterative data snooping for the others.

Image points are rejected with both coordinates, other observations one by one. A rejected
observation that agrees after other rejections is restored. Source: Baarda 1968; Krarup, Juhl &
Kubik 1980 (the Danish method); Huber 1964.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from tankcal.adjust import CRITICAL, SD_OVER_MEDIAN
from tankcal.adjust import snoop as search
from tankcal.errors import SolutionError
from tankcal.survey.network.adjustment import adjust
from tankcal.survey.network.reliability import tau_limit
from tankcal.survey.network.survey import IMAGES

HUBER_ROUNDS, ROUNDS = 5, 25
HUBER, DANISH = 2.0, 3.0
AT_ONCE = 0.6  # share of the largest test statistic above which observations are rejected together
RETURNS = 3  # restorations of one observation, so that the search terminates


@dataclass(frozen=True)
class CleanedSurvey:
    """A survey without its blunders.

    Attributes
    ----------
    adjusted : Adjusted
        Adjusted without the rejected observations.
    survey : Survey
        With `use` set.
    removed : tuple of RemovedObservation
        Rejected observations.
    rounds : int
        Number of adjustments.
    suspects : tuple of RemovedObservation
        Exact observations, which are never rejected, that were significant in the first adjustment;
        rejected readings may be consequences of their errors.
    needed : tuple of RemovedObservation
        Significant observations that were kept because unknowns would otherwise be undetermined.
    """

    adjusted: object
    survey: object
    removed: tuple
    rounds: int
    suspects: tuple = ()
    needed: tuple = ()


@dataclass(frozen=True)
class RemovedObservation:
    """A rejected observation: kind, source, row in the source, and test statistic."""

    kind: str
    source: object
    row: int
    w: float


def snoop(survey, *, critical=CRITICAL, test="w", robust=True, max_rounds=200, **options):
    """Adjust a survey without the observations that disagree with the others.

    Exact observations (sd 0) and those in survey.kept are never rejected.

    Parameters
    ----------
    survey : Survey
    critical : float
        Critical value of the w-test.
    test : str
        "w": standard deviations are valid as declared (Baarda); "tau": up to a common factor,
        estimated by sigma0 (Pope), with the same probability of a false alarm.
    robust : bool
        Whether to start with robust weights.
    max_rounds : int
    **options
        Of tankcal.survey.network.adjust.

    Returns
    -------
    CleanedSurvey

    Raises
    ------
    SolutionError
        If the adjustment fails.
    ValueError
        For an unknown test.
    """
    if test not in ("w", "tau"):
        raise ValueError(f"test {test!r}: w or tau")
    candidates = _Candidates(survey)
    survey = candidates.restore_kept(survey)
    adjusted, rounds = adjust(survey, **options), 1
    limit = _limit(adjusted, critical, test)
    suspects = _suspects(adjusted, limit)
    # A survey without significant observations needs no robust start.
    if robust and np.nanmax(candidates.statistic(adjusted)[1], initial=0) > limit:
        try:
            thinner, rounds = _robust(candidates, adjusted, critical, options)
            adjusted = adjust(thinner, **options)
        except SolutionError:
            rounds += 1  # too many were rejected at once: search one by one

    def tests(now):
        return *candidates.statistic(now), _limit(now, critical, test)

    def readjust(now, goes, comes):
        share = candidates.shares(now.survey)
        # A restored observation takes part fully, a rejected one not at all.
        share[comes], share[goes] = 1.0, 0.0
        return adjust(
            candidates.with_shares(start_from_adjusted(now.survey, now), share), **options
        )

    result = search(
        adjusted, tests, readjust, at_once=AT_ONCE, returns=RETURNS,
        choose=candidates.choose_one_per_point, keep=True, rounds=max_rounds,
    )  # fmt: skip
    survey = result.adjustment.survey
    removed = candidates.list_removed(candidates.shares(survey) == 0, result.statistic)
    needed = candidates.list_removed(result.needed, result.statistic)
    rounds += result.rounds
    return CleanedSurvey(result.adjustment, survey, removed, rounds, suspects, needed)


def _suspects(adjusted, limit):
    """Exact observations that contradict the others, the worst first."""
    suspects = [
        RemovedObservation(
            table.kind, table.source, int(table.rows[i]), float(table.test_statistic[i])
        )
        for table in adjusted.residuals
        if table.exact
        for i in np.flatnonzero(table.test_statistic > limit)
    ]
    return tuple(sorted(suspects, key=lambda suspect: -suspect.w))


def _limit(adjusted, critical, test):
    """Critical value of |w|: as given, or sigma0 times that of tau."""
    if test == "w" or adjusted.dof < 2:
        return critical
    alpha = 2 * float(ndtr(-critical))
    return adjusted.sigma0 * tau_limit(alpha, adjusted.dof)


def kept_rows(observations, kept):
    """Mask (n,) of observations from readings that are kept, (file, row) each."""
    trace = observations.trace
    if trace is None:
        return np.zeros(len(observations), dtype=bool)
    return np.array([(trace.file, row) in kept for row in trace.rows], dtype=bool)


def start_from_adjusted(survey, adjusted):
    """The survey with adjusted values as start values, where they exist."""
    state, centre = adjusted.solution.unknowns, adjusted.problem.centre_m
    is_adjusted = np.isfinite(adjusted.xyz_m)
    changes = {"xyz_m": np.where(is_adjusted, centre + state.xyz_m, survey.xyz_m)}
    changes["sets"] = state.nuisance["orientation_rad"]
    if survey.photos is not None:
        changes["photos"] = replace(
            survey.photos, xyz_m=centre + state.photo_xyz_m, rotation=state.rotation
        )
    return replace(survey, **changes)


def set_use(survey, uses):
    """The survey with weight factors {source: (n,)} of its observations."""
    observations = [
        table.using(uses[number]) if number in uses else table
        for number, table in enumerate(survey.observations)
    ]
    images = survey.image_points
    if IMAGES in uses:
        images = images.using(uses[IMAGES])
    return replace(survey, observations=tuple(observations), image_points=images)


def _tables(adjusted):
    """Residuals of observations that may be rejected."""
    tables = adjusted.residuals
    return [t for t in tables if t.source != "known beforehand" and not t.exact]


def _robust(candidates, adjusted, critical, options):
    """Find outliers by iteratively reduced weights.

    Returns
    -------
    survey : Survey
        With weight factor zero for the outliers.
    rounds : int
    """
    for turn in range(ROUNDS):
        statistic = candidates.statistic(adjusted)[1]
        # Robust scale from the median statistic; never below the declared scale, 1.
        size = max(1.0, SD_OVER_MEDIAN * float(np.nanmedian(statistic)) / 1.4)
        away, share = statistic / size, candidates.shares(adjusted.survey)
        if turn < HUBER_ROUNDS:
            # First rounds: Huber weights limit the influence of outliers.
            new = np.minimum(1.0, HUBER / np.maximum(away, 1e-9))
        else:
            # Later rounds: Danish weights approach zero for outliers.
            new = np.exp(-0.5 * np.maximum(0.0, (away / DANISH) ** 2 - 1))
        new = np.where(np.isnan(away), share, np.maximum(new, 1e-6))
        change = np.abs(new - share).max(initial=0)
        survey = candidates.with_shares(start_from_adjusted(adjusted.survey, adjusted), new)
        adjusted = adjust(survey, **{**options, "tolerance": 1e-2})
        if turn > HUBER_ROUNDS and change < 0.02:
            break
    away, share = candidates.statistic(adjusted)[1] / size, candidates.shares(survey)
    # The final decision uses the test alone: weights between 0 and 1 become 0 or 1.
    share = np.where(np.isnan(away), share, away <= critical)
    return candidates.with_shares(survey, share), turn + 2


class _Candidates:
    """All observations of a Survey in one sequence, ordered by source."""

    def __init__(self, survey):
        tables = survey.tables
        counts = {source: len(table) for source, table in tables.items()}
        ends = np.cumsum([0, *counts.values()]).tolist()
        self.count = ends[-1]
        self.slices = dict(zip(counts, map(slice, ends, ends[1:]), strict=False))
        self.kinds = {source: table.kind for source, table in tables.items()}
        self.kept = np.zeros(self.count, dtype=bool)
        for source, table in tables.items() if survey.kept else ():
            self.kept[self.slices[source]] = kept_rows(table, survey.kept)

    def restore_kept(self, survey):
        """The survey in which all kept readings are adjusted, even if initially rejected."""
        if not self.kept.any():
            return survey
        return self.with_shares(survey, np.where(self.kept, 1.0, self.shares(survey)))

    def places(self, table):
        """Positions (n,) of the rows of Residuals."""
        return self.slices[table.source].start + table.rows

    def statistic(self, adjusted):
        """Mask of the used observations, and their test statistics; nan: absent."""
        used, statistic = np.zeros(self.count, dtype=bool), np.full(self.count, np.nan)
        for table in _tables(adjusted):
            places = self.places(table)
            used[places], statistic[places] = table.used, table.test_statistic
        statistic[self.kept] = np.nan  # kept readings are never tested
        return used, statistic

    def shares(self, survey):
        """Weight factors (k,)."""
        share = np.ones(self.count)
        for source, places in self.slices.items():
            use = survey.table(source).use
            if use is not None:
                share[places] = use
        return share

    def with_shares(self, survey, share):
        """The survey with weight factors (k,)."""
        return set_use(survey, {source: share[places] for source, places in self.slices.items()})

    def choose_one_per_point(self, adjusted, goes, share):
        """Reduce rejections to one per point: the others may result from its blunder.

        Of two equal observations (each the only control of the other), the first one read is
        rejected.
        """
        survey = adjusted.survey
        n, tied = len(survey.points), []
        for table in _tables(adjusted):
            table_of_source = survey.table(table.source)
            owners = [
                np.asarray(getattr(table_of_source, name))[table.rows]
                for name in table_of_source.ties
            ]
            tied.append((self.places(table), owners))
        counts = sum(
            (
                np.bincount(points_of_end, minlength=n)
                for _, owners in tied
                for points_of_end in owners
            ),
            np.zeros(n),
        )
        fixed = (adjusted.problem.layout.points < 0).all(axis=1)
        counts[fixed] = np.inf  # fixed points do not follow a blunder
        owner = n + np.arange(self.count)  # observations without a point
        for places, owners in tied:
            if owners:
                owners = np.array(owners)
                # The point with the fewest observations follows a blunder most.
                least = np.argmin(counts[owners], axis=0)[None]
                owner[places] = np.take_along_axis(owners, least, 0)[0]
        order = np.lexsort((-np.where(goes, share, 0.0), owner))
        largest = np.zeros(self.count, dtype=bool)
        largest[order[np.append(True, np.diff(owner[order]) > 0)]] = True
        return goes & largest

    def list_removed(self, which, statistic):
        """Removed for each of `which`, the worst first."""
        w = np.where(np.isnan(statistic), 0.0, statistic)
        rows = [
            RemovedObservation(self.kinds[source], source, int(i), float(w[places][i]))
            for source, places in self.slices.items()
            for i in np.flatnonzero(which[places])
        ]
        return tuple(sorted(rows, key=lambda removed: -removed.w))
