"""Tangents that touch a circle only if their readings are interpreted otherwise.

The checks try other units of direction, anticlockwise directions and exchanged limbs, for all
set-ups together and for each. They report an interpretation that reduces the residuals
sufficiently.
"""

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.survey.diagnosis.misread_files import OTHER_UNITS
from tankcal.survey.tangents import circle_of_sights
from tankcal.units import DEG_IN_GON, GON_IN_DEG

# Factors of a direction: read as degrees but given in gon, the reverse, and anticlockwise.
BACKWARDS = -1.0
CLOSER = 0.2  # largest ratio of residuals to those as read, to report another interpretation
LEAST = 0.004  # median residual over the radius that needs no explanation
OFF_LEVEL_M = 0.3  # discrepancy between a sight and its level that needs no explanation
NEAR_NOMINAL = 0.1  # largest relative difference between the circle and the nominal radius
MANY = 0.5  # share of wrong limbs above which all limbs are reported as exchanged


def refuse_misread(tangents, poses, nominal_m):
    """Raise InputError for directions that touch a circle only in another unit or sense.

    Parameters
    ----------
    tangents : Tangents
    poses : Poses
        Positions and orientations of the set-ups.
    nominal_m : float
        Nominal radius, m.
    """
    pose = poses.place_of(tangents)
    station = poses.xyz_m[pose][:, :2]
    station = station - station.mean(axis=0)
    zero, setup = poses.orientation_rad[pose], np.array(tangents.setup)

    def residuals(factor):
        azimuth = zero + factor * tangents.direction_rad
        curve, _, residuals_m = circle_of_sights(station, azimuth, nominal_m)
        if abs(curve.radius_m - nominal_m) > NEAR_NOMINAL * nominal_m:
            return np.full(len(residuals_m), np.inf)
        return np.abs(residuals_m)

    ones, names = np.ones(len(tangents)), tuple(dict.fromkeys(tangents.setup))
    residuals_as_read = residuals(ones)
    if np.median(residuals_as_read) > LEAST * nominal_m:
        candidates = [(np.ones(len(setup), dtype=bool), names[0])]
    else:
        candidates = [
            (setup == name, name)
            for name in names
            if np.median(residuals_as_read[setup == name]) > LEAST * nominal_m
        ]
    problems = []
    for is_of_setup, name in candidates:
        median_as_read = np.median(residuals_as_read[is_of_setup])
        median_by_factor = {
            factor: np.median(residuals(np.where(is_of_setup, factor, 1.0))[is_of_setup])
            for factor in (GON_IN_DEG, DEG_IN_GON, BACKWARDS)
        }
        best = min(median_by_factor, key=median_by_factor.get)
        most = CLOSER * median_as_read if np.isfinite(median_as_read) else LEAST * nominal_m
        if np.isfinite(median_by_factor[best]) and not median_by_factor[best] > most:
            row = tangents.rows[tangents.setup.index(name)] if tangents.rows else None
            problems.append(Problem(tangents.file, _text(best), row, "direction"))
    if problems:
        raise InputError(problems)
    if not np.isfinite(np.median(residuals_as_read)):
        azimuth = zero + tangents.direction_rad
        curve, _, residuals_m = circle_of_sights(station, azimuth, nominal_m)
        _refuse_other_length(tangents, curve.radius_m, nominal_m, np.median(np.abs(residuals_m)))
        text = message(
            "tangents_show_no_circle",
            "the tangents touch no circle of about the nominal diameter {diameter_m:.3f} m: check"
            " the set-ups, the zeros of their circles and tank.nominal_diameter_m",
            diameter_m=2 * nominal_m,
        )
        raise InputError(Problem(tangents.file, text))


def _refuse_other_length(tangents, radius_m, nominal_m, residual_m):
    """Raise InputError if the circle has the nominal size in another unit of the traverse."""
    for factor, unit in OTHER_UNITS:
        is_close = abs(radius_m * factor - nominal_m) < NEAR_NOMINAL * nominal_m
        if is_close and residual_m < LEAST * radius_m:
            text = message(
                "tangents_of_other_length",
                "the tangents touch a circle of {diameter_m:.3f} m, which is the nominal"
                " {nominal_m:.3f} m if the distances of the traverse, or its bar, are in {unit}: is"
                " it so?",
                diameter_m=2 * radius_m,
                nominal_m=2 * nominal_m,
                unit=unit,
            )
            raise InputError(Problem("slope_distances.csv", text, None, "distance_m"))


def refuse_misread_zeniths(tangents, poses, touching, zero_z_m):
    """Raise InputError for zenith angles that reach the stated levels only in another unit.

    Parameters
    ----------
    tangents : Tangents
    poses : Poses
        Positions of the set-ups.
    touching : Touching
        Points of tangency; their plan coordinates do not depend on zenith angles.
    zero_z_m : float
        Height of the zero of the levels, m.
    """
    station = poses.xyz_m[poses.place_of(tangents)]
    length = np.linalg.norm(touching.points.xyz_m[:, :2] - station[:, :2], axis=1)
    level, setup = zero_z_m + tangents.level_m, np.array(tangents.setup)
    problems = []
    for name in dict.fromkeys(tangents.setup):
        is_of_setup = (setup == name) & np.isfinite(tangents.zenith_rad) & np.isfinite(level)
        if not is_of_setup.any():
            continue
        misfit_m = {}
        for factor in (1.0, GON_IN_DEG, DEG_IN_GON):
            elevation = np.pi / 2 - factor * tangents.zenith_rad[is_of_setup]
            z = station[is_of_setup, 2] + length[is_of_setup] * np.tan(elevation)
            misfit_m[factor] = np.median(np.abs(z - level[is_of_setup]))
        best = min(misfit_m, key=misfit_m.get)
        if misfit_m[1.0] > OFF_LEVEL_M and misfit_m[best] <= CLOSER * misfit_m[1.0]:
            row = tangents.rows[int(np.argmax(is_of_setup))] if tangents.rows else None
            problems.append(Problem(tangents.file, _text_of_zenith(best), row, "zenith"))
    if problems:
        raise InputError(problems)


def _text_of_zenith(factor):
    """Message that proposes the unit of zenith angles of the given factor."""
    if factor == GON_IN_DEG:
        return message(
            "tangent_zeniths_in_gon",
            "the sights are at the levels given if these are gon: is it so?",
        )
    return message(
        "tangent_zeniths_in_degrees",
        "the sights are at the levels given if these are degrees: is it so?",
    )


def _text(factor):
    """Message that proposes the unit or sense of directions of the given factor."""
    if factor == GON_IN_DEG:
        return message("tangents_in_gon", "the sights touch one circle if these are gon: is it so?")
    if factor == DEG_IN_GON:
        return message(
            "tangents_in_degrees", "the sights touch one circle if these are degrees: is it so?"
        )
    return message(
        "tangents_backwards",
        "the sights touch one circle if directions grow anticlockwise; expected clockwise ones",
    )


def refuse_limbs(tangents, touching):
    """Raise InputError for sights that pass the tank on the limb opposite to the stated limb."""
    wrong = np.flatnonzero(touching.seen_right != tangents.is_right)
    if not len(wrong):
        return
    rows = tangents.rows or tuple(range(1, len(tangents) + 1))
    if len(wrong) > MANY * len(tangents):
        text = message(
            "limbs_exchanged",
            "{count} of {all} sights pass the tank at the other side: are left and right exchanged?"
            " Expected sides as seen from the set-up",
            count=len(wrong),
            all=len(tangents),
        )
        raise InputError(Problem(tangents.file, text, rows[wrong[0]], "side"))
    texts = {
        True: message("limb_is_right", "found left, but the sight passes the tank at its right"),
        False: message("limb_is_left", "found right, but the sight passes the tank at its left"),
    }
    raise InputError(
        [
            Problem(tangents.file, texts[bool(touching.seen_right[row])], rows[row], "side")
            for row in wrong
        ]
    )
