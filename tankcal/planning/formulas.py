"""Planning formulas: vertical photographs, close range, control, volume, focus, target size.

    M = GSD / pixel          Z = f M
    s_X = Z/f sqrt((x/f Z/B s_p)^2 + s_x^2)   s_Y likewise with y     s_Z = Z^2/(f B) s_p
    s_p = sqrt(2) s_x        each stage may use a third of the error of the next
    s = q M s_image          close range
    K = sqrt(p n / (p n - r))                         control in place of check points
    s_V^2 = (2 pi R H s_R)^2 + (pi R^2 s_H)^2         cylinder

The formulas hold for the normal case of two vertical photographs. A simulation of the network
predicts the precision of a tank survey better. No plan uses these functions.

    s = 2 near far / (near + far)                     H - f = near (s - f) / (s - near)
    N = f^2 / (c (H - f))          m = f / (s - f)    blur = 2.44 lambda N (1 + m)
    D = n pixel M / cos(slant)

f is the focal length, N the f-number, and c the largest blur that counts as sharp. s is the focus
distance, m the scale of the image, and M = distance over principal distance. H is the hyperfocal
distance.

Source: Pessoa 2017 (31-39); Merchant 1982 (thirds); Silva 1995 (7, 8, 20, 61-65); Ray 2002, Applied
Photographic Optics, chs. 22 and 6.
"""

import numpy as np

THIRD = 1 / 3  # share of the error of a stage that the stage before it may use (Merchant 1982)
METRE = 1e-3  # metres per millimetre
GREEN_MM = 550e-6  # wavelength of green light, mm
AIRY = 2.44  # diameter of the first dark ring, in units of wavelength times f-number
PIXELS_OF_CIRCLE = 8.0  # diameter of a circle whose centre is located to a tenth of a pixel


def scale_denominator(gsd_m, pixel_mm):
    """Scale denominator M = GSD / pixel of the scale 1 : M."""
    return _require_positive("gsd_m", gsd_m) / (METRE * _require_positive("pixel_mm", pixel_mm))


def flying_height_m(focal_mm, scale):
    """Flying height Z = f M above the ground, m, for principal distance f and scale 1 : M."""
    return METRE * _require_positive("focal_mm", focal_mm) * _require_positive("scale", scale)


def object_sds_m(xy_mm, focal_mm, height_m, base_m, image_sd_mm):
    """Standard deviations of X, Y, Z of points in two vertical photographs.

        s_X = Z/f sqrt((x/f Z/B s_p)^2 + s_x^2)        s_Z = Z^2/(f B) s_p

    Parameters
    ----------
    xy_mm : array_like, shape (..., 2)
        Image coordinates from the principal point, mm. The standard deviations are largest in the
        corners.
    focal_mm : float
        Principal distance f, mm.
    height_m : float
        Height Z above the ground, m.
    base_m : float
        Base B, m.
    image_sd_mm : float
        Standard deviation s_x of an image coordinate, mm.

    Returns
    -------
    ndarray, shape (..., 3)
        m.
    """
    xy = np.asarray(xy_mm, dtype=float)
    if xy.shape[-1:] != (2,):
        raise ValueError(f"found xy_mm of shape {xy.shape}; expected (..., 2)")
    focal = _require_positive("focal_mm", focal_mm)
    height = _require_positive("height_m", height_m)
    base = _require_positive("base_m", base_m)
    image_sd = _require_positive("image_sd_mm", image_sd_mm)
    parallax_sd = np.sqrt(2) * image_sd  # difference of two independent image coordinates
    plan = height / focal * np.hypot(xy / focal * height / base * parallax_sd, image_sd)
    depth = np.full((*xy.shape[:-1], 1), height**2 / (focal * base) * parallax_sd)
    return np.concatenate([plan, depth], axis=-1)


def thirds_m(limit_m, stages=3):
    """Permissible errors (stages,) of the stages of a process, m: limit, limit/3, limit/9.

    limit_m is the permissible error of the product, the last stage. Each stage before it may use a
    third of the error of the next stage.
    """
    if stages < 1:
        raise ValueError(f"found stages = {stages!r}; expected 1 or more")
    return _require_positive("limit_m", limit_m) * THIRD ** np.arange(stages)


def close_range_sd_m(design, scale, image_sd_mm):
    """Mean standard deviation s = q M s_image of object coordinates at close range, m.

    Parameters
    ----------
    design : float
        Design factor q of the network geometry. It is below 1 for many convergent rays from all
        around, and well above 1 for a pair of photographs.
    scale : float
        M, distance over principal distance.
    image_sd_mm : float
        Standard deviation s_image of an image coordinate, mm.
    """
    sd = METRE * _require_positive("image_sd_mm", image_sd_mm)
    return _require_positive("design", design) * _require_positive("scale", scale) * sd


def control_factor(points, unknowns, equations=2):
    """Factor K of Hottier for the differences at control points that took part in an adjustment.

    Differences at control points are too small, because the adjustment fitted to them. By the trace
    of the residual projection, their mean square is s^2 (p n - r) / (p n), so

        R = K R',    K = sqrt(p n / (p n - r))

    estimates the accuracy without check points. The numerator is derived here; it is illegible in
    the copy of the source that was read.

    Parameters
    ----------
    points : int
        Number n of control points.
    unknowns : int
        Number r of parameters that the control points determine.
    equations : int, optional
        Number p of equations of each point.

    Examples
    --------
    >>> round(control_factor(points=8, unknowns=6, equations=3), 3)
    1.155
    """
    total = equations * points
    if not 0 <= unknowns < total:
        raise ValueError(f"found {unknowns!r} unknowns; expected 0 to {total - 1}, below p n")
    return float(np.sqrt(total / (total - unknowns)))


def cylinder_volume_sd_m3(radius_m, height_m, radius_sd_m, height_sd_m, sections=1):
    """Standard deviation of the volume of a cylinder from radius and height alone, m3.

    With a single section, its radius holds for every height. Further sections are independent and
    of equal height, so that s_R^2 becomes s_R^2 / sections. A table of tankcal has the full
    covariance instead.

    Examples
    --------
    >>> round(cylinder_volume_sd_m3(6.479, 9.5, 0.003, 0.004), 2)
    1.27
    """
    radius, height = (
        _require_positive("radius_m", radius_m),
        _require_positive("height_m", height_m),
    )
    by_radius = 2 * np.pi * radius * height * radius_sd_m / np.sqrt(sections)
    return float(np.hypot(by_radius, np.pi * radius**2 * height_sd_m))


def focus_for_m(near_m, far_m):
    """Focus distance s = 2 near far / (near + far), m, that makes both limits equally sharp."""
    near = _require_positive("near_m", near_m)
    if not near <= far_m:
        raise ValueError(f"found {near_m!r} to {far_m!r}; expected the nearer distance first")
    if np.isinf(far_m):
        return 2 * near
    far = _require_positive("far_m", far_m)
    return 2 * near * far / (near + far)


def f_number_for(focal_mm, sharp_mm, near_m, far_m):
    """Smallest f-number that keeps all points between two distances sharp.

    From the depth of field: H - f = near (s - f) / (s - near) at the focus of `focus_for_m`, and
    H - f = f^2 / (N c).

    Parameters
    ----------
    focal_mm : float
        Focal length f, mm.
    sharp_mm : float
        Largest blur c that counts as sharp, mm.
    near_m, far_m : float
        Nearest and farthest distance, m.
    """
    f, s = METRE * _require_positive("focal_mm", focal_mm), focus_for_m(near_m, far_m)
    if not f < near_m < far_m:
        raise ValueError(f"found {near_m!r} to {far_m!r}; expected two distances beyond the lens")
    beyond = near_m * (s - f) / (s - near_m)
    return f * f / (METRE * _require_positive("sharp_mm", sharp_mm) * beyond)


def diffraction_mm(f_number, focal_mm=None, focus_m=np.inf, wavelength_mm=GREEN_MM):
    """Diameter 2.44 lambda N (1 + m) of the Airy disk, mm.

    Parameters
    ----------
    f_number : float
        N.
    focal_mm, focus_m : float, optional
        Focal length, mm, and focus distance, m, for m = f / (s - f); m is 0 for an infinite focus
        distance.
    wavelength_mm : float, optional
    """
    m = 0.0
    if np.isfinite(focus_m):
        f = METRE * _require_positive("focal_mm", focal_mm)
        if _require_positive("focus_m", focus_m) <= f:
            expected = f"expected more than the focal length {f:g} m"
            raise ValueError(f"found focus_m = {focus_m!r}; {expected}")
        m = f / (focus_m - f)
    wavelength = _require_positive("wavelength_mm", wavelength_mm)
    return AIRY * wavelength * _require_positive("f_number", f_number) * (1 + m)


def target_diameter_m(scale, pixel_mm, pixels=PIXELS_OF_CIRCLE, slant_rad=0.0):
    """Smallest diameter D = n pixel M / cos(slant) of a circular target, m.

    Parameters
    ----------
    scale : float
        M of the farthest photograph.
    pixel_mm : float
        Pixel size, mm.
    pixels : float, optional
        Diameter n of the image of the target, pixels.
    slant_rad : float, optional
        Largest angle between line of sight and target normal, rad. Its cosine narrows the image.
    """
    n = _require_positive("pixels", pixels)
    if not 0 <= slant_rad < np.pi / 2:
        raise ValueError(f"found slant_rad = {slant_rad!r}; expected 0 to below a right angle")
    across = METRE * _require_positive("pixel_mm", pixel_mm) * _require_positive("scale", scale)
    return n * across / np.cos(slant_rad)


def _require_positive(name, value):
    """Return the value; raise ValueError unless it is finite and above 0."""
    values = np.asarray(value, dtype=float)
    if not (np.isfinite(values).all() and (values > 0).all()):
        raise ValueError(f"found {name} = {value!r}; expected a number above 0")
    return value if np.isscalar(value) else values
