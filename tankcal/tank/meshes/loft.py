"""Mesh lofted from the outlines of a shell: an independent check of its volume, and a picture."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy

from tankcal.geometry.field.estimate import LEVELS
from tankcal.quadrature import height_basis
from tankcal.tank.courses import gauss_levels
from tankcal.tank.meshes.checks import closed_mesh
from tankcal.units import FULL_TURN


@dataclass(frozen=True)
class Band:
    """Rings of the wall from a joint to the next: k heights, q evenly spaced azimuths from north.

    Attributes
    ----------
    heights_m : ndarray, shape (k,)
        Ascending heights, the first and the last at the joints.
    radii_m : ndarray, shape (k, q)
        Inside radii about the centre of their ring.
    centre_m : ndarray, shape (k, 2)
        x and y of the centres.
    """

    heights_m: np.ndarray
    radii_m: np.ndarray
    centre_m: np.ndarray


def shell_bands(volume, *, slices=8, azimuths=720):
    """Return the bands of a shell, one for each course, from the outlines of its volume.

    Parameters
    ----------
    volume : tankcal.tank.volumes.ShellVolume
    slices : int, optional
        Slices of a course.
    azimuths : int, optional
        Azimuths of a ring.

    Returns
    -------
    tuple of Band
    """
    azimuth = np.arange(azimuths) * FULL_TURN / azimuths
    parts = np.linspace(0.0, 1.0, slices + 1)
    basis = height_basis(gauss_levels(), parts, LEVELS - 1)
    bands = []
    for course in volume.courses:
        outlines = basis @ course.outlines_m
        grid = np.linspace(0.0, FULL_TURN, outlines.shape[1] + 1)
        closed = np.column_stack([outlines, outlines[:, 0]])
        # Periodic spline: the outlines have other azimuths than the rings of the mesh.
        radii = scipy.interpolate.CubicSpline(grid, closed, axis=1, bc_type="periodic")(azimuth)
        heights = course.bottom_m + parts * course.height_m
        heights[-1] = course.top_m
        bands.append(Band(heights, radii, np.zeros((len(parts), 2))))
    return tuple(bands)


def loft(bands):
    """Return a closed mesh over bands from the bottom up, with a level bottom and lid.

    Two triangles for each azimuth connect neighbouring rings. A step at a joint is also such a
    strip, a level one. The volume of the mesh is too small by the square of the spacing.

    Parameters
    ----------
    bands : sequence of Band
        Bands with equal numbers of azimuths; each starts at the height where the band below ends.

    Returns
    -------
    Mesh

    Raises
    ------
    ValueError
        For bands that do not fit.
    InputError
        As for `closed_mesh`.
    """
    joints = [(below.heights_m[-1], above.heights_m[0]) for below, above in pairwise(bands)]
    if any(low != high for low, high in joints):
        raise ValueError(f"joints at {joints}; expected each band to begin where the last one ends")
    count = bands[0].radii_m.shape[1]
    azimuth = np.arange(count) * FULL_TURN / count
    turn = np.column_stack([np.sin(azimuth), np.cos(azimuth)])
    rings = []
    for band in bands:
        xy = band.centre_m[:, None] + band.radii_m[:, :, None] * turn
        z = np.broadcast_to(band.heights_m[:, None, None], (*xy.shape[:2], 1))
        rings.append(np.concatenate([xy, z], axis=2).reshape(-1, 3))
    wall = np.concatenate(rings)
    ends = np.array(
        [
            [*bands[0].centre_m[0], bands[0].heights_m[0]],
            [*bands[-1].centre_m[-1], bands[-1].heights_m[-1]],
        ]
    )
    return closed_mesh(np.concatenate([wall, ends]), _lofted_faces(len(wall), count), name="loft")


def _lofted_faces(vertices, count):
    """Return faces (m, 3) of `vertices` in rings of `count`, then the centres of bottom and lid."""
    index = np.arange(count)
    next_index = np.roll(index, -1)
    # Index offsets of the rings: each strip connects a ring with the next.
    strips = np.arange(0, vertices - count, count)[:, None, None]
    side = np.concatenate(
        [
            np.column_stack([index, index + count, next_index]),
            np.column_stack([next_index, index + count, next_index + count]),
        ]
    )
    top = vertices - count
    bottom = np.column_stack([index, next_index, np.full(count, vertices)])
    lid = np.column_stack([next_index + top, index + top, np.full(count, vertices + 1)])
    return np.concatenate([(strips + side).reshape(-1, 3), bottom, lid])
