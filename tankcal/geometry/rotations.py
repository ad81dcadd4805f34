"""Rotations of photographs: angles at the surface, tangent space inside.

    R = R3(kappa) R2(phi) R1(omega)          (passive, omega about X first)

A rotation is updated by a small rotation vector in the frame of the camera, R <- exp([d]x) R, which
has no singular place; omega, phi and kappa are only reported. Source: Foerstner & Wrobel 2016,
Photogrammetric Computer Vision, ch. 8.
"""

import numpy as np

_CROSS = np.zeros((3, 3, 3))  # [d]x by d
_CROSS[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = 1.0
_CROSS[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = -1.0


def rotation_of_angles(omega_rad, phi_rad, kappa_rad):
    """Rotation matrices R3(kappa) R2(phi) R1(omega) of angles.

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
    """omega, phi, kappa of rotation matrices.

    phi lies in [-pi/2, pi/2]. At phi = +-pi/2 only kappa +- omega is defined: omega is then 0.

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
    phi = np.arctan2(r[..., 2, 0], cos_phi)
    locked = cos_phi < 1e-12
    omega = np.where(locked, 0.0, np.arctan2(-r[..., 2, 1], r[..., 2, 2]))
    kappa = np.where(
        locked, np.arctan2(r[..., 0, 1], r[..., 1, 1]), np.arctan2(-r[..., 1, 0], r[..., 0, 0])
    )
    return np.stack([omega, phi, kappa], axis=-1)


def rotation_of_view(azimuth_rad, tilt_rad, roll_rad):
    """Rotation matrices of cameras that look along an azimuth, tilted up, rolled about the axis.

    Parameters
    ----------
    azimuth_rad, tilt_rad, roll_rad : array_like, shape (...)
        Of the viewing direction, clockwise from +y; above the horizon; of the image's x axis,
        anticlockwise as the photographer sees it from behind; rad.

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
    ahead = np.stack([sa * cv, ca * cv, sv + zero], axis=-1)
    level = np.stack([ca + zero, -sa + zero, zero], axis=-1)
    above = np.stack([-sa * sv, -ca * sv, cv + zero], axis=-1)
    ck, sk = (ck + zero)[..., None], (sk + zero)[..., None]
    return np.stack([level * ck + above * sk, -level * sk + above * ck, -ahead], axis=-2)


def view_of_rotation(rotation):
    """azimuth, tilt, roll of cameras: the inverse of `rotation_of_view`.

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
    roll = np.arctan2(
        np.sum(right * level[..., 1, :], axis=-1), np.sum(right * level[..., 0, :], axis=-1)
    )
    return np.stack([azimuth, tilt, roll], axis=-1)


def apply_small_rotation(rotation, small_rad):
    """Rotation matrices after small rotations: exp([d]x) R.

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
    half = np.maximum(half, 1e-30)[:, None, None]
    first, second = np.sin(2 * half) / (2 * half), 0.5 * (np.sin(half) / half) ** 2
    turned_by = first * cross + second * (cross @ cross)
    return rotation + turned_by @ rotation


def rotation_vector(rotation):
    """Rotation vectors, shorter than pi, with exp([d]x) = R.

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
    axial = 0.5 * np.stack(
        [r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], axis=-1
    )
    sine = np.linalg.norm(axial, axis=1)
    angle = np.arctan2(sine, 0.5 * (np.trace(r, axis1=1, axis2=2) - 1))
    return axial / np.sinc(angle / np.pi)[:, None]


def vector_derivatives(vector_rad):
    """Derivatives of the rotation vector of exp([d]x) exp([v]x) by d, at d = 0.

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
    with np.errstate(invalid="ignore", divide="ignore"):
        second = np.where(square < 1e-8, 1 / 12 + square / 720, (1 - half / np.tan(half)) / square)
    cross = np.cross(np.eye(3), v[:, None, :]).transpose(0, 2, 1)
    return np.eye(3) + 0.5 * cross + second[:, None, None] * (cross @ cross)


def angle_axes(rotation):
    """Small rotations in the camera's frame, one column for each of omega, phi, kappa.

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
    axes[:, :, 0] = -r[:, :, 0]
    axes[:, 0, 1], axes[:, 1, 1] = -np.sin(kappa), -np.cos(kappa)
    axes[:, 2, 2] = -1.0
    return axes


def angle_derivatives(rotation):
    """Derivatives of omega, phi, kappa (rows) by a small rotation in the camera's frame.

    They grow without bound towards phi = +-90 deg: an angle by itself is not defined there.

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
    zero, one = np.zeros_like(sk), np.ones_like(sk)
    rows = [
        [-ck / cp, sk / cp, zero],
        [-sk, -ck, zero],
        [tp * ck, -tp * sk, -one],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
