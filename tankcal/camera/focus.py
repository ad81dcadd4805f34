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

from tankcal.camera.model import PARAMETERS, corrected, measured

RADIAL = ("K1", "K2", "K3")
_FIRST = PARAMETERS.index("K1")
_ODD, _EVEN = np.array([3, 5, 7]), np.array([2, 4, 6])


@dataclass(frozen=True)
class Lens:
    """A lens whose radial distortion is known at two focus distances.

    focal_length_mm  f                        focus_mm  s, from the lens; np.inf: infinity
    distances_mm     (2,) S1, S2              radial    (2, 3) K1, K2, K3 at each of them
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
    """(..., 3) K1, K2, K3 at focus distances (...) from those (2, 3) at two others (2,).

    Distances may be infinite. Raises ValueError when the two are the same.
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
    """gamma (...) of objects in depths (...): image in focus over image in that depth (S 56)."""
    f = focal_length_mm
    return (1 - f / focus_mm) / (1 - f / np.asarray(depth_mm, dtype=float))


def as_in_focus(xy_mm, depth_mm, interior, form, lens):
    """Image points (n, 2) as they would be if every object lay at the distance of the focus.

    xy_mm     (n, 2) as measured           depth_mm  (n,) along the axis; nan: left as it is
    interior  (13,) or (n, 13), for objects in focus
    form      camera.Form without a balance; lens  Lens

    The coefficients in the depth of each point are those of `interior` plus what the two
    calibrations say of the difference; the image is freed of this distortion and given that of the
    focus, whatever the convention.
    """
    at_focus = np.broadcast_to(np.asarray(interior, dtype=float), (len(xy_mm), len(PARAMETERS)))
    known = np.isfinite(depth_mm)
    there = at_focus[known].copy()
    there[:, _FIRST : _FIRST + 3] += lens.in_depth(np.asarray(depth_mm)[known]) - lens.focused
    found = np.array(xy_mm, dtype=float)
    found[known] = measured(corrected(found[known], there, form), at_focus[known], form)
    return found
