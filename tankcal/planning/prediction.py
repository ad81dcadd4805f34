"""Predict a plan: precision of points and sections, and U of every row of the table."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.job.tables import SETTINGS_FILE
from tankcal.messages import list_some, message
from tankcal.pipeline.checks import SHOWN, VAGUE, check_bases, open_questions
from tankcal.pipeline.checks.wall import OF_SCATTER
from tankcal.pipeline.table import check_table
from tankcal.planning.contract import PLAN_FILE
from tankcal.planning.measurements import measurements_of, nominal_of
from tankcal.planning.model import Plan, WallPlan
from tankcal.planning.places import (
    Visibility,
    describe_separate_bodies,
    find_separate_bodies,
    find_visible,
    refuse_blind,
)
from tankcal.planning.table import (
    PredictedTable,
    TableResults,
    assess_reliability,
    predict_table,
    refuse_without_delivery,
)
from tankcal.planning.wall.prediction import predict_wall
from tankcal.survey import Predicted, predict_survey
from tankcal.survey.network.quality import precision


@dataclass(frozen=True)
class PointOutlook:
    """Prediction for one point.

    Attributes
    ----------
    name : str
        Name of the point.
    rays : int
        Number of rays to it.
    sd_m : ndarray, shape (3,)
        Standard deviations, m; nan if the point is not determined.
    undetermined, weak : str
        Reason why the point is undetermined or weak; "" otherwise.
    """

    name: str
    rays: int
    sd_m: np.ndarray
    undetermined: str
    weak: str


@dataclass(frozen=True)
class SectionOutlook:
    """Prediction for one section.

    Attributes
    ----------
    name : str
        Name of the section.
    height_m : float
        Height above the bottom, m.
    targets : int
        Number of targets.
    centre_sd_m : ndarray, shape (2,)
        Standard deviations of the centre, m.
    radius_sd_m : float
        Standard deviation of the radius, m.
    """

    name: str
    height_m: float
    targets: int
    centre_sd_m: np.ndarray
    radius_sd_m: float


@dataclass(frozen=True)
class Prediction(TableResults):
    """Predicted results of a planned survey.

    Attributes
    ----------
    plan : Plan
    visibility : Visibility
        Visible points per photograph and set-up.
    measurements : Measurements
    network : Predicted
        The network (`surveys.Predicted`).
    result : PredictedTable
        Wall, table and statements.
    points : tuple of PointOutlook
        All points, targets first.
    """

    plan: Plan
    visibility: Visibility
    measurements: object
    network: Predicted
    result: PredictedTable
    points: tuple[PointOutlook, ...]

    @property
    def datum(self):
        """Definition of the datum (`surveys.DatumReport`)."""
        return self.network.frame.report

    @cached_property
    def precision(self):
        """Mean sds and homogeneity of the determined targets (`network.quality.Precision`)."""
        adjusted, points = self.network.adjusted, self.result.points
        return precision(adjusted.xyz_m[points], adjusted.point_covariances_m2[points])

    @cached_property
    def reliability(self):
        """Effects of undetected blunders, a tuple of GroupReliability."""
        result = self.result
        return assess_reliability(self.plan, self.network, result.points, result.by_points_m2)

    @cached_property
    def sections(self):
        """A tuple of SectionOutlook, from the bottom up."""
        return sections_of(self.result)

    @cached_property
    def warnings(self):
        """Warnings of the planned survey and of items without effect, a tuple of Problem."""
        return list_warnings(self)

    @property
    def undetermined(self):
        """PointOutlook of targets and other points that are not determined."""
        return tuple(point for point in self.points if point.undetermined)

    @property
    def weak(self):
        """PointOutlook of points that are determined, but weakly."""
        return tuple(point for point in self.points if point.weak)


def predict(plan):
    """Predict the points, sections and table of a plan.

    Parameters
    ----------
    plan : Plan or WallPlan

    Returns
    -------
    Prediction or WallPrediction

    Raises
    ------
    InputError
        If a camera or set-up sees no target, or a course keeps too few targets.
    SolutionError
        If the survey does not determine its datum, its scale or the vertical.
    """
    if isinstance(plan, WallPlan):
        return predict_wall(plan)
    seen = find_visible(plan)
    refuse_blind(plan, seen)
    measurements = measurements_of(plan, seen)
    _refuse_exact(measurements)
    network = _predict_network(plan, seen, measurements)
    points = _points(plan, seen, network)
    try:
        result = predict_table(plan, network)
    except SolutionError as error:
        idle = (problem.expected for problem in warnings_of_idle_ties(plan, points))
        raise SolutionError(*error.texts, *idle) from error
    refuse_without_delivery(plan, result, plan.shell.high_m - plan.shell.low_m)
    return Prediction(plan, seen, measurements, network, result, points)


def _predict_network(plan, seen, measurements):
    """Return surveys.Predicted; if there is no solution, explain why in terms of the plan."""
    try:
        return predict_survey(measurements, nominal_of(plan))
    except SolutionError as error:
        parts = find_separate_bodies(plan, seen) if plan.setups and not plan.photos else ()
        if len(parts) < 2:
            raise
        raise SolutionError(describe_separate_bodies(parts)) from error


def _refuse_exact(measurements):
    """Raise InputError if all standard deviations are zero."""
    sds = [reading.sd for reading in measurements.readings]
    if measurements.image_points is not None:
        sds.append(measurements.image_points.sd_mm.ravel())
    if not any((sd > 0).any() for sd in sds):
        expected = message(
            "plan_all_exact",
            "an accuracy of zero for everything: expected standard deviations above 0",
        )
        raise InputError(Problem("plan.toml", expected))


def _points(plan, seen, network):
    """Return the PointOutlook of all points."""
    adjusted = network.adjusted
    place = {name: i for i, name in enumerate(adjusted.survey.points)}
    index = np.array([place.get(name, -1) for name in seen.points])
    sd = np.vstack([adjusted.point_sd_m, np.full(3, np.nan)])[index]
    sd[[i for i, k in enumerate(index) if k >= 0 and adjusted.problem.set_aside[k]]] = np.nan
    why = _reasons(network)
    middle = np.nanmedian(sd[: len(plan.targets.names)].max(axis=1))
    outlooks = []
    for name, rays, point_sd in zip(seen.points, seen.rays.tolist(), sd, strict=True):
        lost = ""
        if np.isnan(point_sd).any():
            lost = why.get(name) or _reason_of_few_readings(rays)
        outlooks.append(
            PointOutlook(name, rays, point_sd, lost, _weakness(plan, rays, point_sd, middle))
        )
    return tuple(outlooks)


def _reason_of_few_readings(rays):
    """Reason why a point with too few readings is not determined."""
    if not rays:
        return "is seen from nowhere"
    return "has one ray" if rays == 1 else "has too few readings"


def _weakness(plan, rays, sd_m, middle_m):
    if np.isnan(sd_m).any():
        return ""
    if plan.photos and not plan.setups and rays < plan.limits.rays:
        return f"has {rays} rays, {plan.limits.rays} are wanted"
    if sd_m.max() > VAGUE * middle_m:
        return f"its sd is over {VAGUE:g} times the median"
    return ""


def _reasons(network):
    """Return {name: reason} of points that the survey leaves out."""
    adjusted, reasons = network.adjusted, {}
    for text in network.gathered.aside:
        name, _, why = text.removeprefix("point ").partition(" ")
        reasons[name] = why
    for i, why in enumerate(adjusted.problem.set_aside):
        if why:
            name = adjusted.survey.points[i]
            reasons[name] = why.removeprefix(f"point {name} ")
    return reasons


def sections_of(result):
    """Return the SectionOutlook of each section, from the circle through its targets.

    Standard deviations of the centre are relative to the wall: common motions of all points are
    excluded.
    """
    wall, covariance = result.wall, result.wall.covariance_m2
    rows, n = [], covariance.shape[0]
    for section in wall.sections:
        members = section.group.members
        x, y, _ = result.job.points.xyz_m[wall.accepted[members]].T
        away = np.column_stack([x - section.circle.x_m, y - section.circle.y_m])
        unit = away / np.linalg.norm(away, axis=1)[:, None]
        # Circle fit, linearised: radial error = unit vector times centre shift + radius change.
        inverse = np.linalg.pinv(np.column_stack([unit, np.ones(len(unit))]))
        row = np.zeros((3, n))
        row[:, 3 * members], row[:, 3 * members + 1] = inverse * unit[:, 0], inverse * unit[:, 1]
        rows.append(row)
    jacobian = np.vstack(rows)
    variance = np.einsum("ij,ji->i", jacobian, covariance @ jacobian.T).reshape(-1, 3)
    sd = np.sqrt(np.maximum(variance, 0.0))
    return tuple(
        SectionOutlook(
            section.group.name, section.group.height_m, len(section.group.members), section_sd[:2],
            float(section_sd[2]),
        )
        for section, section_sd in zip(wall.sections, sd, strict=True)
    )  # fmt: skip


# ---- warnings


def list_warnings(prediction):
    """Return a tuple of Problem for the plan, its network, the wall and the table."""
    result = prediction.result
    of_table = check_table(result.job, result.wall, result.computed_table)
    of_run = (
        *prediction.network.frame.warnings,
        *open_questions(result.job, prediction.datum, result.job.points.causes),
        *(
            problem
            for problem in of_table
            if getattr(problem.expected, "code", None) not in OF_SCATTER
        ),
    )
    return (
        *prediction.plan.warnings,
        *_warn_about_undetermined_targets(prediction),
        *warnings_of_idle_ties(prediction.plan, prediction.points),
        *_warn_about_uncontrolled(prediction.reliability),
        *check_bases(prediction.measurements),
        *(
            replace(problem, file=PLAN_FILE) if problem.file == SETTINGS_FILE else problem
            for problem in of_run
        ),
    )


def _warn_about_undetermined_targets(prediction):
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


def warnings_of_idle_ties(plan, points):
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


def _warn_about_uncontrolled(groups):
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
