"""Tangents that touch no circle as they are read: what would make them touch one.

Directions in another unit or counted anticlockwise, limbs that are exchanged: each is tried, for
all set-ups and for each of them, and told where it explains what nothing else does.
"""

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.survey.diagnosis.misread_files import OTHER_UNITS
from tankcal.survey.tangents import circle_of_sights

GON_IN_DEG, DEG_IN_GON, BACKWARDS = 0.9, 1 / 0.9, -1.0  # of a direction, to what was meant
CLOSER = 0.2  # residuals, of those as it is read, from which on another reading is told
LEAST = 0.004  # of the radius: residuals that need no explanation
OFF_LEVEL_M = 0.3  # of the height of a sight from its level: so far it needs no explanation
NEAR_NOMINAL = 0.1  # of the radius: a circle so far from the nominal one is not the tank
MANY = 0.5  # of the limbs: so many are exchanged as a whole


def refuse_misread(tangents, poses, nominal_m):
    """Raise InputError where directions touch a circle in another unit or sense only.

    poses  `Poses` of their set-ups
    """
    pose = poses.place_of(tangents)
    station = poses.xyz_m[pose][:, :2]
    station = station - station.mean(axis=0)
    zero, setup = poses.orientation_rad[pose], np.array(tangents.setup)

    def residuals(factor):
        azimuth = zero + factor * tangents.direction_rad
        curve, _, left = circle_of_sights(station, azimuth, nominal_m)
        if abs(curve.radius_m - nominal_m) > NEAR_NOMINAL * nominal_m:
            return np.full(len(left), np.inf)
        return np.abs(left)

    ones, names = np.ones(len(tangents)), tuple(dict.fromkeys(tangents.setup))
    usual = residuals(ones)
    if np.median(usual) > LEAST * nominal_m:
        chosen = [(np.ones(len(setup), dtype=bool), names[0])]
    else:
        chosen = [
            (setup == name, name)
            for name in names
            if np.median(usual[setup == name]) > LEAST * nominal_m
        ]
    problems = []
    for mine, name in chosen:
        before = np.median(usual[mine])
        tried = {
            factor: np.median(residuals(np.where(mine, factor, 1.0))[mine])
            for factor in (GON_IN_DEG, DEG_IN_GON, BACKWARDS)
        }
        best = min(tried, key=tried.get)
        most = CLOSER * before if np.isfinite(before) else LEAST * nominal_m
        if np.isfinite(tried[best]) and not tried[best] > most:
            row = tangents.rows[tangents.setup.index(name)] if tangents.rows else None
            problems.append(Problem(tangents.file, _text(best), row, "direction"))
    if problems:
        raise InputError(problems)
    if not np.isfinite(np.median(usual)):
        azimuth = zero + tangents.direction_rad
        curve, _, left = circle_of_sights(station, azimuth, nominal_m)
        _refuse_other_length(tangents, curve.radius_m, nominal_m, np.median(np.abs(left)))
        text = message(
            "tangents_show_no_circle",
            "the tangents touch no circle of about the nominal diameter {diameter_m:.3f} m: check"
            " the set-ups, the zeros of their circles and tank.nominal_diameter_m",
            diameter_m=2 * nominal_m,
        )
        raise InputError(Problem(tangents.file, text))


def _refuse_other_length(tangents, radius_m, nominal_m, left_m):
    """Raise InputError where the circle is that of a tank whose traverse is in another unit."""
    for factor, unit in OTHER_UNITS:
        is_close = abs(radius_m * factor - nominal_m) < NEAR_NOMINAL * nominal_m
        if is_close and left_m < LEAST * radius_m:
            told = message(
                "tangents_of_other_length",
                "the tangents touch a circle of {diameter_m:.3f} m, which is the nominal"
                " {nominal_m:.3f} m if the distances of the traverse, or its bar, are in {unit}: is"
                " it so?",
                diameter_m=2 * radius_m,
                nominal_m=2 * nominal_m,
                unit=unit,
            )
            raise InputError(Problem("slope_distances.csv", told, None, "distance_m"))


def refuse_misread_zeniths(tangents, poses, touching, zero_z_m):
    """Raise InputError where zenith angles reach their levels in another unit only.

    poses     `Poses` of their set-ups
    touching  `Touching`, whose places in plan need no zenith angle
    zero_z_m  z of the zero of levels
    """
    station = poses.xyz_m[poses.place_of(tangents)]
    length = np.linalg.norm(touching.points.xyz_m[:, :2] - station[:, :2], axis=1)
    level, setup = zero_z_m + tangents.level_m, np.array(tangents.setup)
    problems = []
    for name in dict.fromkeys(tangents.setup):
        mine = (setup == name) & np.isfinite(tangents.zenith_rad) & np.isfinite(level)
        if not mine.any():
            continue
        off = {}
        for factor in (1.0, GON_IN_DEG, DEG_IN_GON):
            up = np.pi / 2 - factor * tangents.zenith_rad[mine]
            z = station[mine, 2] + length[mine] * np.tan(up)
            off[factor] = np.median(np.abs(z - level[mine]))
        best = min(off, key=off.get)
        if off[1.0] > OFF_LEVEL_M and off[best] <= CLOSER * off[1.0]:
            row = tangents.rows[int(np.argmax(mine))] if tangents.rows else None
            problems.append(Problem(tangents.file, _text_of_zenith(best), row, "zenith"))
    if problems:
        raise InputError(problems)


def _text_of_zenith(factor):
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
    """Raise InputError for sights that pass the tank at the other limb than it is said."""
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
            Problem(tangents.file, texts[bool(touching.seen_right[one])], rows[one], "side")
            for one in wrong
        ]
    )
