"""Input of an inspection: a job, whose survey is computed, or the saved record of a run."""

from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path

import tankcal.record
from tankcal.errors import InputError, Problem
from tankcal.job import load
from tankcal.messages import message
from tankcal.pipeline.surveying import find_survey, placed
from tankcal.pipeline.wall.finding import warnings_of
from tankcal.pipeline.wall.surveyed import Wall
from tankcal.products.inspection.rules import Strength
from tankcal.products.inspection.shape import Sizes
from tankcal.record.making import JobAsRead, shape_record
from tankcal.record.schema import fill_from, to_plain
from tankcal.record.texts import warnings_of as records_of

RECORD = "record.json"  # file name of the record in a folder of results
# Attribute of a job or key of a record, and the code of the method in `InspectedTank`.
METHODS = {"clouds": "scan", "hits": "hits", "tangents": "tangents", "strapping": "straps",
           "lines": "lines"}  # fmt: skip


@dataclass(frozen=True)
class Basis:
    """Data of a tank that an inspection starts from.

    Attributes
    ----------
    source : str
        "job" or "record".
    file : str
        Name of the job or of the record.
    folder : Path
        Folder of the job or of the record; levelling tables are searched for here.
    job : dict
        The job as read, a `record.making.JobAsRead` as plain data.
    shape : dict or None
        Shape of the wall, a `record.wall_shape.WallShapeRecord` as plain data.
    methods : tuple of str
        Survey methods that observed the wall.
    warnings : list of dict
        Warnings about the survey, in the form of a record.
    sha256 : str or None
        Hash of the record file; None for a job.
    is_older : bool
        Whether the record has a surveyed wall but, from an older version, not its shape.
    survey : Surveyed or None
        Computed survey of a job; None for a record.
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
        """`Strength` for the settlement limits, with the yield stress that the job states."""
        stated, sizes = self.job.get("inspection") or {}, self.sizes
        known = {"yield_pa": stated.get("yield_pa"), "e_pa": self.job["material"]["e_pa"]}
        return Strength(sizes.diameter_m, sizes.height_m or None, **known)

    @property
    def rule(self):
        """Name of the rule that the job requires, or None if the job names no rule."""
        return (self.job.get("inspection") or {}).get("rule")

    @property
    def courses_m(self):
        """Heights of the courses from the bottom up, m."""
        return tuple(course["height_m"] for course in self.job["courses"])

    @property
    def sizes(self):
        """`Sizes` for the checks of the wall, with the nominal radius of the drawing."""
        nominal = None
        if self.shape is not None:
            nominal = self.shape["nominal_radius_m"]
        elif self.job["tank"]["nominal_diameter_m"] is not None:
            nominal = self.job["tank"]["nominal_diameter_m"] / 2
        diameter_m = None if nominal is None else 2 * nominal
        return Sizes(nominal, sum(self.courses_m), self.courses_m, diameter_m)


def read_basis(source, progress, part_progress=None):
    """Read the `Basis` from a job, a record.json or a folder of results.

    Parameters
    ----------
    source : path
        Job, record.json or folder of results.
    progress, part_progress : callable
        Callbacks as in `tankcal.run`.

    Returns
    -------
    Basis

    Raises
    ------
    InputError
        If the job or the record is invalid, or if the tank is not upright.
    SolutionError
        If the survey of the job cannot be adjusted.
    """
    path = Path(source)
    if (path / RECORD).is_file():
        path = path / RECORD
    if path.suffix.lower() == ".json":
        return _basis_of_record(path)
    return _basis_of_job(path, progress, part_progress)


def _require_upright(file, kind):
    """Raise InputError unless the tank is upright."""
    if kind != "vertical":
        expected = message(
            "inspect_not_upright",
            "found a tank of kind {kind}; expected an upright one (vertical): plumb, roundness and "
            "settlement are of shells of courses",
            kind=kind,
        )
        raise InputError(Problem(file, expected, column="tank.kind"))


def _basis_of_job(path, progress, part_progress):
    """Read a job and compute its survey."""
    job = load(path)
    settings = "job.toml" if path.is_dir() else path.name
    _require_upright(settings, job.tank.kind)
    try:
        survey = find_survey(job, progress, part_progress=part_progress)
    except InputError as error:
        raise InputError(placed(job, error.problems)) from error
    job, wall = survey.job, survey.survey
    is_wall = isinstance(wall, Wall)
    warnings = (*job.warnings, *(survey.adjustment.warnings if survey.adjustment else ()))
    warnings = (*warnings, *(warnings_of(job, wall) if is_wall else ()))
    return Basis(
        source="job",
        file=job.source,
        folder=path if path.is_dir() else path.parent,
        job=to_plain(fill_from(JobAsRead, job, inspection=job.inspection)),
        shape=to_plain(shape_record(job, wall)),
        methods=_methods({name: getattr(job, name) for name in METHODS}, is_wall),
        warnings=to_plain(records_of(dict.fromkeys(placed(job, warnings)))),
        survey=survey,
    )


def _basis_of_record(path):
    """Read a saved record."""
    record = tankcal.record.load(path)
    kind = (record["job"]["tank"] or {}).get("kind")
    if kind is None:
        expected = message(
            "inspect_no_tank", "a record without a tank; expected that of a run with its table"
        )
        raise InputError(Problem(path.name, expected))
    _require_upright(path.name, kind)
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


def _methods(source, is_wall):
    """Codes of the methods that observed a wall, as in `InspectedTank`."""
    names = tuple(word for key, word in METHODS.items() if source.get(key) is not None)
    # Without scans, hits or tangents, the shell was fitted to measured points.
    sightings = {"scan", "hits", "tangents"} & set(names)
    return names if sightings or not is_wall else ("points", *names)
