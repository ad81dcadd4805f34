"""Planning formulas: flights over flat ground, close range, what a lens shows, size of targets.

    M = GSD / pixel          Z = f M          B = (1 - overlap) frame M
    s_X = Z/f sqrt((x/f Z/B s_p)^2 + s_x^2)   s_Y alike with y        s_Z = Z^2/(f B) s_p
    s_p = sqrt(2) s_x        each stage may use a third of the error of the next
    s = q M s_image          close range

They stand for the normal case of two vertical photos. What a network of a tank will give is better
told by its simulation. A calculator beside the plan, for Python: no plan needs them.

    H = f^2 / (N c) + f            near = s (H - f) / (H + s - 2 f)       far = s (H - f) / (H - s)
    m = f / (s - f)                blur = 2.44 lambda N (1 + m)           D = n pixel M

f focal length, N f-number, c largest blur that still counts as sharp, s distance that the lens is
focused at, m scale of the image, M = distance over principal distance. From the hyperfocal distance
H on everything beyond H/2 is sharp.

Source: Pessoa 2017 (31-39); Merchant 1982 (thirds); Silva 1995 (20); Ray 2002, Applied Photographic
Optics, chs. 22 and 6.
"""

import numpy as np

THIRD = 1 / 3
METRE = 1e-3  # of a millimetre
GREEN_MM = 550e-6  # wavelength
AIRY = 2.44  # diameter of the dark ring, in wavelengths times f-number
PIXELS_OF_CIRCLE = 8.0  # across a circle whose centre is to be found to a tenth of a pixel
PIXELS_OF_BIT = 3.0  # across one cell of a coded target


def scale_denominator(gsd_m, pixel_mm):
    """M = GSD/pixel, the number in the scale 1 : M, of a pixel of GSD metres on the ground."""
    return positive("gsd_m", gsd_m) / (METRE * positive("pixel_mm", pixel_mm))


def ground_sample_distance_m(scale, pixel_mm):
    """GSD = M pixel, the size of a pixel on the ground, m."""
    return positive("scale", scale) * METRE * positive("pixel_mm", pixel_mm)


def flying_height_m(focal_mm, scale):
    """Z = f M above the ground, m, for a principal distance f and the scale 1 : M."""
    return METRE * positive("focal_mm", focal_mm) * positive("scale", scale)


def base_m(overlap, frame_mm, scale):
    """B = (1 - overlap) frame M between neighbouring photos, m.

    overlap   share of the frame that both show, 0 to below 1
    frame_mm  side of the frame along the flight
    """
    if not 0 <= overlap < 1:
        raise ValueError(f"found overlap = {overlap!r}; expected a share from 0 to below 1")
    frame = METRE * positive("frame_mm", frame_mm)
    return (1 - overlap) * frame * positive("scale", scale)


def parallax_sd(image_sd):
    """s_p = sqrt(2) s_x of a difference of two image coordinates, in their unit."""
    return np.sqrt(2) * positive("image_sd", image_sd)


def object_sds_m(xy_mm, focal_mm, height_m, base_m, image_sd_mm):
    """Standard deviations (..., 3) of X, Y, Z, m, of points at (..., 2) in the image, mm.

        s_X = Z/f sqrt((x/f Z/B s_p)^2 + s_x^2)        s_Z = Z^2/(f B) s_p

    height_m  Z above the ground     base_m  B     image_sd_mm  s_x of an image coordinate

    Two vertical photos, coordinates from the principal point; the largest are in the corners.
    """
    xy = np.asarray(xy_mm, dtype=float)
    if xy.shape[-1:] != (2,):
        raise ValueError(f"found xy_mm of shape {xy.shape}; expected (..., 2)")
    focal, height = positive("focal_mm", focal_mm), positive("height_m", height_m)
    base, image_sd = positive("base_m", base_m), positive("image_sd_mm", image_sd_mm)
    parallax = parallax_sd(image_sd)
    plan = height / focal * np.hypot(xy / focal * height / base * parallax, image_sd)
    depth = np.full((*xy.shape[:-1], 1), height**2 / (focal * base) * parallax)
    return np.concatenate([plan, depth], axis=-1)


def thirds_m(limit_m, stages=3):
    """Errors (stages,) that stages may have, m, from the last one back: limit, limit/3, limit/9.

    limit_m  of the product; the stage before it may use a third, the one before that a ninth
    """
    if stages < 1:
        raise ValueError(f"found stages = {stages!r}; expected 1 or more")
    return positive("limit_m", limit_m) * THIRD ** np.arange(stages)


def classes_reached(sd_m, limits):
    """The best class of each scale that a standard deviation reaches: a tuple of limits.

    sd_m    of the product; in plan sqrt(s_X^2 + s_Y^2)
    limits  limits of one part, the best class of a scale first: things with `scale` and `sd_m`
            (`tankcal.calibration.product.limits.Limit`)
    """
    found = {}
    for limit in limits:
        if limit.scale not in found and sd_m <= limit.sd_m:
            found[limit.scale] = limit
    return tuple(found.values())


def close_range_sd_m(design, scale, image_sd_mm):
    """s = q M s_image, the mean standard deviation of object coordinates at close range, m.

    design  q, of the geometry of the network: the stronger, the smaller; below 1 where many rays
            converge from all around, well above 1 for a pair of photos
    scale   M, distance over principal distance
    """
    sd = METRE * positive("image_sd_mm", image_sd_mm)
    return positive("design", design) * positive("scale", scale) * sd


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


def positive(name, value):
    """The value, or ValueError unless all of it is finite and above 0."""
    found = np.asarray(value, dtype=float)
    if not (np.isfinite(found).all() and (found > 0).all()):
        raise ValueError(f"found {name} = {value!r}; expected a number above 0")
    return value if np.isscalar(value) else found
