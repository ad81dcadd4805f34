"""A prediction as it is saved: plan.json."""

from dataclasses import replace

import numpy as np

from tankcal.planning.bases import by_ends
from tankcal.planning.doubtful import GroupReliability
from tankcal.planning.prediction import PointOutlook, SectionOutlook
from tankcal.planning.wall.changes import wall_count
from tankcal.planning.wall.filling_outlook import FillingOutlook
from tankcal.planning.wall.prediction import CourseOutlook, ReadingsOutlook
from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Saved, filled_from, key, to_plain
from tankcal.record.texts import WarningRecord, warnings_of

PLAN = SavedFormat("tankcal-plan", 1, "plan.json")  # so far one version


class PlannedDatum(Saved):
    """What holds the frame."""

    choice: str = key("as asked for")
    defect: int = key("of the seven ways, those that no observation feels")
    words: str = key("a sentence that names them")
    held: list[str] = key("what holds them: points with axes, or the photo")
    vertical: bool = key("whether observations determine the vertical")
    scale: bool = key("whether observations determine the scale")


class PlannedSurvey(Saved):
    """How large the survey is."""

    photo_stations: int = key("number")
    photographs: int = key("number")
    setups: int = key("number")
    ties: int = key("number, bases of a stadia among them")
    control_points: int = key("number")
    targets: int = key("number")
    observations: int = key("values")
    unknowns: int = key("number")
    redundancy: int = key("number")
    datum: PlannedDatum = key("what holds the frame")


class PlanLimit(Saved):
    """The limit that the plan is to keep."""

    relative_u: float | None = key("U over volume; null: no limit")
    of: str = key("what it is for")
    predicted: float = key("U over volume")
    met: bool | None = key("whether it is kept")


class PlannedTable(Saved):
    """The capacity table with its uncertainty."""

    height_m: list[float] = key("dips")
    volume_m3: list[float] = key("below the dip")
    u_m3: list[float] = key("standard uncertainty")
    k: list[float] = key("coverage factor")
    U_m3: list[float] = key("expanded uncertainty")


class PlannedSource(Saved):
    """What an input contributes."""

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
    axis_sd_m: list[float] = key("the same along x, y, z")
    range_m: list[float] = key("largest minus smallest sd along x, y, z")
    proportional: float = key("precision is 1 : this")


class SimulatedPlan(Saved):
    """What many simulated surveys of the plan gave."""

    seed: int = key("of the draws")
    blunders: float = key("share of readings that were off")
    runs: int = key("that had a solution")
    failed: list[str] = key("messages of the others")
    coordinates_scatter_over_predicted: float = key("rms over rms", of="ratio")
    volume_scatter_over_predicted: float = key("of the full tank", of="volume_ratio")
    volume_scatter_over_predicted_sd: float = key("its sd", of="volume_ratio_sd")
    set_aside: list[int] = key("values that the search took out, of each run")
    volumes_m3: list[float] = key("of the full tank, of each run")


class Fingerprint(Saved):
    """A file of the empty job, by which a filled one is told from it."""

    file: str = key("name")
    sha256: str = key("of its bytes")


class PlanFile(Saved, kw_only=True):
    """What a survey would give, before it is made."""

    format: str = key("see Versions", default=PLAN.format)
    tank: str = key("id", of="plan.job.tank.id")
    side: str = key('"outside" or "inside"', of="plan.job.survey.side")
    survey: PlannedSurvey = key("how large it is")
    limit: PlanLimit = key("that the plan is to keep")
    table: PlannedTable = key("the capacity table")
    sources: list[PlannedSource] = key("of the uncertainty of the top row")
    worst_deliveries: list[PlannedDelivery] = key("of each minimum height")
    sections: list[SectionOutlook] = key("from the bottom up")
    points: list[PointOutlook] = key("targets first")
    precision: PlannedPrecision = key("of the points")
    reliability: list[GroupReliability] = key("of the kinds of observations")
    warnings: list[WarningRecord] = key("what should be read")
    simulated: SimulatedPlan | None = key("null: it was not asked for", default=None)
    job: list[Fingerprint] = key("files of the empty job", default=())


def plain_of(prediction, simulated=None, job=()):
    """The `PlanFile` of a Prediction, as plain data.

    simulated  `simulations.Simulated`, or None        job  [{file, sha256}] of the empty job
    """
    found = filled_from(
        PlanFile,
        prediction,
        survey=_survey(prediction),
        precision=filled_from(PlannedPrecision, prediction.precision),
        **parts_of_any_plan(prediction),
    )
    return to_plain(replace(found, simulated=filled_from(SimulatedPlan, simulated), job=job))


def parts_of_any_plan(prediction):
    """{key: its value} of what files of all plans have: limit, table, sources, warnings."""
    table, limits = prediction.table, prediction.plan.limits
    return {
        "limit": PlanLimit(limits.relative_u, limits.of, prediction.relative_u, prediction.meets),
        "table": filled_from(PlannedTable, table),
        "sources": [
            PlannedSource(one.kind, np.linalg.norm(one.columns_m3[-1])) for one in table.sources
        ],
        "worst_deliveries": [
            filled_from(PlannedDelivery, one) for one in prediction.tabled.stated.worst
        ],
        "warnings": warnings_of(prediction.warnings),
    }


def _survey(prediction):
    plan, solution = prediction.plan, prediction.predicted.adjusted.solution
    return PlannedSurvey(
        photo_stations=len(plan.stations),
        photographs=len(plan.photos),
        setups=len(plan.setups),
        ties=len(plan.ties) + len(by_ends(plan.bases)),
        control_points=len(plan.known),
        targets=len(plan.targets.names),
        observations=solution.rows,
        unknowns=solution.estimated,
        redundancy=solution.dof,
        datum=filled_from(PlannedDatum, prediction.datum),
    )


# ---- plan of a wall by tape, lines, hits, tangents or liquid


WALL_PLAN = SavedFormat("tankcal-wall-plan", 1, "plan.json")  # so far one version


class PlannedWall(Saved):
    """What will be measured."""

    circumferences: int = key("different ones by tape")
    strap_readings: int = key("of the tape")
    lines: int = key("reference lines")
    faces: int = key("of their plummet; 0: no lines")
    offsets: int = key("from them")
    setups: int = key("of a total station")
    hits: int = key("of the bare wall")
    shared_targets: int = key("that neighbouring set-ups share")
    tangents: int = key("sights to the limbs of the tank")
    runs: int = key("of metered liquid")
    batches: int = key("of them")


class SimulatedWallPlan(Saved):
    """What many simulated surveys of the plan gave, each of a wall that was drawn."""

    seed: int = key("of the draws")
    blunders: float = key("share of readings that were off")
    runs: int = key("that had a solution")
    failed: list[str] = key("messages of the others")
    predicted_u_m3: float = key("of the full tank, by the survey alone")
    predicted_U_m3: float = key("the same, expanded")
    errors_m3: list[float] = key("volume of the full tank less the true one, of each run")
    U_m3: list[float] = key("its U by the survey alone, as each run states it")
    volume_error_over_predicted: float = key("rms over u", of="volume_ratio")
    volume_error_over_predicted_sd: float = key("its sd", of="volume_ratio_sd")
    covered: float = key("share of full tanks within their U")
    within: list[float] = key("share of the rows within theirs, of each run")
    set_aside: list[int] = key("readings that the search took out, of each run")


class WallPlanFile(Saved, kw_only=True):
    """What a survey of a wall by tape, reference lines, hits, tangents or liquid would give."""

    format: str = key("see Versions", default=WALL_PLAN.format)
    tank: str = key("id", of="plan.job.tank.id")
    side: str = key('"outside" or "inside"', of="plan.job.survey.side")
    survey: PlannedWall = key("what will be measured")
    limit: PlanLimit = key("that the plan is to keep")
    table: PlannedTable = key("the capacity table")
    sources: list[PlannedSource] = key("of the uncertainty of the top row")
    worst_deliveries: list[PlannedDelivery] = key("of each minimum height")
    courses: list[CourseOutlook] = key("from the bottom up")
    reliability: list[ReadingsOutlook] = key("of straps, offsets and tangents")
    filling: FillingOutlook | None = key("what runs of liquid would add; null: there are none")
    warnings: list[WarningRecord] = key("what should be read")
    simulated: SimulatedWallPlan | None = key(
        "left out where it was not asked for", optional=True, default=None
    )
    job: list[Fingerprint] = key("files of the empty job", default=())


def plain_of_wall(prediction, simulated=None, job=()):
    """The `WallPlanFile` of a WallPrediction, as plain data.

    simulated  `SimulatedWall`, or None        job  [{file, sha256}] of the empty job
    """
    found = filled_from(
        WallPlanFile,
        prediction,
        survey=survey_of(prediction.plan),
        **parts_of_any_plan(prediction),
    )
    return to_plain(replace(found, simulated=filled_from(SimulatedWallPlan, simulated), job=job))


def survey_of(plan):
    """The `PlannedWall` of a WallPlan."""
    design, job, count = plan.design, plan.job, wall_count(plan)
    return PlannedWall(
        circumferences=len({one.name for one in design.straps}),
        strap_readings=0 if job.strapping is None else len(job.strapping.straps),
        lines=count["line"],
        faces=0 if design.lines is None else design.lines.faces,
        offsets=0 if job.lines is None else len(job.lines.offsets),
        setups=count["setup"],
        hits=0 if job.hits is None else len(job.hits),
        shared_targets=0 if design.ties is None else design.ties[0],
        tangents=0 if job.tangents is None else len(job.tangents),
        runs=count["run"],
        batches=count["batch"],
    )
