"""Rotations of photographs: angles in the interface, tangent space in the computation.

    R = R3(kappa) R2(phi) R1(omega)          (passive, omega about X first)

A rotation is updated by a small rotation vector in the frame of the camera, R <- exp([d]x) R. This
update has no singularity; omega, phi and kappa are only reported. Source: Foerstner & Wrobel 2016,
Photogrammetric Computer Vision, ch. 8.
"""

import numpy as np

_CROSS = np.zeros((3, 3, 3))  # derivative of the cross-product matrix [d]x by d
_CROSS[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = 1.0
_CROSS[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = -1.0


def rotation_of_angles(omega_rad, phi_rad, kappa_rad):
    """Return rotation matrices R3(kappa) R2(phi) R1(omega) from angles.

    Parameters
    ----------
    omega_rad, phi_rad, kappa_rad : array_like, shape (...)
        Angles, rad.

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Examples
    --------
    >>> angles_of(rotation_of_angles(0.1, 0.2, 0.3)).round(9)
    array([0.1, 0.2, 0.3])
    """
    so, sp, sk = np.sin(omega_rad), np.sin(phi_rad), np.sin(kappa_rad)
    co, cp, ck = np.cos(omega_rad), np.cos(phi_rad), np.cos(kappa_rad)
    rows = [
        [cp * ck, co * sk + so * sp * ck, so * sk - co * sp * ck],
        [-cp * sk, co * ck - so * sp * sk, so * ck + co * sp * sk],
        [sp, -so * cp, co * cp],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def angles_of(rotation):
    """Return omega, phi, kappa of rotation matrices.

    phi lies in [-pi/2, pi/2]. At phi = +-pi/2, only kappa +- omega is defined: omega is then 0.

    Parameters
    ----------
    rotation : ndarray, shape (..., 3, 3)
        Rotation matrices.

    Returns
    -------
    ndarray, shape (..., 3)
        Angles, rad.
    """
    r = np.asarray(rotation, dtype=float)
    cos_phi = np.hypot(r[..., 0, 0], r[..., 1, 0])
    # atan2 is accurate near +-90 deg, where asin would lose half the digits.
    phi = np.arctan2(r[..., 2, 0], cos_phi)
    locked = cos_phi < 1e-12
    omega = np.where(locked, 0.0, np.arctan2(-r[..., 2, 1], r[..., 2, 2]))
    kappa = np.where(
        locked, np.arctan2(r[..., 0, 1], r[..., 1, 1]), np.arctan2(-r[..., 1, 0], r[..., 0, 0])
    )
    return np.stack([omega, phi, kappa], axis=-1)


def rotation_of_view(azimuth_rad, tilt_rad, roll_rad):
    """Return rotation matrices of cameras from the azimuth, tilt and roll of the view.

    Parameters
    ----------
    azimuth_rad : array_like, shape (...)
        Azimuth of the viewing direction, clockwise from +y, rad.
    tilt_rad : array_like, shape (...)
        Angle of the viewing direction above the horizon, rad.
    roll_rad : array_like, shape (...)
        Rotation of the x axis of the image about the viewing direction, anticlockwise as seen from
        behind the camera, rad.

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Examples
    --------
    >>> view_of_rotation(rotation_of_view(1.0, 0.2, 0.1)).round(9)
    array([1. , 0.2, 0.1])
    """
    sa, sv, sk = np.sin(azimuth_rad), np.sin(tilt_rad), np.sin(roll_rad)
    ca, cv, ck = np.cos(azimuth_rad), np.cos(tilt_rad), np.cos(roll_rad)
    zero = np.zeros_like(sa * sv * sk)
    # Axes of a camera without roll: viewing direction, horizontal to the right, and upwards.
    ahead = np.stack([sa * cv, ca * cv, sv + zero], axis=-1)
    level = np.stack([ca + zero, -sa + zero, zero], axis=-1)
    upward = np.stack([-sa * sv, -ca * sv, cv + zero], axis=-1)
    # The rows of R are the axes of the camera in the object frame; its z axis points backwards.
    ck, sk = (ck + zero)[..., None], (sk + zero)[..., None]
    return np.stack([level * ck + upward * sk, -level * sk + upward * ck, -ahead], axis=-2)


def view_of_rotation(rotation):
    """Return azimuth, tilt and roll of cameras, the inverse of `rotation_of_view`.

    Parameters
    ----------
    rotation : ndarray, shape (..., 3, 3)
        Rotation matrices.

    Returns
    -------
    ndarray, shape (..., 3)
        Angles, rad.
    """
    right, ahead = rotation[..., 0, :], -rotation[..., 2, :]
    azimuth = np.arctan2(ahead[..., 0], ahead[..., 1])
    tilt = np.arcsin(np.clip(ahead[..., 2], -1.0, 1.0))
    level = rotation_of_view(azimuth, tilt, np.zeros_like(azimuth))
    # The roll is the angle of the x axis in the frame of the camera without roll.
    roll = np.arctan2(
        np.sum(right * level[..., 1, :], axis=-1), np.sum(right * level[..., 0, :], axis=-1)
    )
    return np.stack([azimuth, tilt, roll], axis=-1)


def apply_small_rotation(rotation, small_rad):
    """Return rotation matrices after small rotations: exp([d]x) R.

    Parameters
    ----------
    rotation : ndarray, shape (n, 3, 3)
        R.
    small_rad : ndarray, shape (n, 3)
        d, rad.

    Returns
    -------
    ndarray, shape (n, 3, 3)
    """
    d = np.asarray(small_rad, dtype=float)
    cross = (d @ _CROSS.reshape(3, 9)).reshape(-1, 3, 3)
    half = 0.5 * np.sqrt(np.einsum("ni,ni->n", d, d))
    # Rodrigues: exp([d]x) - I = sin t / t [d]x + (1 - cos t) / t^2 [d]x^2, in half angles for
    # accuracy.
    half = np.maximum(half, 1e-30)[:, None, None]
    first, second = np.sin(2 * half) / (2 * half), 0.5 * (np.sin(half) / half) ** 2
    increment = first * cross + second * (cross @ cross)
    return rotation + increment @ rotation


def rotation_vector(rotation):
    """Return rotation vectors, shorter than pi, with exp([d]x) = R.

    Parameters
    ----------
    rotation : ndarray, shape (n, 3, 3)
        R.

    Returns
    -------
    ndarray, shape (n, 3)
        d, rad.
    """
    r = np.asarray(rotation, dtype=float)
    # The skew-symmetric part of R is sin t times the axis; the trace is 1 + 2 cos t.
    axial = 0.5 * np.stack(
        [r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], axis=-1
    )
    sine = np.linalg.norm(axial, axis=1)
    angle = np.arctan2(sine, 0.5 * (np.trace(r, axis1=1, axis2=2) - 1))
    return axial / np.sinc(angle / np.pi)[:, None]


def vector_derivatives(vector_rad):
    """Return derivatives of the rotation vector of exp([d]x) exp([v]x) by d, at d = 0.

    Parameters
    ----------
    vector_rad : ndarray, shape (n, 3)
        v, rad.

    Returns
    -------
    ndarray, shape (n, 3, 3)
    """
    v = np.asarray(vector_rad, dtype=float)
    square = np.sum(v * v, axis=1)
    half = np.sqrt(square) / 2
    # Inverse of the left Jacobian of SO(3); a series replaces the quotient near zero.
    with np.errstate(invalid="ignore", divide="ignore"):
        second = np.where(square < 1e-8, 1 / 12 + square / 720, (1 - half / np.tan(half)) / square)
    cross = np.cross(np.eye(3), v[:, None, :]).transpose(0, 2, 1)
    return np.eye(3) + 0.5 * cross + second[:, None, None] * (cross @ cross)


def angle_axes(rotation):
    """Return small rotations in the frame of the camera, one column each for omega, phi, kappa.

    Parameters
    ----------
    rotation : ndarray, shape (n, 3, 3)
        Rotation matrices.

    Returns
    -------
    ndarray, shape (n, 3, 3)
    """
    r = np.asarray(rotation, dtype=float)
    kappa = angles_of(r)[:, 2]
    axes = np.zeros_like(r)
    # omega turns about X of the object, phi about the once-turned Y axis, kappa about z of the
    # camera; the signs are those of a passive rotation.
    axes[:, :, 0] = -r[:, :, 0]
    axes[:, 0, 1], axes[:, 1, 1] = -np.sin(kappa), -np.cos(kappa)
    axes[:, 2, 2] = -1.0
    return axes


def angle_derivatives(rotation):
    """Return derivatives of omega, phi, kappa (rows) by a small rotation in the camera frame.

    The derivatives grow without bound towards phi = +-90 deg, where omega and kappa are not defined
    separately.

    Parameters
    ----------
    rotation : ndarray, shape (n, 3, 3)
        Rotation matrices.

    Returns
    -------
    ndarray, shape (n, 3, 3)
    """
    r = np.asarray(rotation, dtype=float)
    _, phi, kappa = angles_of(r).T
    sk, ck, cp, tp = np.sin(kappa), np.cos(kappa), np.cos(phi), np.tan(phi)
    zero, ones = np.zeros_like(sk), np.ones_like(sk)
    # Inverse of the matrix of `angle_axes`, written out.
    rows = [
        [-ck / cp, sk / cp, zero],
        [-sk, -ck, zero],
        [tp * ck, -tp * sk, -ones],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
