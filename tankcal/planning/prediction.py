"""A plan answered: how well points, sections and every row of the table will be known."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tankcal.errors import InputError, Problem, SolutionError
from tankcal.messages import message
from tankcal.pipeline.survey_warnings import VAGUE
from tankcal.planning.bodies import describe_separate_bodies, find_separate_bodies
from tankcal.planning.checks.seen import refuse_blind
from tankcal.planning.doubtful import reliability
from tankcal.planning.foreseen import foreseen, idle_ties
from tankcal.planning.limits import OfTable, refuse_without_delivery
from tankcal.planning.measurements import measurements_of, nominal_of
from tankcal.planning.model import Plan
from tankcal.planning.table import PredictedTable, predicted_table
from tankcal.planning.visibility import Visibility, visible
from tankcal.planning.wall.model import WallPlan
from tankcal.planning.wall.prediction import predict_wall
from tankcal.survey import Predicted, predict_survey
from tankcal.survey.network.quality import precision


@dataclass(frozen=True)
class PointOutlook:
    """What is foreseen of one point.

    Attributes
    ----------
    name : str
        The point.
    rays : int
        Rays that see it.
    sd_m : ndarray, shape (3,)
        Standard deviations, m; nan where the point is not determined.
    undetermined, weak : str
        Why it is not determined, or weak; "" where sound.
    """

    name: str
    rays: int
    sd_m: np.ndarray
    undetermined: str
    weak: str


@dataclass(frozen=True)
class SectionOutlook:
    """What is foreseen of one section.

    Attributes
    ----------
    name : str
        The section.
    height_m : float
        Its height above the bottom, m.
    targets : int
        Its targets.
    centre_sd_m : ndarray, shape (2,)
        Standard deviations of its centre, m.
    radius_sd_m : float
        Standard deviation of its radius, m.
    """

    name: str
    height_m: float
    targets: int
    centre_sd_m: np.ndarray
    radius_sd_m: float


@dataclass(frozen=True)
class Prediction(OfTable):
    """What a survey would give, before it is made.

    Attributes
    ----------
    seen : Visibility
        What is seen from where.
    predicted : Predicted
        The network (`surveys.Predicted`).
    tabled : PredictedTable
        Wall, table and statements.
    points : tuple of PointOutlook
        Of all points, targets first.
    """

    plan: Plan
    seen: Visibility
    measurements: object
    predicted: Predicted
    tabled: PredictedTable
    points: tuple[PointOutlook, ...]

    @property
    def datum(self):
        """What holds the frame (`surveys.DatumReport`)."""
        return self.predicted.frame.report

    @cached_property
    def precision(self):
        """Mean sds and homogeneity of the determined targets (`network.quality.Precision`)."""
        adjusted, points = self.predicted.adjusted, self.tabled.covariance.points
        return precision(adjusted.xyz_m[points], adjusted.point_covariances_m2[points])

    @cached_property
    def reliability(self):
        """What blunders could do unnoticed: a tuple of GroupReliability."""
        tabled = self.tabled
        return reliability(self.plan, self.predicted, tabled.covariance, tabled.by_points_m2)

    @cached_property
    def sections(self):
        """A tuple of SectionOutlook, from the bottom up."""
        return sections_of(self.tabled)

    @cached_property
    def warnings(self):
        """A tuple of Problem: what the run of such a survey will warn of, and what is in vain."""
        return foreseen(self)

    @property
    def undetermined(self):
        """The PointOutlook of targets and other points that are not determined."""
        return tuple(one for one in self.points if one.undetermined)

    @property
    def weak(self):
        """The PointOutlook of those that are determined, but weakly."""
        return tuple(one for one in self.points if one.weak)


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
        For a camera or set-up that sees nothing, and where a course keeps too few targets.
    SolutionError
        When the survey would not determine its datum, its scale, the vertical.
    """
    if isinstance(plan, WallPlan):
        return predict_wall(plan)
    seen = visible(plan)
    refuse_blind(plan, seen)
    measurements = measurements_of(plan, seen)
    _refuse_exact(measurements)
    predicted = _predicted(plan, seen, measurements)
    points = _points(plan, seen, predicted)
    try:
        tabled = predicted_table(plan, predicted)
    except SolutionError as error:
        idle = (one.expected for one in idle_ties(plan, points))
        raise SolutionError(*error.texts, *idle) from error
    refuse_without_delivery(plan, tabled, plan.shell.high_m - plan.shell.low_m)
    return Prediction(plan, seen, measurements, predicted, tabled, points)


def _predicted(plan, seen, measurements):
    """surveys.Predicted; where there is none, in words of the plan as far as these are known."""
    try:
        return predict_survey(measurements, nominal_of(plan))
    except SolutionError as error:
        parts = find_separate_bodies(plan, seen) if plan.setups and not plan.photos else ()
        if len(parts) < 2:
            raise
        raise SolutionError(describe_separate_bodies(parts)) from error


def _refuse_exact(measurements):
    """Raise where nothing that is measured has any uncertainty."""
    sds = [one.sd for one in measurements.readings]
    if measurements.image_points is not None:
        sds.append(measurements.image_points.sd_mm.ravel())
    if not any((one > 0).any() for one in sds):
        expected = message(
            "plan_all_exact",
            "an accuracy of zero for everything: expected standard deviations above 0",
        )
        raise InputError(Problem("plan.toml", expected))


def _points(plan, seen, predicted):
    """PointOutlook of all points."""
    adjusted = predicted.adjusted
    place = {name: i for i, name in enumerate(adjusted.survey.points)}
    there = np.array([place.get(name, -1) for name in seen.points])
    sd = np.vstack([adjusted.point_sd_m, np.full(3, np.nan)])[there]
    sd[[i for i, k in enumerate(there) if k >= 0 and adjusted.problem.set_aside[k]]] = np.nan
    why = _reasons(predicted)
    middle = np.nanmedian(sd[: len(plan.targets.names)].max(axis=1))
    found = []
    for name, rays, own in zip(seen.points, seen.rays.tolist(), sd, strict=True):
        lost = ""
        if np.isnan(own).any():
            lost = why.get(name) or _too_few(rays)
        found.append(PointOutlook(name, rays, own, lost, _weakness(plan, rays, own, middle)))
    return tuple(found)


def _too_few(rays):
    """Why a point without readings is not determined."""
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


def _reasons(predicted):
    """{name: why} of points that the survey leaves out."""
    adjusted, found = predicted.adjusted, {}
    for text in predicted.gathered.aside:
        name, _, why = text.removeprefix("point ").partition(" ")
        found[name] = why
    for i, why in enumerate(adjusted.problem.set_aside):
        if why:
            name = adjusted.survey.points[i]
            found[name] = why.removeprefix(f"point {name} ")
    return found


def sections_of(tabled):
    """A SectionOutlook of each section: sds of the circle through its targets.

    The centre's are those within the wall: what all points have in common is left out.
    """
    wall, covariance = tabled.wall, tabled.covariance
    rows, n = [], 3 * len(covariance.points)
    for section in wall.sections:
        members = section.group.members
        x, y, _ = tabled.job.points.xyz_m[wall.accepted[members]].T
        away = np.column_stack([x - section.circle.x_m, y - section.circle.y_m])
        unit = away / np.linalg.norm(away, axis=1)[:, None]
        inverse = np.linalg.pinv(np.column_stack([unit, np.ones(len(unit))]))
        row = np.zeros((3, n))
        row[:, 3 * members], row[:, 3 * members + 1] = inverse * unit[:, 0], inverse * unit[:, 1]
        rows.append(row)
    jacobian = np.vstack(rows)
    variance = np.einsum("ij,ji->i", jacobian, covariance @ jacobian.T).reshape(-1, 3)
    sd = np.sqrt(np.maximum(variance, 0.0))
    return tuple(
        SectionOutlook(
            section.group.name, section.group.height_m, len(section.group.members), one[:2],
            float(one[2]),
        )
        for section, one in zip(wall.sections, sd, strict=True)
    )  # fmt: skip
