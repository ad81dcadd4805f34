"""Stadia method: horizontal distance to a bar of known length from the angle between its ends.

    d = (b / 2) cot(beta / 2)            the bar is level and perpendicular to the sight
    dd / dbeta = -b / (4 sin^2(beta / 2))

Source: ISO 7507-3, clause 11 (the base of a triangulation).
"""

import numpy as np


def distance_of_angle_m(angle_rad, length_m):
    """Distance to a bar from the angle that it subtends.

    Parameters
    ----------
    angle_rad : array_like
        Angle between the ends of the bar, rad.
    length_m : array_like
        Length of the bar, m.

    Returns
    -------
    ndarray or float
        Horizontal distance to the middle of the bar, m.

    Examples
    --------
    >>> round(float(distance_of_angle_m(0.2, 2.0)), 4)
    9.9666
    """
    return np.asarray(length_m) / 2 / np.tan(np.asarray(angle_rad) / 2)


def angle_of_distance_rad(distance_m, length_m):
    """Angle subtended by a bar, rad; the inverse of `distance_of_angle_m`.

    Examples
    --------
    >>> round(float(angle_of_distance_rad(distance_of_angle_m(0.2, 2.0), 2.0)), 12)
    0.2
    """
    return 2 * np.arctan2(np.asarray(length_m) / 2, distance_m)


def distance_sd_m(angle_rad, length_m, angle_sd_rad):
    """Standard deviation of the distance caused by the angle.

    Parameters
    ----------
    angle_rad, length_m : array_like
        As in `distance_of_angle_m`.
    angle_sd_rad : array_like
        Standard deviation of the angle, rad.

    Returns
    -------
    ndarray or float
        Standard deviation, m.

    Examples
    --------
    >>> second = np.pi / 180 / 3600
    >>> round(float(1000 * distance_sd_m(0.2, 2.0, second)), 4)  # mm, 10 m away
    0.2432
    """
    return np.asarray(length_m) / (4 * np.sin(np.asarray(angle_rad) / 2) ** 2) * angle_sd_rad
