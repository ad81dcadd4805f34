"""What overruling the search changed: what the search said of each, and the volume without it.

The job is found once more without any decision, which is what the search says, and once more
without each: the volume is not linear in who is of the wall. Only volumes are computed for that.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import HeightError, InputError, Problem, SolutionError
from tankcal.geometry.field.cells import MOST_SITES
from tankcal.job.model.overrulings import Overruling
from tankcal.messages import message
from tankcal.pipeline.surveying import find_survey
from tankcal.pipeline.tanks import body_of

SHOWN = 10  # names in a sentence
NO_SOLUTION = "no_solution"
MOST_ALONE = 10  # overrulings whose effect is computed one by one
OUTRAGEOUS = 10.0  # w of a kept reading beyond which it is told
OUTRAGEOUS_M = 0.030  # from the wall: the same of a kept point, whatever its w


@dataclass(frozen=True)
class Overruled:
    """A decision, what the search says of the same without any, and what it is worth.

    Attributes
    ----------
    decision : Overruling
    searched : str
        What the search does with it: "" it is used, else the code of a reason ("removed" of a
        reading); "no_solution" where the search alone finds none, or none with it.
    off_m : float
        From the wall as the search has it, outwards, m; nan of a reading.
    w : float
        Its normalised residual there; nan: none was computed.
    moved_m3 : float
        The volume at the top of the table less what it is without this decision, m3; nan: not
        computed, or without it there is no sound solution.
    """

    decision: Overruling
    searched: str
    off_m: float
    w: float
    moved_m3: float = np.nan

    @property
    def is_outrageous(self):
        """Is it kept, and so far off that it must be told?"""
        far = abs(self.w) > OUTRAGEOUS or abs(self.off_m) > OUTRAGEOUS_M
        return self.decision.is_kept and bool(far)


@dataclass(frozen=True)
class Overrulings:
    """All decisions of a job together.

    Attributes
    ----------
    each : tuple of Overruled
        In the order of the file.
    moved_m3 : float
        The volume at the top of the table less what the search alone gives, m3; nan where that
        gives no sound solution.
    others : tuple of str
        Points and readings that nobody decided about and that changed sides by these decisions.
    """

    each: tuple[Overruled, ...]
    moved_m3: float
    others: tuple[str, ...] = ()


def effect_of(job, found, volume_m3, level_m, progress):
    """`Overrulings` of a job; None where nothing was decided.

    Parameters
    ----------
    job : Job
        As it was read.
    found : Surveyed
        With the decisions.
    volume_m3, level_m : float
        Of the top row of its table: the volume, and its level in the frame of the parts.
    progress : callable
        Called with a line of text as each step begins.
    """
    decisions = job.overrulings
    if not decisions:
        return None
    progress(message("overruling", "computing what overruling the search changed"))
    plain = _Attempt.of(job, (), level_m)
    each = [Overruled(one, *plain.says(one)) for one in decisions]
    together = volume_m3 - plain.volume_m3
    if len(decisions) == 1:
        each = [replace(each[0], moved_m3=together)]
    elif len(decisions) <= MOST_ALONE and _is_small(found.job):
        for i, one in enumerate(each):
            others = (*decisions[:i], *decisions[i + 1 :])
            without = _Attempt.of(job, others, level_m).volume_m3
            each[i] = replace(one, moved_m3=volume_m3 - without)
    return Overrulings(tuple(each), together, _changed(found, plain.found, decisions))


def _is_small(job):
    return job.points is None or len(job.points.names) <= MOST_SITES


@dataclass(frozen=True)
class _Attempt:
    """A job with some of its decisions: `Surveyed`, or None where there is no sound solution, and
    its volume.
    """

    found: object
    volume_m3: float

    @classmethod
    def of(cls, job, decisions, level_m):
        """With these decisions only."""
        try:
            found = find_survey(replace(job, overrulings=decisions), lambda text: None)
            if job.liquid is None:
                body = body_of(found.job, found.survey, uncertain=False)
            else:
                from tankcal.pipeline.liquid import measure_by_liquid

                body = measure_by_liquid(found.job, found.survey).body
            return cls(found, float(body.volume_m3(np.array([level_m]))[0]))
        except (InputError, SolutionError, HeightError):
            return cls(None, np.nan)

    def says(self, one):
        """(what the search does, distance from the wall m, w) of what was decided."""
        if self.found is None:
            return NO_SOLUTION, np.nan, np.nan
        if one.table is not None:
            return self._of_reading(one)
        points = self.found.job.points
        names = () if points is None else points.names
        if one.point not in names:
            return NO_SOLUTION, np.nan, np.nan
        return _states(self.found)[names.index(one.point)]

    def _of_reading(self, one):
        file = _file_of(self.found.job.measurements, one.table)
        readings = self.found.adjustment.readings
        is_it = (readings.columns["file"] == file) & (readings.columns["row"] == one.reading_row)
        mine = readings.where(is_it)
        if not len(mine):
            return NO_SOLUTION, np.nan, np.nan
        worst = max(mine, key=lambda reading: abs(reading.w) if np.isfinite(reading.w) else 0.0)
        return "removed" if worst.removed else "", np.nan, float(worst.w)


def _file_of(measurements, table):
    if table == "image_points":
        return measurements.image_points.file
    return next(one.file for one in measurements.readings if one.table == table)


def _states(found):
    """[(reason, distance from the wall m, w)] of all points of a `Surveyed`."""
    survey = found.survey
    wall = getattr(survey, "surveyed", survey)  # of declared radii, what was measured again
    if hasattr(wall, "shell"):
        shell = wall.shell
        return list(zip(shell.reason, shell.residual_m.tolist(), shell.w.tolist(), strict=True))
    used = np.isin(np.arange(len(wall.residuals_m)), wall.accepted)
    w = wall.residuals_m / wall.noise_m
    reason = np.where(used, "", "far_off").tolist()
    return list(zip(reason, wall.residuals_m.tolist(), w.tolist(), strict=True))


def _changed(found, plain, decisions):
    """What nobody decided about and the search judges differently now: points, then readings."""
    if plain is None:
        return ()
    decided = {one.what for one in decisions}
    changed = []
    if found.job.points is not None and plain.job.points.names == found.job.points.names:
        states = zip(found.job.points.names, _states(found), _states(plain), strict=True)
        changed += [name for name, (now, *_), (before, *_) in states if now != before]
    if found.adjustment is not None:
        changed += sorted(_removed(found.adjustment) ^ _removed(plain.adjustment))
    return tuple(one for one in changed if one not in decided)


def _removed(adjustment):
    """Readings that were rejected, as an `Overruling` names them."""
    return {f"{one.file.removesuffix('.csv')} {one.row}" for one in adjustment.removed}


def warn_of_overrulings(job, overrulings):
    """Warnings about kept points and readings that are outrageous, and about others that changed
    sides.
    """
    if overrulings is None:
        return ()
    told = [
        Problem(one.decision.file, _outrageous(one), one.decision.row, "decision")
        for one in overrulings.each
        if one.is_outrageous
    ]
    if overrulings.others:
        text = message(
            "others_changed",
            "by these decisions the search judges {count} others differently, too: {points}",
            count=len(overrulings.others),
            points=list(overrulings.others[:SHOWN]),
        )
        told.append(Problem(job.overrulings[0].file, text))
    return tuple(told)


def _outrageous(one):
    """What is said of it."""
    if np.isnan(one.off_m):
        return message(
            "kept_outrageous_reading",
            "{what} was kept, but contradicts all others (w = {w:.1f}): U holds only if it is"
            " right; the certificate says by how much it moves the volume",
            what=one.decision.what,
            w=one.w,
        )
    return message(
        "kept_outrageous",
        "{what} was kept, but stands {off_mm:.0f} mm off the wall that the others show: U holds"
        " only if it is wall; the certificate says by how much it moves the volume",
        what=one.decision.what,
        off_mm=1000 * one.off_m,
    )
