"""The part of the record that says how image coordinates came about: readings, marks, depth."""

import numpy as np

MICROMETRES = 1000.0


def image_readings_of(repeats):
    """Repeated readings of image points; None where each was read once (`RepeatedReadings`)."""
    if repeats is None:
        return None
    return {
        "points": len(repeats.point),
        "readings": int(np.sum(repeats.count)),
        **_pair("mean_sd", repeats.mean_sd_mm),
        **_pair("pooled_sd", repeats.pooled_sd_mm),
        "limit_um": None if repeats.limit_mm is None else MICROMETRES * repeats.limit_mm,
        "rejected": [_rejected(one, "point") for one in repeats.rejected],
        "means": [
            {
                "photo": photo,
                "point": point,
                "n": int(count),
                "x_mm": mean[0],
                "y_mm": mean[1],
                **_pair("sd", sd),
            }
            for photo, point, count, mean, sd in zip(
                repeats.photo,
                repeats.point,
                repeats.count,
                repeats.mean_mm,
                repeats.sd_mm,
                strict=True,
            )
        ],
    }


def fiducials_of(fits):
    """Each photo that was read on a comparator: its transformation, and how its marks fit."""
    return [_fit(one) for one in fits]


def _fit(fit):
    found = fit.transformation
    names = list(found.parameters)
    return {
        "photo": fit.photo,
        "camera": fit.camera,
        "transformation": found.kind,
        "parameters": names,
        "values": list(found.parameters.values()),
        "sds": list(found.parameter_sds.values()),
        "mirrored": found.is_mirrored,
        "sigma0": found.sigma0,
        "redundancy": found.dof,
        "largest_um": MICROMETRES * float(np.abs(fit.residual_mm).max()),
        "growth": fit.growth,
        "marks": [
            {
                "mark": mark,
                "n": int(count),
                "x_mm": mean[0],
                "y_mm": mean[1],
                **_pair("sd", sd),
                "calibrated_x_mm": place[0],
                "calibrated_y_mm": place[1],
                **_pair("residual", residual),
            }
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
        "rejected": [_rejected(one, "mark") for one in fit.rejected],
    }


def depth_of(depth):
    """The outer iteration for the depth of field; None where it was not asked for."""
    if depth is None:
        return None
    return {
        "rounds": depth.rounds,
        "last_change_um": MICROMETRES * depth.last_change_mm,
        "largest_um": MICROMETRES * depth.largest_mm,
        "rms_um": MICROMETRES * depth.rms_mm,
        "left": depth.left,
    }


def _rejected(one, what):
    row = {"photo": one.photo, what: one.name, "n": one.count}
    return row | _pair("sd", one.sd_mm) | {"row": one.row}


def _pair(name, values_mm):
    """{name_x_um, name_y_um} of two lengths in mm."""
    x, y = (MICROMETRES * float(value) for value in values_mm)
    return {f"{name}_x_um": x, f"{name}_y_um": y}
