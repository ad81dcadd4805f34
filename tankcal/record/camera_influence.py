"""Influence of calibrations on a block: kind "influence" of camera.json."""

from typing import Literal

from tankcal.calibration.influence.blocks import InteriorValue
from tankcal.record.camera_product import ProductFile, product_of
from tankcal.record.camera_versions import CameraFile
from tankcal.record.schema import Saved, fill_from, key, to_plain
from tankcal.units import ARCSEC_PER_RAD

MM, UM = 1e3, 1e3


class ReadingSetAside(Saved):
    """A reading that was rejected in the reference, and is excluded from all runs."""

    kind: str = key("of observation")
    ids: list[str] = key("names")
    element: str = key('"x", "omega", ...')
    file: str = key("of the reading")
    row: int | None = key("of the file")
    w: float = key("test quantity")


class BlunderSearch(Saved):
    """The search in the reference; all runs use the readings of the reference."""

    searched: bool = key("whether blunders were searched for")
    removed: list[ReadingSetAside] = key("rejected readings")


class Skipped(Saved):
    """Reason for skipping a run."""

    code: str = key('"no_sds": a calibration without sds cannot be weighted')


class RunQuality(Saved):
    """Global test of a run; null: no redundancy."""

    sigma0: float | None = key("a posteriori")
    chi2: float = key("v'Pv", of="test.chi2")
    chi2_low: float | None = key("two-sided bound")
    chi2_high: float | None = key("two-sided bound")
    passed: bool | None = key("whether chi2 lies between them")
    redundancy: int = key("of the run")
    confidence: float = key("of the bounds", of="test.confidence")


class RunImages(Saved):
    """Residuals of the camera's photos."""

    n: int = key("images")
    rms_um: list[float] = key("x, y", of="rms_mm", times=UM)
    largest_um: float = key("of a single coordinate", of="largest_mm", times=UM)
    largest_photo: str = key("its photo")
    largest_point: str = key("its point")
    rms_px: list[float] | None = key("x, y")
    largest_px: float | None = key("of a single coordinate")


class RunVolume(Saved):
    """Volume of the tank at the top of its table."""

    volume_m3: float = key("at the top", of="value_m3")
    u_m3: float = key("standard uncertainty")
    U_m3: float = key("expanded uncertainty")
    k: float = key("coverage factor")
    height_m: float = key("dip of the top")
    points: int | None = key("of the wall; null: not surveyed")


class PointShifts(Saved):
    """Differences of the points; null: no points."""

    n: int = key("points")
    rms_mm: list[float] = key("along x, y, z", of="rms_m", times=MM)
    largest_mm: list[float] = key("along x, y, z", of="largest_m", times=MM)
    rms_xyz_mm: float = key("of the magnitudes", of="rms_xyz_m", times=MM)
    largest_xyz_mm: float = key("magnitude", of="largest_xyz_m", times=MM)
    largest_point: str | None = key("with the largest difference", of="largest_name")


class PhotoShifts(Saved):
    """Differences in position of the photos, and rotations about the axes of the image."""

    n: int = key("photos")
    rms_mm: list[float] = key("along x, y, z", of="rms_m", times=MM)
    rms_xyz_mm: float = key("of the magnitudes", of="rms_xyz_m", times=MM)
    largest_xyz_mm: float = key("magnitude", of="largest_xyz_m", times=MM)
    largest_photo: str | None = key("with the largest difference", of="largest_name")
    rms_arcsec: list[float] = key("about x, y, z", of="rms_rad", times=ARCSEC_PER_RAD)
    rms_turn_arcsec: float = key("of the total rotations", of="rms_turn_rad", times=ARCSEC_PER_RAD)
    largest_turn_arcsec: float = key("total rotation", of="largest_turn_rad", times=ARCSEC_PER_RAD)
    largest_turn_photo: str | None = key("with the largest rotation", of="largest_turn_name")


class VolumeShift(Saved):
    """Difference of the capacities at the top."""

    difference_m3: float = key("other minus one", of="volume_m3")
    percent: float = key("of the volume of one", of="volume_percent")


class Shifts(Saved):
    """Differences between two runs."""

    points: PointShifts = key("of the points")
    photos: PhotoShifts = key("of the photos")
    aligned: int = key("unobserved degrees of freedom, removed from the differences (0 to 7)")
    volume: VolumeShift | None = key("of the tank")


class RunNumbers(Saved):
    """Two runs, by their numbers in `runs`."""

    one: int = key("the reference is 0")
    other: int = key("compared with one")


class PairOfRuns(Shifts, RunNumbers):
    """Two adjusted runs: other minus one. Pairs with the reference come first."""


class AdjustedRun(Saved):
    """An adjustment of the block; results of a run that was not adjusted are null."""

    label: str = key('"reference", or "NAME, fixed"')
    calibration: str | None = key("NAME; null for the reference")
    state: str | None = key('"fixed", "weighted" or "free"; null for the reference')
    outcome: str = key('"adjusted", "failed" or "skipped"')
    message: str | None = key("reason of the failure, in words")
    skipped: Skipped | None = key("reason for skipping it")
    held: list[str] = key("parameters held at a value other than 0, for lack of an sd")
    quality: RunQuality | None = key("global test")
    images: RunImages | None = key("residuals of the camera's photos")
    convention: str | None = key("sign of the distortion's terms")
    affinity: str | None = key("form of the affinity terms")
    interior: list[InteriorValue] | None = key("parameters; sd 0: held; start_sd null: not given")
    product: ProductFile | None = key("check points")
    volume: RunVolume | None = key("at the top of the table")
    volume_failed: str | None = key("reason of a missing volume, for a job with a tank")
    shifts: Shifts | None = key("against the reference; null for the reference")


class InfluenceFile(CameraFile, kw_only=True):
    """Influence of calibrations on a block."""

    kind: Literal["influence"] = key("influence", default="influence")
    camera: str = key("of the job, whose calibration was replaced")
    states: list[str] = key("requested states")
    calibrations: list[str] = key("names, in their order")
    photos: int = key("in the reference")
    points: int = key("in the reference")
    search: BlunderSearch = key("for blunders, in the reference")
    free: list[str] = key('parameters adjusted in the runs "free"')
    runs: list[AdjustedRun] = key("the reference, with the settings of the job, first")
    pairs: list[PairOfRuns] = key("all adjusted runs, in the order of `runs`")


def plain_influence(influence):
    """Return the `InfluenceFile` of an Influence, as plain data."""
    block = influence.runs[0].block
    return to_plain(
        fill_from(
            InfluenceFile,
            influence,
            photos=len(block.photos) if block else 0,
            points=len(block.points) if block else 0,
            search=BlunderSearch(
                influence.searched,
                [fill_from(ReadingSetAside, reading) for reading in influence.removed],
            ),
            runs=[_run(number, run, influence) for number, run in enumerate(influence.runs)],
            pairs=[
                _shifts(PairOfRuns, pair, one=pair.one, other=pair.other)
                for pair in influence.pairs
            ],
        )
    )


def _run(number, run, influence):
    against_reference = next(
        (pair for pair in influence.pairs if (pair.one, pair.other) == (0, number)), None
    )
    block = run.block
    return fill_from(
        AdjustedRun,
        run,
        skipped=Skipped(run.skipped) if run.skipped else None,
        quality=_quality(block),
        images=block and fill_from(RunImages, block.images),
        convention=block and block.form.convention,
        affinity=block and block.form.affinity,
        interior=block and block.interior,
        product=product_of(block.check) if block and block.check else None,
        volume=fill_from(RunVolume, run.volume),
        shifts=_shifts(Shifts, against_reference) if against_reference else None,
    )


def _quality(block):
    if block is None:
        return None
    test = block.test
    return fill_from(
        RunQuality,
        block,
        chi2_low=test.low if test.dof else None,
        chi2_high=test.high if test.dof else None,
        passed=bool(test.passed) if test.dof else None,
        redundancy=int(test.dof),
    )


def _shifts(cls, pair, **numbers):
    return cls(
        points=fill_from(PointShifts, pair.points),
        photos=fill_from(PhotoShifts, pair.photos),
        aligned=pair.aligned,
        volume=None if pair.volume_m3 is None else fill_from(VolumeShift, pair),
        **numbers,
    )
