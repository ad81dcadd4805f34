"""Distortion that changes with distance: with the focus of the lens, and within its depth of field.

From the radial coefficients at two focus distances S1, S2 those at S follow:

    alpha = (S2 - S)/(S2 - S1) (S1 - f)/(S - f)
    Ki(S) = (1 - f/S)^(2i+1) [alpha Ki(S1)/(1 - f/S1)^(2i+1) + (1 - alpha) Ki(S2)/(1 - f/S2)^(2i+1)]

A lens focused at s images a point in the depth s' (along the axis, not the slant range) with

    gamma = (s - f)/(s' - f) s'/s,   Ki(s, s') = gamma^(2i) Ki(s'),

decentring by gamma (1 - f/s') of that at infinity, which is (1 - f/s) whatever s' is: within the
depth of field decentring does not change. f is the focal length, which is c at infinity, not
the principal distance; all in mm. Source: Silva 1995 (48-58); Brown 1971; Fryer & Brown 1986.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.model import PARAMETERS, correct_image_points, distort_image_points

RADIAL = ("K1", "K2", "K3")
_FIRST = PARAMETERS.index("K1")
_ODD, _EVEN = np.array([3, 5, 7]), np.array([2, 4, 6])


@dataclass(frozen=True)
class Lens:
    """A lens whose radial distortion is known at two focus distances.

    Attributes
    ----------
    focal_length_mm : float
        f, mm.
    focus_mm : float
        s, distance of the focus from the lens, mm; np.inf: infinity.
    distances_mm : ndarray, shape (2,)
        S1, S2, mm.
    radial : ndarray, shape (2, 3)
        K1, K2, K3 at each of them.
    """

    focal_length_mm: float
    focus_mm: float
    distances_mm: np.ndarray
    radial: np.ndarray

    @property
    def focused(self):
        """(3,) K1, K2, K3 for an object in focus."""
        return self.radial_at(self.focus_mm)

    def radial_at(self, distance_mm):
        """(..., 3) K1, K2, K3 of the lens focused at distances (...)."""
        return radial_at(distance_mm, self.distances_mm, self.radial, self.focal_length_mm)

    def in_depth(self, depth_mm):
        """(..., 3) K1, K2, K3 for objects in depths (...), the lens being focused at focus_mm."""
        gamma = depth_factor(depth_mm, self.focus_mm, self.focal_length_mm)
        return gamma[..., None] ** _EVEN * self.radial_at(depth_mm)


def radial_at(distance_mm, distances_mm, radial, focal_length_mm):
    """Radial coefficients at focus distances from those at two others.

    Parameters
    ----------
    distance_mm : array_like, shape (...)
        Focus distances asked for, mm; they may be infinite.
    distances_mm : array_like, shape (2,)
        S1, S2, mm; they may be infinite.
    radial : array_like, shape (2, 3)
        K1 (mm^-2), K2 (mm^-4), K3 (mm^-6) at each of them.
    focal_length_mm : float
        f, mm.

    Returns
    -------
    ndarray, shape (..., 3)
        K1, K2, K3.

    Raises
    ------
    ValueError
        When the two distances are the same.

    Examples
    --------
    >>> radial_at(2000.0, [1000.0, np.inf], [[-1e-4, 0, 0], [-2e-4, 0, 0]], 50.0)[0].round(8)
    np.float64(-0.00014773)
    """
    f, s = focal_length_mm, np.asarray(distance_mm, dtype=float)
    near, far = np.sort(np.asarray(distances_mm, dtype=float))
    if near == far:
        raise ValueError("two calibrations at the same distance say nothing of another one")
    first, second = np.asarray(radial, dtype=float)[np.argsort(distances_mm)]
    magnified = [one / (1 - f / at) ** _ODD for one, at in ((first, near), (second, far))]
    # alpha with all distances as their reciprocals, so that each may be infinite
    alpha = ((1 / s - 1 / far) / (1 / near - 1 / far) * (1 - f / near) / (1 - f / s))[..., None]
    return (1 - f / s)[..., None] ** _ODD * (alpha * magnified[0] + (1 - alpha) * magnified[1])


def depth_factor(depth_mm, focus_mm, focal_length_mm):
    """gamma of objects in depths: image in focus over image in that depth (S 56).

    gamma = (1 - f/s) / (1 - f/s')

    Parameters
    ----------
    depth_mm : array_like, shape (...)
        s', along the axis, mm.
    focus_mm, focal_length_mm : float
        s and f, mm.

    Returns
    -------
    ndarray, shape (...)
        gamma.

    Examples
    --------
    >>> round(float(depth_factor(4000.0, 2000.0, 50.0)), 6)
    0.987342
    """
    f = focal_length_mm
    return (1 - f / focus_mm) / (1 - f / np.asarray(depth_mm, dtype=float))


def refer_to_focus(xy_mm, depth_mm, interior, form, lens):
    """Image points as they would be if every object lay at the distance of the focus.

    The coefficients in the depth of each point are those of `interior` plus what the two
    calibrations say of the difference; the image is freed of this distortion and given that of the
    focus, whatever the convention.

    Parameters
    ----------
    xy_mm : array_like, shape (n, 2)
        Image points as measured, mm.
    depth_mm : array_like, shape (n,)
        Depths along the axis, mm; nan: left as it is.
    interior : array_like, shape (13,) or (n, 13)
        Interior parameters for objects in focus.
    form : tankcal.camera.model.Form
        How the distortion is written, without a balance.
    lens : Lens
        The two calibrations.

    Returns
    -------
    ndarray, shape (n, 2)
        Image points, mm.
    """
    at_focus = np.broadcast_to(np.asarray(interior, dtype=float), (len(xy_mm), len(PARAMETERS)))
    known = np.isfinite(depth_mm)
    there = at_focus[known].copy()
    there[:, _FIRST : _FIRST + 3] += lens.in_depth(np.asarray(depth_mm)[known]) - lens.focused
    found = np.array(xy_mm, dtype=float)
    found[known] = distort_image_points(
        correct_image_points(found[known], there, form), at_focus[known], form
    )
    return found
