"""What calibrations do to a block as it is saved: kind "influence" of camera.json."""

from typing import Literal

import numpy as np

from tankcal.calibration.influence.blocks import InteriorValue
from tankcal.record.camera_product import ProductFile, product_of
from tankcal.record.camera_versions import CameraFile
from tankcal.record.schema import Saved, filled_from, key, to_plain

MM, UM = 1e3, 1e3
ARCSEC = np.degrees(1.0) * 3600


class ReadingSetAside(Saved):
    """A reading that was rejected in the reference, and is left out of all runs."""

    kind: str = key("of observation")
    ids: list[str] = key("names")
    element: str = key('"x", "omega", ...')
    file: str = key("where it was read")
    row: int | None = key("of the file")
    w: float = key("test quantity")


class BlunderSearch(Saved):
    """The search in the reference; no run searches again, so that all have the same readings."""

    searched: bool = key("whether blunders were searched for")
    removed: list[ReadingSetAside] = key("readings rejected")


class Skipped(Saved):
    """Why a run was left out."""

    code: str = key('"no_sds": a calibration without sds cannot be weighted')


class RunQuality(Saved):
    """Global test of a run; null: nothing is redundant."""

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
    """Differences of the points; null where there are none."""

    n: int = key("points")
    rms_mm: list[float] = key("along x, y, z", of="rms_m", times=MM)
    largest_mm: list[float] = key("along x, y, z", of="largest_m", times=MM)
    rms_xyz_mm: float = key("of the magnitudes", of="rms_xyz_m", times=MM)
    largest_xyz_mm: float = key("magnitude", of="largest_xyz_m", times=MM)
    largest_point: str | None = key("that differs most", of="largest_name")


class PhotoShifts(Saved):
    """Differences of the photos' places and turns about the axes of the image."""

    n: int = key("photos")
    rms_mm: list[float] = key("along x, y, z", of="rms_m", times=MM)
    rms_xyz_mm: float = key("of the magnitudes", of="rms_xyz_m", times=MM)
    largest_xyz_mm: float = key("magnitude", of="largest_xyz_m", times=MM)
    largest_photo: str | None = key("that differs most", of="largest_name")
    rms_arcsec: list[float] = key("about x, y, z", of="rms_rad", times=ARCSEC)
    rms_turn_arcsec: float = key("of the whole turns", of="rms_turn_rad", times=ARCSEC)
    largest_turn_arcsec: float = key("whole turn", of="largest_turn_rad", times=ARCSEC)
    largest_turn_photo: str | None = key("that turns most", of="largest_turn_name")


class VolumeShift(Saved):
    """Difference of the capacities at the top."""

    difference_m3: float = key("other minus one", of="volume_m3")
    percent: float = key("of that of one", of="volume_percent")


class Shifts(Saved):
    """What a run changes against another."""

    points: PointShifts = key("of the points")
    photos: PhotoShifts = key("of the photos")
    aligned: int = key("ways that nothing observes, taken out of the differences first (0 to 7)")
    volume: VolumeShift | None = key("of the tank")


class RunNumbers(Saved):
    """Two runs, by their numbers in `runs`."""

    one: int = key("the reference is 0")
    other: int = key("that is compared with it")


class PairOfRuns(Shifts, RunNumbers):
    """Two runs that could be adjusted: other minus one. Those with the reference come first."""


class AdjustedRun(Saved):
    """One adjustment of the block; what a run that was not adjusted does not have is null."""

    label: str = key('"reference", or "NAME, fixed"')
    calibration: str | None = key("NAME; null for the reference")
    state: str | None = key('"fixed", "weighted" or "free"; null for the reference')
    outcome: str = key('"adjusted", "failed" or "skipped"')
    message: str | None = key("why it failed, in words")
    skipped: Skipped | None = key("why it was left out")
    held: list[str] = key("parameters held at a value that is not 0, for want of an sd")
    quality: RunQuality | None = key("global test")
    images: RunImages | None = key("residuals of the camera's photos")
    convention: str | None = key("sign of the distortion's terms")
    affinity: str | None = key("form of the affinity terms")
    interior: list[InteriorValue] | None = key("parameters; sd 0: held; start_sd null: not given")
    product: ProductFile | None = key("check points")
    volume: RunVolume | None = key("at the top of the table")
    volume_failed: str | None = key("why there is no volume, of a job with a tank")
    shifts: Shifts | None = key("against the reference; null for it")


class InfluenceFile(CameraFile, kw_only=True):
    """What calibrations do to a block."""

    kind: Literal["influence"] = key("influence", default="influence")
    camera: str = key("of the job, that was replaced")
    states: list[str] = key("those asked for")
    calibrations: list[str] = key("names, in their order")
    photos: int = key("in the reference")
    points: int = key("in the reference")
    search: BlunderSearch = key("for blunders, in the reference")
    free: list[str] = key('parameters that the runs "free" adjust')
    runs: list[AdjustedRun] = key("the reference first: the job's own settings")
    pairs: list[PairOfRuns] = key("all runs that could be adjusted, in the order of `runs`")


def as_json(influence):
    """The `InfluenceFile` of an Influence, as plain data."""
    block = influence.runs[0].block
    found = filled_from(
        InfluenceFile,
        influence,
        photos=len(block.photos) if block else 0,
        points=len(block.points) if block else 0,
        search=BlunderSearch(
            influence.searched, [filled_from(ReadingSetAside, one) for one in influence.removed]
        ),
        runs=[_run(number, one, influence) for number, one in enumerate(influence.runs)],
        pairs=[_shifts(PairOfRuns, one, one=one.one, other=one.other) for one in influence.pairs],
    )
    return to_plain(found)


def _run(number, run, influence):
    against = [one for one in influence.pairs if (one.one, one.other) == (0, number)]
    block = run.block
    return filled_from(
        AdjustedRun,
        run,
        skipped=Skipped(run.skipped) if run.skipped else None,
        quality=_quality(block),
        images=block and filled_from(RunImages, block.images),
        convention=block and block.form.convention,
        affinity=block and block.form.affinity,
        interior=block and block.interior,
        product=product_of(block.check) if block and block.check else None,
        volume=filled_from(RunVolume, run.volume),
        shifts=_shifts(Shifts, against[0]) if against else None,
    )


def _quality(block):
    if block is None:
        return None
    test = block.test
    return filled_from(
        RunQuality,
        block,
        chi2_low=test.low if test.dof else None,
        chi2_high=test.high if test.dof else None,
        passed=bool(test.passed) if test.dof else None,
        redundancy=int(test.dof),
    )


def _shifts(cls, pair, **numbers):
    return cls(
        points=filled_from(PointShifts, pair.points),
        photos=filled_from(PhotoShifts, pair.photos),
        aligned=pair.aligned,
        volume=None if pair.volume_m3 is None else filled_from(VolumeShift, pair),
        **numbers,
    )
