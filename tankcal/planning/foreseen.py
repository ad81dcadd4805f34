"""Warnings of a planned survey: those that the job would issue, and items without effect."""

from dataclasses import replace

import numpy as np

from tankcal.errors import Problem
from tankcal.job.tables import SETTINGS_FILE
from tankcal.messages import list_some, message
from tankcal.pipeline.section_homogeneity import OF_SCATTER
from tankcal.pipeline.stadia_checks import check_bases
from tankcal.pipeline.survey_warnings import SHOWN, open_questions
from tankcal.pipeline.table import check_table
from tankcal.planning.covariance import PredictedCovariance
from tankcal.planning.given import PLAN_FILE


def foreseen(prediction):
    """Return a tuple of Problem for the plan, its network, the wall and the table."""
    tabled = prediction.tabled
    of_table = check_table(_with_full_covariance(tabled), tabled.wall, tabled.made)
    of_run = (
        *prediction.predicted.frame.warnings,
        *open_questions(tabled.job, prediction.datum, tabled.job.points.causes),
        *(
            problem
            for problem in of_table
            if getattr(problem.expected, "code", None) not in OF_SCATTER
        ),
    )
    return (
        *prediction.plan.warnings,
        *_undetermined_targets(prediction),
        *idle_ties(prediction.plan, prediction.points),
        *_uncontrolled(prediction.reliability),
        *check_bases(prediction.measurements),
        *(
            replace(problem, file=PLAN_FILE) if problem.file == SETTINGS_FILE else problem
            for problem in of_run
        ),
    )


def _with_full_covariance(tabled):
    """Return the job of a PredictedTable with the full covariance of its points."""
    points, adjusted = tabled.job.points, tabled.covariance.adjusted
    number = {name: i for i, name in enumerate(adjusted.survey.points)}
    covariance = PredictedCovariance(adjusted, np.array([number[name] for name in points.names]))
    return replace(tabled.job, points=replace(points, covariance_m2=covariance))


def _undetermined_targets(prediction):
    """Return a Problem about targets that are not determined."""
    targets = set(prediction.plan.targets.names)
    lost = [point.name for point in prediction.undetermined if point.name in targets]
    if not lost:
        return ()
    text = message(
        "plan_targets_lost",
        "targets that are not determined, because they are seen from too few places: {count} of "
        "{all} ({points})",
        count=len(lost),
        all=len(targets),
        points=list_some(lost, SHOWN),
    )
    return (Problem(PLAN_FILE, text, column="pattern"),)


def idle_ties(plan, points):
    """Return a Problem about tapes, bases, levels and plumb lines with an undetermined end.

    points: PointOutlook of all points.
    """
    lost = {point.name for point in points if point.undetermined}
    ties = [(tie.name, (tie.start, tie.end)) for tie in plan.ties]
    ties += [(base.name, (base.setup, base.to)) for base in plan.bases]
    idle = [
        message("plan_tie_end", "{tie} ({points})", tie=name, points=lost_ends)
        for name, ends in ties
        if (lost_ends := [end for end in ends if end in lost])
    ]
    if not idle:
        return ()
    text = message(
        "plan_ties_idle",
        "tapes, bases, height differences and plumb lines without effect, because one of their "
        "ends is not determined: {count} of {all}, {ties}",
        count=len(idle),
        all=len(ties),
        ties=list_some(idle, SHOWN),
    )
    return (Problem(PLAN_FILE, text),)


def _uncontrolled(groups):
    """Return a Problem about kinds of readings (`GroupReliability`) with uncontrolled values."""
    idle = [_describe_group(group) for group in groups if group.uncontrolled]
    if not idle:
        return ()
    text = message(
        "plan_uncontrolled",
        "no other observation checks {groups}: an error there would enter the table unnoticed",
        groups=idle,
    )
    return (Problem(PLAN_FILE, text),)


def _describe_group(group):
    if group.count == 1:
        template = "the only value of {group} ({points})"
        return message("plan_only_value", template, group=group.kind, points="-".join(group.of))
    return message(
        "plan_some_values",
        "{uncontrolled} of {count} values of {group}",
        uncontrolled=group.uncontrolled,
        count=group.count,
        group=group.kind,
    )
