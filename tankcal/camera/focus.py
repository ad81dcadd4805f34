"""Distortion as a function of distance: focus of the lens, and depth of field.

The radial coefficients at two focus distances S1, S2 determine those at S:

    alpha = (S2 - S)/(S2 - S1) (S1 - f)/(S - f)
    Ki(S) = (1 - f/S)^(2i+1) [alpha Ki(S1)/(1 - f/S1)^(2i+1) + (1 - alpha) Ki(S2)/(1 - f/S2)^(2i+1)]

A lens focused at s images a point in the depth s' (along the axis, not the slant range) with

    gamma = (s - f)/(s' - f) s'/s,   Ki(s, s') = gamma^(2i) Ki(s')

Decentring distortion is gamma (1 - f/s') times its value at infinity. This product equals (1 - f/s)
for every s', so that decentring is constant within the depth of field. f is the focal length, which
equals c at infinity, not the principal distance. All lengths are in mm.

Source: Silva 1995 (48-58); Brown 1971; Fryer & Brown 1986.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.model import PARAMETERS, correct_image_points, distort_image_points

RADIAL = ("K1", "K2", "K3")
_FIRST = PARAMETERS.index("K1")
_ODD, _EVEN = np.array([3, 5, 7]), np.array([2, 4, 6])


@dataclass(frozen=True)
class Lens:
    """Lens with radial distortion calibrated at two focus distances.

    Attributes
    ----------
    focal_length_mm : float
        f, mm.
    focus_mm : float
        Distance s of the focus from the lens, mm; np.inf for infinity.
    distances_mm : ndarray, shape (2,)
        S1, S2, mm.
    radial : ndarray, shape (2, 3)
        K1, K2, K3 at each of these distances.
    """

    focal_length_mm: float
    focus_mm: float
    distances_mm: np.ndarray
    radial: np.ndarray

    @property
    def radial_in_focus(self):
        """K1, K2, K3 (3,) for an object in focus."""
        return self.radial_at(self.focus_mm)

    def radial_at(self, distance_mm):
        """Radial coefficients of the lens focused at any distance, from the two calibrations.

        Parameters
        ----------
        distance_mm : array_like, shape (...)
            Focus distances, mm; may be infinite.

        Returns
        -------
        ndarray, shape (..., 3)
            K1 (mm^-2), K2 (mm^-4), K3 (mm^-6).

        Raises
        ------
        ValueError
            If the two calibrated distances are equal.

        Examples
        --------
        >>> radial = np.array([[-1e-4, 0, 0], [-2e-4, 0, 0]])
        >>> lens = Lens(50.0, 2000.0, np.array([1000.0, np.inf]), radial)
        >>> lens.radial_at(2000.0)[0].round(8)
        np.float64(-0.00014773)
        """
        f, s = self.focal_length_mm, np.asarray(distance_mm, dtype=float)
        near, far = np.sort(self.distances_mm)
        if near == far:
            raise ValueError("calibrations at equal distances do not determine another distance")
        first, second = self.radial[np.argsort(self.distances_mm)]
        at_infinity = [
            coefficients / (1 - f / distance) ** _ODD
            for coefficients, distance in ((first, near), (second, far))
        ]
        # alpha in terms of reciprocal distances, so that each distance may be infinite.
        alpha = ((1 / s - 1 / far) / (1 / near - 1 / far) * (1 - f / near) / (1 - f / s))[..., None]
        combined = alpha * at_infinity[0] + (1 - alpha) * at_infinity[1]
        return (1 - f / s)[..., None] ** _ODD * combined

    def radial_in_depth(self, depth_mm):
        """K1, K2, K3 (..., 3) for objects in depths (...), with the lens focused at focus_mm."""
        # Ki(s, s') = gamma^(2i) Ki(s').
        gamma = depth_factor(depth_mm, self.focus_mm, self.focal_length_mm)
        return gamma[..., None] ** _EVEN * self.radial_at(depth_mm)


def depth_factor(depth_mm, focus_mm, focal_length_mm):
    """Factor gamma of objects in depths: image scale in focus over image scale in depth (S 56).

    Parameters
    ----------
    depth_mm : array_like, shape (...)
        Depth s' along the axis, mm.
    focus_mm, focal_length_mm : float
        s and f, mm.

    Returns
    -------
    ndarray, shape (...)
        gamma, without a unit.

    Notes
    -----
    gamma = (1 - f/s) / (1 - f/s')

    Examples
    --------
    >>> round(float(depth_factor(4000.0, 2000.0, 50.0)), 6)
    0.987342
    """
    # (s - f)/(s' - f) s'/s, with both distances as reciprocals, so that they may be infinite.
    f = focal_length_mm
    return (1 - f / focus_mm) / (1 - f / np.asarray(depth_mm, dtype=float))


def refer_to_focus(xy_mm, depth_mm, interior, form, lens):
    """Refer image points to the focus distance: remove the effect of depth on the distortion.

    Parameters
    ----------
    xy_mm : array_like, shape (n, 2)
        Measured image points, mm.
    depth_mm : array_like, shape (n,)
        Depths along the axis, mm; a point with nan is unchanged.
    interior : array_like, shape (13,) or (n, 13)
        Interior parameters for objects in focus.
    form : tankcal.camera.model.Form
        Form of the distortion, without a balance.
    lens : Lens
        The two calibrations.

    Returns
    -------
    ndarray, shape (n, 2)
        Image points, mm.

    Notes
    -----
    The coefficients in the depth of a point are those of `interior` plus the difference derived
    from the two calibrations. The image point is corrected with these coefficients and distorted
    with the coefficients in focus. The method applies to every convention.
    """
    at_focus = np.broadcast_to(np.asarray(interior, dtype=float), (len(xy_mm), len(PARAMETERS)))
    is_finite = np.isfinite(depth_mm)
    depth_interior = at_focus[is_finite].copy()
    # Only the difference of both calibrations counts; `interior` may come from another adjustment.
    depth_interior[:, _FIRST : _FIRST + 3] += (
        lens.radial_in_depth(np.asarray(depth_mm)[is_finite]) - lens.radial_in_focus
    )
    image = np.array(xy_mm, dtype=float)
    # Correct with the distortion in depth, then distort with the distortion in focus.
    image[is_finite] = distort_image_points(
        correct_image_points(image[is_finite], depth_interior, form), at_focus[is_finite], form
    )
    return image
