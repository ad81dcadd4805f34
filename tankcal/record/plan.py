"""Predictions of a survey before it is made: plan.json."""

from dataclasses import replace

import numpy as np

from tankcal.methods.base import count_readings
from tankcal.planning.places import group_by_ends
from tankcal.planning.prediction import PointOutlook, SectionOutlook
from tankcal.planning.table import GroupReliability
from tankcal.planning.wall.changes import wall_count
from tankcal.planning.wall.filling import FillingOutlook
from tankcal.planning.wall.prediction import CourseOutlook, ReadingsOutlook
from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Saved, WarningRecord, fill_from, key, to_plain, warnings_of

PLAN = SavedFormat("tankcal-plan", 1, "plan.json")  # so far one version


class PlannedDatum(Saved):
    """Definition of the frame."""

    choice: str = key("requested datum")
    defect: int = key("number of the seven degrees of freedom that no observation determines")
    words: str = key("a sentence that names them")
    held: list[str] = key("points with axes, or the photo, that define them")
    vertical: bool = key("whether observations determine the vertical")
    scale: bool = key("whether observations determine the scale")


class PlannedSurvey(Saved):
    """Size of the survey."""

    photo_stations: int = key("number")
    photographs: int = key("number")
    setups: int = key("number")
    ties: int = key("number, bases of a stadia among them")
    control_points: int = key("number")
    targets: int = key("number")
    observations: int = key("values")
    unknowns: int = key("number")
    redundancy: int = key("number")
    datum: PlannedDatum = key("definition of the frame")


class PlanLimit(Saved):
    """The limit of the plan."""

    relative_u: float | None = key("U over volume; null: no limit")
    of: str = key("quantity that is limited")
    predicted: float = key("U over volume")
    met: bool | None = key("whether it is met")


class PlannedTable(Saved):
    """The capacity table with its uncertainty."""

    height_m: list[float] = key("dips")
    volume_m3: list[float] = key("below the dip")
    u_m3: list[float] = key("standard uncertainty")
    k: list[float] = key("coverage factor")
    U_m3: list[float] = key("expanded uncertainty")


class PlannedSource(Saved):
    """Contribution of an input."""

    input: str = key("kind of input")
    u_top_m3: float = key("to the top row")


class PlannedDelivery(Saved):
    """The worst delivery of a minimum height, by U over its volume."""

    minimum_m: float = key("least height")
    low_m: float = key("dip", of="relative.low_m")
    high_m: float = key("dip", of="relative.high_m")
    volume_m3: float = key("delivered", of="relative.volume_m3")
    u_m3: float = key("standard uncertainty", of="relative.u_m3")
    dof: float = key("degrees of freedom; null: infinite", of="relative.dof")
    k: float = key("coverage factor", of="relative.k")
    U_m3: float = key("expanded uncertainty", of="relative.U_m3")
    relative: float = key("U over volume", of="relative.relative")


class PlannedPrecision(Saved):
    """Precision of all points together."""

    mean_sd_m: float = key("sqrt(trace / 3n)")
    axis_sd_m: list[float] = key("mean sd along x, y, z")
    range_m: list[float] = key("largest minus smallest sd along x, y, z")
    proportional: float = key("precision is 1 : this value")


class SimulatedPlan(Saved):
    """Results of simulated surveys of the plan."""

    seed: int = key("of the draws")
    blunders: float = key("share of readings with a blunder")
    runs: int = key("with a solution")
    failed: list[str] = key("messages of runs without solution")
    coordinates_scatter_over_predicted: float = key("rms over rms", of="ratio")
    volume_scatter_over_predicted: float = key("of the full tank", of="volume_ratio")
    volume_scatter_over_predicted_sd: float = key("its sd", of="volume_ratio_sd")
    set_aside: list[int] = key("values rejected by the search, of each run")
    volumes_m3: list[float] = key("of the full tank, of each run")


class Fingerprint(Saved):
    """A file of the empty job, to distinguish it from a completed file."""

    file: str = key("name")
    sha256: str = key("of its bytes")


class PlanFile(Saved, kw_only=True):
    """Prediction of a survey by points."""

    format: str = key("see Versions", default=PLAN.format)
    tank: str = key("id", of="plan.job.tank.id")
    side: str = key('"outside" or "inside"', of="plan.job.survey.side")
    survey: PlannedSurvey = key("its size")
    limit: PlanLimit = key("of the plan")
    table: PlannedTable = key("the capacity table")
    sources: list[PlannedSource] = key("of the uncertainty of the top row")
    worst_deliveries: list[PlannedDelivery] = key("of each minimum height")
    sections: list[SectionOutlook] = key("from the bottom up")
    points: list[PointOutlook] = key("targets first")
    precision: PlannedPrecision = key("of the points")
    reliability: list[GroupReliability] = key("of the kinds of observations")
    warnings: list[WarningRecord] = key("on the plan")
    simulated: SimulatedPlan | None = key("null: not requested", default=None)
    job: list[Fingerprint] = key("files of the empty job", default=())


def plain_of(prediction, simulated=None, job=()):
    """Return the `PlanFile` of a Prediction, as plain data.

    Parameters
    ----------
    prediction : planning.prediction.Prediction
    simulated : simulations.Simulated, optional
        Simulated surveys; None: not requested.
    job : sequence of dict, optional
        Files of the empty job, {file, sha256}.

    Returns
    -------
    dict
    """
    file = fill_from(
        PlanFile,
        prediction,
        survey=_survey(prediction),
        precision=fill_from(PlannedPrecision, prediction.precision),
        **_common_parts(prediction),
    )
    return to_plain(replace(file, simulated=fill_from(SimulatedPlan, simulated), job=job))


def _common_parts(prediction):
    """Return the keys common to all plans: limit, table, sources, deliveries, warnings."""
    table, limits = prediction.table, prediction.plan.limits
    return {
        "limit": PlanLimit(
            limits.relative_u, limits.quantity, prediction.relative_u, prediction.meets
        ),
        "table": fill_from(PlannedTable, table),
        "sources": [
            PlannedSource(source.kind, np.linalg.norm(source.columns_m3[-1]))
            for source in table.sources
        ],
        "worst_deliveries": [
            fill_from(PlannedDelivery, worst) for worst in prediction.result.stated.worst
        ],
        "warnings": warnings_of(prediction.warnings),
    }


def _survey(prediction):
    plan, solution = prediction.plan, prediction.network.adjusted.solution
    return PlannedSurvey(
        photo_stations=len(plan.stations),
        photographs=len(plan.photos),
        setups=len(plan.setups),
        ties=len(plan.ties) + len(group_by_ends(plan.bases)),
        control_points=len(plan.known),
        targets=len(plan.targets.names),
        observations=solution.rows,
        unknowns=solution.estimated,
        redundancy=solution.dof,
        datum=fill_from(PlannedDatum, prediction.datum),
    )


# ---- plan of a wall by tape, lines, hits, tangents or liquid


WALL_PLAN = SavedFormat("tankcal-wall-plan", 1, "plan.json")  # so far one version


class PlannedWall(Saved):
    """Number of planned measurements."""

    circumferences: int = key("different circumferences by tape")
    strap_readings: int = key("of the tape")
    lines: int = key("reference lines")
    faces: int = key("of their plummet; 0: no lines")
    offsets: int = key("from them")
    setups: int = key("of a total station")
    hits: int = key("of the bare wall")
    shared_targets: int = key("common to neighbouring set-ups")
    tangents: int = key("sights to the limbs of the tank")
    runs: int = key("of metered liquid")
    batches: int = key("of metered liquid")


class SimulatedWallPlan(Saved):
    """Results of simulated surveys of the plan, each with a random wall."""

    seed: int = key("of the draws")
    blunders: float = key("share of readings with a blunder")
    runs: int = key("with a solution")
    failed: list[str] = key("messages of runs without solution")
    predicted_u_m3: float = key("of the full tank, by the survey alone")
    predicted_U_m3: float = key("expanded, of the full tank, by the survey alone")
    errors_m3: list[float] = key("volume of the full tank less the true one, of each run")
    U_m3: list[float] = key("U of this volume by the survey alone, of each run")
    volume_error_over_predicted: float = key("rms over u", of="volume_ratio")
    volume_error_over_predicted_sd: float = key("its sd", of="volume_ratio_sd")
    covered: float = key("share of full tanks whose error is within U")
    within: list[float] = key("share of rows whose error is within U, of each run")
    set_aside: list[int] = key("readings rejected by the search, of each run")


class WallPlanFile(Saved, kw_only=True):
    """Prediction of a survey of a wall by tape, reference lines, hits, tangents or liquid."""

    format: str = key("see Versions", default=WALL_PLAN.format)
    tank: str = key("id", of="plan.job.tank.id")
    side: str = key('"outside" or "inside"', of="plan.job.survey.side")
    survey: PlannedWall = key("planned measurements")
    limit: PlanLimit = key("of the plan")
    table: PlannedTable = key("the capacity table")
    sources: list[PlannedSource] = key("of the uncertainty of the top row")
    worst_deliveries: list[PlannedDelivery] = key("of each minimum height")
    courses: list[CourseOutlook] = key("from the bottom up")
    reliability: list[ReadingsOutlook] = key("of straps, offsets and tangents")
    filling: FillingOutlook | None = key("contribution of runs of liquid; null: no runs")
    warnings: list[WarningRecord] = key("on the plan")
    simulated: SimulatedWallPlan | None = key(
        "left out if not requested", optional=True, default=None
    )
    job: list[Fingerprint] = key("files of the empty job", default=())


def plain_of_wall(prediction, simulated=None, job=()):
    """Return the `WallPlanFile` of a WallPrediction, as plain data.

    Parameters
    ----------
    prediction : planning.wall.prediction.WallPrediction
    simulated : SimulatedWall, optional
        Simulated surveys; None: not requested.
    job : sequence of dict, optional
        Files of the empty job, {file, sha256}.

    Returns
    -------
    dict
    """
    file = fill_from(
        WallPlanFile,
        prediction,
        survey=survey_of(prediction.plan),
        **_common_parts(prediction),
    )
    return to_plain(replace(file, simulated=fill_from(SimulatedWallPlan, simulated), job=job))


def survey_of(plan):
    """Return the `PlannedWall` of a WallPlan."""
    design, count = plan.design, wall_count(plan)
    read = {kind: by_course.total() for kind, by_course in count_readings(plan.job).items()}
    return PlannedWall(
        circumferences=len({strap.name for strap in design.straps}),
        strap_readings=read.get("straps", 0),
        lines=count["line"],
        faces=max(part.faces for part in design.parts),
        offsets=read.get("offsets", 0),
        setups=count["setup"],
        hits=read.get("hits", 0),
        shared_targets=0 if design.ties is None else design.ties[0],
        tangents=read.get("tangents", 0),
        runs=count["run"],
        batches=count["batch"],
    )
