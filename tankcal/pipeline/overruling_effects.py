"""Effect of manual decisions: what the search does without them, and how they change the volume.

The job is solved again without any decision, and once without each decision. The volume is not
linear in the accepted points, so separate solutions are needed. Only volumes are computed.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import HeightError, InputError, Problem, SolutionError
from tankcal.geometry.field.sites import MOST_SITES
from tankcal.job.model import Overruling
from tankcal.messages import message
from tankcal.methods.base import supplement_of
from tankcal.pipeline.surveying import find_survey
from tankcal.pipeline.tanks import body_of

SHOWN = 10  # names listed in a message
NO_SOLUTION = "no_solution"
MOST_ALONE = 10  # largest number of decisions whose effects are computed separately
OUTRAGEOUS = 10.0  # |w| of a kept point or reading that causes a warning
OUTRAGEOUS_M = 0.030  # distance of a kept point from the wall that causes a warning


@dataclass(frozen=True)
class Overruled:
    """A decision, the result of the search without decisions, and the effect on the volume.

    Attributes
    ----------
    decision : Overruling
    searched : str
        Result of the search: "" if used, else the code of a reason ("removed" for a reading);
        "no_solution" if the search alone finds no solution, or none with this point or reading.
    off_m : float
        Distance from the wall that the search finds, outwards, m; nan for a reading.
    w : float
        Normalised residual in that solution; nan if not computed.
    moved_m3 : float
        Change of the volume at the top of the table due to this decision, m3; nan if not computed
        or if no valid solution exists without the decision.
    """

    decision: Overruling
    searched: str
    off_m: float
    w: float
    moved_m3: float = np.nan

    @property
    def is_outrageous(self):
        """Whether the decision keeps a point or reading so discrepant that a warning is due."""
        is_discrepant = abs(self.w) > OUTRAGEOUS or abs(self.off_m) > OUTRAGEOUS_M
        return self.decision.is_kept and bool(is_discrepant)


@dataclass(frozen=True)
class Overrulings:
    """All decisions of a job together.

    Attributes
    ----------
    each : tuple of Overruled
        In the order of the file.
    moved_m3 : float
        Change of the volume at the top of the table due to all decisions, m3; nan if the search
        alone gives no valid solution.
    others : tuple of str
        Points and readings without a decision whose acceptance changes because of the decisions.
    """

    each: tuple[Overruled, ...]
    moved_m3: float
    others: tuple[str, ...] = ()


def effect_of(job, surveyed, volume_m3, level_m, progress):
    """`Overrulings` of a job; None without decisions.

    Parameters
    ----------
    job : Job
        As read.
    surveyed : Surveyed
        Solution with the decisions.
    volume_m3, level_m : float
        Volume of the top row of the table, and its level in the frame of the parts.
    progress : callable
        Called with a line of text as each step begins.
    """
    decisions = job.overrulings
    if not decisions:
        return None
    progress(message("overruling", "computing what overruling the search changed"))
    by_search = _Attempt.of(job, (), level_m)
    effects = [Overruled(decision, *by_search.says(decision)) for decision in decisions]
    together = volume_m3 - by_search.volume_m3
    points = surveyed.job.points
    if len(decisions) == 1:
        effects = [replace(effects[0], moved_m3=together)]
    elif len(decisions) <= MOST_ALONE and (points is None or len(points.names) <= MOST_SITES):
        # Few enough points to solve the job once more for each decision.
        for i, effect in enumerate(effects):
            remaining = (*decisions[:i], *decisions[i + 1 :])
            without = _Attempt.of(job, remaining, level_m).volume_m3
            effects[i] = replace(effect, moved_m3=volume_m3 - without)
    return Overrulings(
        tuple(effects), together, _list_changes(surveyed, by_search.found, decisions)
    )


@dataclass(frozen=True)
class _Attempt:
    """Solution of a job with some of its decisions.

    `found` is a `Surveyed`, or None without a valid solution; `volume_m3` is its volume at the
    level.
    """

    found: object
    volume_m3: float

    @classmethod
    def of(cls, job, decisions, level_m):
        """Solve a job with the given decisions only."""
        try:
            surveyed = find_survey(replace(job, overrulings=decisions), lambda text: None)
            method = supplement_of(surveyed.job)
            if method is None:
                body = body_of(surveyed.job, surveyed.survey, uncertain=False)
            else:
                body = method.supplement(surveyed.job, surveyed.survey, lambda text: None).body
            return cls(surveyed, float(body.volume_m3(np.array([level_m]))[0]))
        except (InputError, SolutionError, HeightError):
            return cls(None, np.nan)

    def says(self, decision):
        """(Result of the search, distance from the wall in m, w) for the object of a decision."""
        if self.found is None:
            return NO_SOLUTION, np.nan, np.nan
        if decision.table is not None:
            return self._state_of_reading(decision)
        points = self.found.job.points
        names = () if points is None else points.names
        if decision.point not in names:
            return NO_SOLUTION, np.nan, np.nan
        return _states(self.found)[names.index(decision.point)]

    def _state_of_reading(self, decision):
        """Result of the search for the reading of a decision, like `says`."""
        file = _file_of(self.found.job.measurements, decision.table)
        readings = self.found.adjustment.readings
        is_decided = (readings.columns["file"] == file) & (
            readings.columns["row"] == decision.reading_row
        )
        readings_of_row = readings.where(is_decided)
        if not len(readings_of_row):
            return NO_SOLUTION, np.nan, np.nan
        worst = max(
            readings_of_row, key=lambda reading: abs(reading.w) if np.isfinite(reading.w) else 0.0
        )
        return "removed" if worst.removed else "", np.nan, float(worst.w)


def _file_of(measurements, table):
    """Name of the file of a table of readings."""
    if table == "image_points":
        return measurements.image_points.file
    return next(reading.file for reading in measurements.readings if reading.table == table)


def _states(surveyed):
    """List of (reason, distance from the wall in m, w) of all points of a `Surveyed`."""
    survey = surveyed.survey
    wall = getattr(survey, "surveyed", survey)  # for declared radii: the wall measured again
    if hasattr(wall, "shell"):
        shell = wall.shell
        return list(zip(shell.reason, shell.residual_m.tolist(), shell.w.tolist(), strict=True))
    is_used = np.isin(np.arange(len(wall.residuals_m)), wall.accepted)
    w = wall.residuals_m / wall.noise_m
    reason = np.where(is_used, "", "far_off").tolist()
    return list(zip(reason, wall.residuals_m.tolist(), w.tolist(), strict=True))


def _list_changes(surveyed, by_search, decisions):
    """Undecided points, then readings, whose acceptance differs from that by the search alone."""
    if by_search is None:
        return ()
    decided = {decision.what for decision in decisions}
    changed = []
    if surveyed.job.points is not None and by_search.job.points.names == surveyed.job.points.names:
        states = zip(surveyed.job.points.names, _states(surveyed), _states(by_search), strict=True)
        changed += [name for name, (now, *_), (former, *_) in states if now != former]
    if surveyed.adjustment is not None:
        changed += sorted(
            _removed_readings(surveyed.adjustment) ^ _removed_readings(by_search.adjustment)
        )
    return tuple(name for name in changed if name not in decided)


def _removed_readings(adjustment):
    """Rejected readings, named as in an `Overruling`."""
    return {
        f"{removed_reading.file.removesuffix('.csv')} {removed_reading.row}"
        for removed_reading in adjustment.removed
    }


def warn_of_overrulings(job, overrulings):
    """Warnings of very discrepant kept points and readings, and of changed acceptance of others."""
    if overrulings is None:
        return ()
    problems = [
        Problem(effect.decision.file, _outrageous(effect), effect.decision.row, "decision")
        for effect in overrulings.each
        if effect.is_outrageous
    ]
    if overrulings.others:
        text = message(
            "others_changed",
            "by these decisions the search judges {count} others differently, too: {points}",
            count=len(overrulings.others),
            points=list(overrulings.others[:SHOWN]),
        )
        problems.append(Problem(job.overrulings[0].file, text))
    return tuple(problems)


def _outrageous(effect):
    """Message about a very discrepant point or reading that was kept."""
    if np.isnan(effect.off_m):
        return message(
            "kept_outrageous_reading",
            "{what} was kept, but contradicts all others (w = {w:.1f}): U holds only if it is"
            " right; the certificate says by how much it moves the volume",
            what=effect.decision.what,
            w=effect.w,
        )
    return message(
        "kept_outrageous",
        "{what} was kept, but stands {off_mm:.0f} mm off the wall that the others show: U holds"
        " only if it is wall; the certificate says by how much it moves the volume",
        what=effect.decision.what,
        off_mm=1000 * effect.off_m,
    )
