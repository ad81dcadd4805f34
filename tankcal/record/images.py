"""The part of the record that says how image coordinates came about: readings, marks, depth."""

import numpy as np

from tankcal.record.schema import Saved, filled_from, key

UM = 1000.0  # in a millimetre


class RejectedPointReading(Saved):
    """Readings of a point that scatter beyond the limit."""

    photo: str = key("name")
    point: str = key("name")
    n: int = key("readings")
    sd_x_um: float = key("of one of them")
    sd_y_um: float = key("of one of them")
    row: int | None = key("of the first, in the file")


class RejectedMarkReading(Saved):
    """Readings of a mark that scatter beyond the limit."""

    photo: str = key("name")
    mark: str = key("name")
    n: int = key("readings")
    sd_x_um: float = key("of one of them")
    sd_y_um: float = key("of one of them")
    row: int | None = key("of the first, in the file")


class MeanOfReadings(Saved):
    """An image point that was read more than once."""

    photo: str = key("name")
    point: str = key("name")
    n: int = key("readings")
    x_mm: float = key("mean")
    y_mm: float = key("mean")
    sd_x_um: float = key("of one reading")
    sd_y_um: float = key("of one reading")


class ImageReadings(Saved):
    """Repeated readings of image points."""

    points: int = key("read more than once")
    readings: int = key("of them")
    mean_sd_x_um: float = key("mean of the sds")
    mean_sd_y_um: float = key("mean of the sds")
    pooled_sd_x_um: float = key("of one reading of any point")
    pooled_sd_y_um: float = key("of one reading of any point")
    limit_um: float | None = key("sd beyond which they are rejected", of="limit_mm", times=UM)
    rejected: list[RejectedPointReading] = key("beyond the limit")
    means: list[MeanOfReadings] = key("each point in each photo")


class MarkFit(Saved):
    """A fiducial mark: its readings, and how they fit its calibrated coordinates."""

    mark: str = key("name")
    n: int = key("readings")
    x_mm: float = key("mean")
    y_mm: float = key("mean")
    sd_x_um: float = key("of one reading")
    sd_y_um: float = key("of one reading")
    calibrated_x_mm: float = key("as declared")
    calibrated_y_mm: float = key("as declared")
    residual_x_um: float = key("transformed minus calibrated")
    residual_y_um: float = key("transformed minus calibrated")


class FiducialTransformation(Saved):
    """A photo that was read on a comparator: its transformation, and how its marks fit."""

    photo: str = key("name")
    camera: str = key("name")
    transformation: str = key("kind", of="transformation.kind")
    parameters: list[str] = key("names")
    values: list[float] = key("of the parameters")
    sds: list[float] = key("of the parameters")
    mirrored: bool = key("whether the plate was read from behind", of="transformation.is_mirrored")
    sigma0: float = key("of the fit", of="transformation.sigma0")
    redundancy: int = key("of the fit", of="transformation.dof")
    largest_um: float = key("largest residual")
    growth: float = key("of the image's errors by the transformation")
    marks: list[MarkFit] = key("each mark")
    rejected: list[RejectedMarkReading] = key("beyond the limit")


class DepthCorrection(Saved):
    """The outer iteration that corrects image points for the depth of field."""

    rounds: int = key("adjustments made")
    last_change_um: float = key("of the last correction", of="last_change_mm", times=UM)
    largest_um: float = key("largest correction, x or y", of="largest_mm", times=UM)
    rms_um: float = key("of all corrections", of="rms_mm", times=UM)
    left: int = key("readings left uncorrected: nothing in front of the lens")


def image_readings_of(repeats):
    """`ImageReadings` of `RepeatedReadings`; None where each point was read once."""
    if repeats is None:
        return None
    return filled_from(
        ImageReadings,
        repeats,
        points=len(repeats.point),
        readings=int(np.sum(repeats.count)),
        **_pair("mean_sd", repeats.mean_sd_mm),
        **_pair("pooled_sd", repeats.pooled_sd_mm),
        rejected=[_rejected(RejectedPointReading, one) for one in repeats.rejected],
        means=[
            MeanOfReadings(photo, point, int(count), *mean, *_um(sd))
            for photo, point, count, mean, sd in zip(
                repeats.photo,
                repeats.point,
                repeats.count,
                repeats.mean_mm,
                repeats.sd_mm,
                strict=True,
            )
        ],
    )


def fiducials_of(fits):
    """The `FiducialTransformation` of each photo that was read on a comparator."""
    return [_fit(one) for one in fits]


def _fit(fit):
    found = fit.transformation
    return filled_from(
        FiducialTransformation,
        fit,
        parameters=list(found.parameters),
        values=list(found.parameters.values()),
        sds=list(found.parameter_sds.values()),
        largest_um=UM * float(np.abs(fit.residual_mm).max()),
        marks=[
            MarkFit(mark, int(count), *mean, *_um(sd), *place, *_um(residual))
            for mark, count, mean, sd, place, residual in zip(
                fit.marks,
                fit.count,
                fit.mean_mm,
                fit.sd_mm,
                fit.calibrated_mm,
                fit.residual_mm,
                strict=True,
            )
        ],
        rejected=[_rejected(RejectedMarkReading, one) for one in fit.rejected],
    )


def depth_of(depth):
    """`DepthCorrection` of a `DepthOfField`; None where it was not asked for."""
    return filled_from(DepthCorrection, depth)


def _rejected(cls, one):
    return cls(one.photo, one.name, one.count, *_um(one.sd_mm), one.row)


def _um(values_mm):
    return [UM * float(value) for value in values_mm]


def _pair(name, values_mm):
    """{name_x_um, name_y_um} of two lengths in mm."""
    return dict(zip((f"{name}_x_um", f"{name}_y_um"), _um(values_mm), strict=True))
