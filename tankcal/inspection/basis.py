"""What an inspection starts from: a job, whose survey is computed, or a record that was kept."""

from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path

import tankcal.record
from tankcal.errors import InputError, Problem
from tankcal.inspection.settlement_limits import Strength
from tankcal.inspection.shape import Sizes
from tankcal.job import load
from tankcal.messages import message
from tankcal.pipeline.surveyed_wall import Wall
from tankcal.pipeline.surveying import find_survey, placed
from tankcal.pipeline.wall import warnings_of
from tankcal.record.making import JobAsRead
from tankcal.record.plain_data import to_plain
from tankcal.record.schema import filled_from
from tankcal.record.texts import warnings_of as records_of
from tankcal.record.wall_shape import shape_record

RECORD = "record.json"
METHODS = {"clouds": "scan", "hits": "hits", "tangents": "tangents", "strapping": "straps",
           "lines": "lines"}  # fmt: skip


@dataclass(frozen=True)
class Basis:
    """What is known of a tank before it is inspected.

    Attributes
    ----------
    source : str
        "job" or "record".
    file : str
        Name of the job or of the record.
    folder : Path
        Where tables of levelling may lie beside it.
    job : dict
        The job as read, a `record.making.JobAsRead` as plain data.
    shape : dict or None
        The shape of its wall, a `record.wall_shape.WallShapeRecord` as plain data.
    methods : tuple of str
        What observed the wall.
    warnings : list of dict
        What was told of the survey, as in a record.
    sha256 : str or None
        Of the record.
    is_older : bool
        Whether it is a record of a surveyed wall that does not keep its shape.
    survey : Surveyed or None
        Of a job: what was computed.
    """

    source: str
    file: str
    folder: Path
    job: dict
    shape: dict | None
    methods: tuple[str, ...]
    warnings: list = field(default_factory=list)
    sha256: str | None = None
    is_older: bool = False
    survey: object = None

    @property
    def strength(self):
        """`Strength` that settlement is limited by, its yield stress as the job says."""
        said, survey = self.job.get("inspection") or {}, self.sizes
        known = {"yield_pa": said.get("yield_pa"), "e_pa": self.job["material"]["e_pa"]}
        return Strength(survey.diameter_m, survey.height_m or None, **known)

    @property
    def rule(self):
        """Name of the rule that the job asks for; None: it does not say."""
        return (self.job.get("inspection") or {}).get("rule")

    @property
    def courses_m(self):
        """Heights of the courses from the bottom up."""
        return tuple(one["height_m"] for one in self.job["courses"])

    @property
    def sizes(self):
        """`Sizes` that the wall is judged by, the radius as the drawing has it."""
        nominal = None
        if self.shape is not None:
            nominal = self.shape["nominal_radius_m"]
        elif self.job["tank"]["nominal_diameter_m"] is not None:
            nominal = self.job["tank"]["nominal_diameter_m"] / 2
        diameter_m = None if nominal is None else 2 * nominal
        return Sizes(nominal, sum(self.courses_m), self.courses_m, diameter_m)


def basis_of(source, progress, part_progress=None):
    """The `Basis` of a job, a record.json or a folder of results.

    Parameters
    ----------
    source : path
    progress, part_progress : callable
        As of `tankcal.run`.

    Raises
    ------
    InputError, SolutionError
        Of the job or the record; for a tank that does not stand upright.
    """
    path = Path(source)
    if (path / RECORD).is_file():
        path = path / RECORD
    if path.suffix.lower() == ".json":
        return _of_record(path)
    return _of_job(path, progress, part_progress)


def _refuse_others(file, kind):
    if kind != "vertical":
        expected = message(
            "inspect_not_upright",
            "found a tank of kind {kind}; expected an upright one (vertical): plumb, roundness and "
            "settlement are of shells of courses",
            kind=kind,
        )
        raise InputError(Problem(file, expected, column="tank.kind"))


def _of_job(path, progress, part_progress):
    job = load(path)
    settings = "job.toml" if path.is_dir() else path.name
    _refuse_others(settings, job.tank.kind)
    try:
        found = find_survey(job, progress, part_progress=part_progress)
    except InputError as error:
        raise InputError(placed(job, error.problems)) from error
    job, wall = found.job, found.survey
    is_wall = isinstance(wall, Wall)
    told = (*job.warnings, *(found.adjustment.warnings if found.adjustment else ()))
    told = (*told, *(warnings_of(job, wall) if is_wall else ()))
    return Basis(
        source="job",
        file=job.source,
        folder=path if path.is_dir() else path.parent,
        job=to_plain(filled_from(JobAsRead, job, inspection=job.inspection)),
        shape=to_plain(shape_record(job, wall)),
        methods=_methods({name: getattr(job, name) for name in METHODS}, is_wall),
        warnings=to_plain(records_of(dict.fromkeys(placed(job, told)))),
        survey=found,
    )


def _of_record(path):
    record = tankcal.record.load(path)
    kind = (record["job"]["tank"] or {}).get("kind")
    if kind is None:
        expected = message(
            "inspect_no_tank", "a record without a tank; expected that of a run with its table"
        )
        raise InputError(Problem(path.name, expected))
    _refuse_others(path.name, kind)
    return Basis(
        source="record",
        file=path.name,
        folder=path.parent,
        job=record["job"],
        shape=record.get("wall_shape"),
        methods=_methods(record, record["shell"] is not None),
        warnings=record["warnings"],
        sha256=sha256(path.read_bytes()).hexdigest(),
        is_older=record["shell"] is not None and record.get("wall_shape") is None
        and record.get("radii") is None,
    )  # fmt: skip


def _methods(found, is_wall):
    """What observed a wall, in the words of `InspectedTank`."""
    named = tuple(word for key, word in METHODS.items() if found.get(key) is not None)
    sighted = {"scan", "hits", "tangents"} & set(named)
    return named if sighted or not is_wall else ("points", *named)
