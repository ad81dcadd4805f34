"""The prediction of a wall by tape, lines, hits, tangents or liquid as it is saved: plan.json."""

from dataclasses import replace

from tankcal.planning.wall.changes import wall_count
from tankcal.planning.wall.filling_outlook import FillingOutlook
from tankcal.planning.wall.prediction import CourseOutlook, ReadingsOutlook
from tankcal.record.plain_data import to_plain
from tankcal.record.plan import (
    Fingerprint,
    PlanLimit,
    PlannedDelivery,
    PlannedSource,
    PlannedTable,
    parts_of_any_plan,
)
from tankcal.record.saved_formats import SavedFormat
from tankcal.record.schema import Saved, filled_from, key
from tankcal.record.texts import WarningRecord

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
