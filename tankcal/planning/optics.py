"""What a lens shows: depth of field, diffraction, and how large a target has to be.

    H = f^2 / (N c) + f            near = s (H - f) / (H + s - 2 f)       far = s (H - f) / (H - s)
    m = f / (s - f)                blur = 2.44 lambda N (1 + m)           D = n pixel M

f focal length, N f-number, c largest blur that still counts as sharp, s distance that the lens is
focused at, m scale of the image, M = distance over principal distance. From the hyperfocal distance
H on everything beyond H/2 is sharp. Source: Ray 2002, Applied Photographic Optics, chs. 22 and 6.
"""

import numpy as np

from tankcal.planning.formulas import METRE, positive

GREEN_MM = 550e-6  # wavelength
AIRY = 2.44  # diameter of the dark ring, in wavelengths times f-number
PIXELS_OF_CIRCLE = 8.0  # across a circle whose centre is to be found to a tenth of a pixel
PIXELS_OF_BIT = 3.0  # across one cell of a coded target


def hyperfocal_m(focal_mm, f_number, sharp_mm):
    """H = f^2 / (N c) + f, m."""
    f, n, c = (
        positive(name, value)
        for name, value in (("focal_mm", focal_mm), ("f_number", f_number), ("sharp_mm", sharp_mm))
    )
    return METRE * (f * f / (n * c) + f)


def depth_of_field_m(focal_mm, f_number, sharp_mm, focus_m):
    """Nearest and farthest sharp distance from the lens, m; inf from the hyperfocal one on."""
    h, f = hyperfocal_m(focal_mm, f_number, sharp_mm), METRE * focal_mm
    s = _beyond(f, focus_m)
    near = s * (h - f) / (h + s - 2 * f)
    far = s * (h - f) / (h - s) if s < h else np.inf
    return near, far


def _beyond(focal_m, focus_m):
    """The distance focused at, or ValueError where no lens can be."""
    if positive("focus_m", focus_m) <= focal_m:
        expected = f"expected more than the focal length {focal_m:g} m"
        raise ValueError(f"found focus_m = {focus_m!r}; {expected}")
    return focus_m


def focus_for_m(near_m, far_m):
    """Distance s = 2 near far / (near + far) to focus at, so that both limits are equally sharp."""
    near = positive("near_m", near_m)
    if not near <= far_m:
        raise ValueError(f"found {near_m!r} to {far_m!r}; expected the nearer distance first")
    if np.isinf(far_m):
        return 2 * near
    far = positive("far_m", far_m)
    return 2 * near * far / (near + far)


def f_number_for(focal_mm, sharp_mm, near_m, far_m):
    """The least f-number that keeps everything between two distances sharp.

    From the depth of field: H - f = near (s - f) / (s - near) at the focus of `focus_for_m`.
    """
    f, s = METRE * positive("focal_mm", focal_mm), focus_for_m(near_m, far_m)
    if not f < near_m < far_m:
        raise ValueError(f"found {near_m!r} to {far_m!r}; expected two distances beyond the lens")
    beyond = near_m * (s - f) / (s - near_m)
    return f * f / (METRE * positive("sharp_mm", sharp_mm) * beyond)


def diffraction_mm(f_number, focal_mm=None, focus_m=np.inf, wavelength_mm=GREEN_MM):
    """Diameter 2.44 lambda N (1 + m) of the Airy disk, mm.

    focal_mm, focus_m  for m = f / (s - f); far away m is 0
    """
    m = 0.0
    if np.isfinite(focus_m):
        f = METRE * positive("focal_mm", focal_mm)
        m = f / (_beyond(f, focus_m) - f)
    wavelength = positive("wavelength_mm", wavelength_mm)
    return AIRY * wavelength * positive("f_number", f_number) * (1 + m)


def target_diameter_m(scale, pixel_mm, pixels=PIXELS_OF_CIRCLE, slant_rad=0.0):
    """Least diameter D = n pixel M / cos(slant) of a circle, m.

    scale   M of the farthest photo        pixels  n, across its image
    slant_rad  largest angle of sight from its normal: the image is narrower by its cosine
    """
    n = positive("pixels", pixels)
    if not 0 <= slant_rad < np.pi / 2:
        raise ValueError(f"found slant_rad = {slant_rad!r}; expected 0 to below a right angle")
    across = METRE * positive("pixel_mm", pixel_mm) * positive("scale", scale)
    return n * across / np.cos(slant_rad)


def coded_target_m(scale, pixel_mm, cells, pixels=PIXELS_OF_BIT, slant_rad=0.0):
    """Least side of a coded target of so many cells across, its border among them, m."""
    return positive("cells", cells) * target_diameter_m(scale, pixel_mm, pixels, slant_rad)
