"""Conversion between the conventions of publications, with the covariance.

The conversion is exact if it preserves the image to the last term. Exact conversions are the change
of sign between correction_added and correction_subtracted, another balance R0, and the change
between the affinities both_y and b1_b2. The change of sign reverses K, P, A and B, but not P3 and
P4. The two affinities differ by a common scale,

    [1  A; 0  1 + B] = (1 + B) [1/(1 + B)  A/(1 + B); 0  1]

so that c takes up (1 + B). All other conversions are fits over the frame, and the remaining error
is stated. The inverse of a polynomial is no polynomial. B of both_x rotates the image. An affinity
before_distortion moves the point of evaluation of the distortion.

Source: Silva 1995 (39-47, 58); Pessoa 2017 (3-6, 10); Boerlin & Grussenmeyer 2013 (DBAT).
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.camera.formats.frame import (
    SAME_POINT_PX,
    USUAL,
    differences_px,
    fit,
    frame_points,
    make_framed_camera,
    pixels_to_mm,
    trace_rays,
)
from tankcal.camera.model import CONVENTIONS, PARAMETERS, Form, balance_about, rescale_interior
from tankcal.errors import SolutionError
from tankcal.messages import message

PUBLISHED = {
    "silva": Form("correction_added", "both_y"),
    "pessoa": Form("correction_subtracted", "both_x"),
    "dbat": Form("correction_added", "before_distortion"),  # residual function 1 of DBAT
    "plain": Form(),
}
TURNS_ROUND = (3, 4, 5, 6, 7, 8)  # parameters K1..K4, P1, P2, which change their sign


@dataclass(frozen=True)
class Conversion:
    """Camera in another form.

    Attributes
    ----------
    interior : ndarray, shape (13,)
        Interior parameters.
    form : Form
        Form of the distortion.
    error_px : float
        Largest distance of image points of equal rays over the frame, px; only rounding if exact.
    rms_px : float
        Root mean square of this distance, px.
    is_exact : bool
        True for a conversion by formula, False for a fit over the frame.
    covariance : ndarray, shape (13, 13), or None
        Covariance of the interior parameters.
    turn_rad : float
        Rotation of the camera about its axis, added to kappa; 0 unless permitted.
    """

    interior: np.ndarray
    form: Form
    error_px: float
    rms_px: float
    is_exact: bool
    covariance: np.ndarray | None = None
    turn_rad: float = 0.0


def convert_camera(
    interior, form, to_form, size_px, pixel_mm, used=None, covariance=None, may_turn=False
):
    """Convert a camera to another form.

    Parameters
    ----------
    interior : array_like, shape (13,)
        Interior parameters.
    form, to_form : Form
        Given and required form.
    size_px, pixel_mm : array_like, shape (2,)
        Frame of the fit and of the errors.
    used : sequence of str, optional
        Names of the parameters that may differ from 0. By default, all parameters of the formula.
        In a fit, the default is c, x0, y0, K1..K3, P1, P2, A, B and all non-zero parameters. K4, P3
        and P4 reduce the mean error, but not always the largest error.
    covariance : array_like, shape (13, 13), optional
        Covariance of the interior parameters, propagated by the derivatives of the conversion.
    may_turn : bool, optional
        If True, a fit may rotate the camera about its axis.

    Returns
    -------
    Conversion

    Raises
    ------
    SolutionError
        If the distortion folds the image within the frame.
    """
    camera = make_framed_camera(interior, form, pixel_mm, size_px)

    def convert(values):
        return _convert_values(values, camera, to_form, used, may_turn)

    converted, turn, is_exact = convert(camera.interior)
    points = frame_points(size_px)
    # Errors compare the images of equal rays.
    rays = _rotate_rays(trace_rays(camera, points), turn)
    distances = differences_px(
        make_framed_camera(converted, to_form, camera.pixel_mm, size_px), rays, points
    )
    rms = float(np.sqrt(np.mean(distances**2)))
    new_covariance = None
    if covariance is not None:
        new_covariance = propagate_by_differences(
            lambda values: convert(values)[0], camera.interior, covariance
        )
    return Conversion(
        converted, to_form, float(distances.max()), rms, is_exact, new_covariance, turn
    )


def convert_to_publication(camera, name, covariance=None):
    """Convert a FramedCamera to the form of a publication.

    Parameters
    ----------
    camera : FramedCamera
        The camera.
    name : str
        One of PUBLISHED.
    covariance : array_like, shape (13, 13), optional
        Covariance of camera.interior, with nan on the diagonal for a parameter without a standard
        deviation.

    Returns
    -------
    camera : FramedCamera
    covariance : ndarray, shape (13, 13), or None

    Notes
    -----
    A parameter without a standard deviation is exact in the propagation, and has no standard
    deviation afterwards. See also `convert_camera`.
    """
    finite_covariance = None if covariance is None else np.nan_to_num(covariance)
    to_form, frame = PUBLISHED[name], (camera.size_px, camera.pixel_mm)
    converted = convert_camera(
        camera.interior, camera.form, to_form, *frame, covariance=finite_covariance
    )
    changed = replace(
        camera, interior=converted.interior, form=converted.form, error_px=converted.error_px
    )
    if covariance is None:
        return changed, None
    return changed, _restore_unknown(converted.covariance, changed, camera.interior, covariance)


def _restore_unknown(new_covariance, camera, values, covariance):
    """Mark unknown variances of a converted covariance, as before the conversion.

    A non-zero parameter without a standard deviation gets nan. A variance that the conversion adds
    to a held or unknown parameter is set to zero if no image point depends on it, because it is
    rounding.

    Parameters
    ----------
    new_covariance : ndarray, shape (13, 13)
        Covariance after the conversion.
    camera : FramedCamera
        Camera after the conversion.
    values, covariance : ndarray, shape (13,) and (13, 13)
        Before the conversion.
    """
    variances = np.diag(covariance)
    is_open = np.isnan(variances) | (variances == 0)
    # Effect of each open standard deviation on the image.
    sds = np.sqrt(np.where(is_open, np.maximum(np.diag(new_covariance), 0.0), 0.0))
    has_effect = _effect_px(camera, sds) > SAME_POINT_PX
    result = np.where(is_open & ~has_effect, 0.0, new_covariance)
    result = np.where((is_open & ~has_effect)[:, None], 0.0, result)
    is_unknown = np.isnan(variances) & ((values != 0) | ~has_effect)
    return result + np.diag(np.where(is_unknown, np.nan, 0.0))


def _effect_px(camera, changes):
    """Largest change (13,) of the image over the frame for each change (13,) of a parameter, px."""
    points = frame_points(camera.size_px)
    rays = trace_rays(camera, points)
    changed = camera.interior + np.diag(changes)
    return np.array(
        [
            differences_px(replace(camera, interior=changed_interior), rays, points).max()
            for changed_interior in changed
        ]
    )


def propagate_by_differences(function, values, covariance):
    """Covariance of function(values) by central differences.

    Parameters
    ----------
    function : callable
        function(values) -> results (m,).
    values : array_like, shape (n,)
        Values.
    covariance : array_like, shape (n, n)
        Covariance, with zero rows and columns for exact values.

    Returns
    -------
    ndarray, shape (m, m)

    Raises
    ------
    SolutionError
        If the covariance is not finite, not symmetric, or has negative variances.

    Examples
    --------
    >>> propagate_by_differences(lambda x: 2 * x, np.array([1.0]), np.array([[4.0]])).round(6)
    array([[16.]])
    """
    values, covariance = np.asarray(values, dtype=float), np.asarray(covariance, dtype=float)
    sd = _standard_deviations(covariance, len(values))
    columns = []
    for i in np.flatnonzero(sd):
        step = np.zeros_like(values)
        # A small part of the standard deviation, but large enough to exceed rounding.
        step[i] = max(1e-3 * sd[i], 1e-7 * abs(values[i]))
        columns.append((function(values + step) - function(values - step)) / (2 * step[i]))
    if not columns:
        return np.zeros((len(function(values)),) * 2)
    jacobian = np.column_stack(columns)
    uncertain = sd > 0
    return jacobian @ covariance[np.ix_(uncertain, uncertain)] @ jacobian.T


def _standard_deviations(covariance, count):
    """Standard deviations (n,); raises SolutionError for an invalid covariance."""
    if covariance.shape != (count, count) or not np.all(np.isfinite(covariance)):
        raise SolutionError(
            message(
                "convert_covariance",
                "covariance: expected {count} x {same} finite numbers",
                count=count,
                same=count,
            )
        )
    if np.any(np.diag(covariance) < 0) or not np.allclose(covariance, covariance.T, rtol=1e-9):
        raise SolutionError(
            message(
                "convert_covariance_form",
                "covariance: expected a symmetric matrix without negative variances",
            )
        )
    return np.sqrt(np.diag(covariance))


def _convert_values(values, camera, to_form, used, may_turn):
    """Converted interior parameters, rotation (rad), and whether the conversion is exact."""
    excluded = [i for i, name in enumerate(PARAMETERS) if used is not None and name not in used]
    exact = _convert_exactly(values, camera.form, to_form)
    if exact is not None and not np.any(exact[excluded]):
        return exact, 0.0, True
    source = make_framed_camera(values, camera.form, camera.pixel_mm, camera.size_px)
    points = frame_points(camera.size_px)
    image_mm = pixels_to_mm(points, camera.pixel_mm, camera.size_px)
    if used is None:
        used = (*USUAL, *(name for name, value in zip(PARAMETERS, values, strict=True) if value))
    # Start values (13,) of the form without a balance: first-order, without A and B.
    start = balance_about(values, camera.form, 0.0)[0]
    if (CONVENTIONS[camera.form.convention] > 0) != (CONVENTIONS[to_form.convention] > 0):
        start[list(TURNS_ROUND)] *= -1
    start[[11, 12]] = 0.0
    start[excluded] = 0.0
    # The fit uses the form without a balance; balancing afterwards is exact.
    plain = Form(to_form.convention, to_form.affinity)
    extras = ("turn",) if may_turn else ()
    result = fit(trace_rays(source, points), image_mm, camera.pixel_mm, plain, start, used, extras)
    return (
        balance_about(result.interior, plain, to_form.radial_balance_mm)[0],
        result.turn_rad,
        False,
    )


def _convert_exactly(values, form, to_form):
    """Converted interior parameters (13,) by formula, or None without a formula."""
    sign, to_sign = CONVENTIONS[form.convention], CONVENTIONS[to_form.convention]
    # A distortion of the ideal point has no closed inverse.
    if abs(sign) != abs(to_sign):
        return None
    plain = balance_about(values, form, 0.0)[0]
    if sign != to_sign:
        plain[list(TURNS_ROUND)] *= -1
        if form.affinity != "before_distortion":
            plain[11:] *= -1
    plain = _replace_affinity(plain, form.affinity, to_form)
    if plain is None:
        return None
    unbalanced_form = Form(to_form.convention, to_form.affinity)
    return balance_about(plain, unbalanced_form, to_form.radial_balance_mm)[0]


def _replace_affinity(plain, affinity, to_form):
    """Interior parameters (13,) with A and B of another affinity, or None without a formula."""
    a, b = plain[11:]
    to_affinity = to_form.affinity
    if affinity == to_affinity or (a == 0 and b == 0):
        return plain
    # This affinity changes the point of evaluation, so that no formula exists.
    if "before_distortion" in (affinity, to_affinity):
        return None
    if affinity == "both_x":
        # B of both_x rotates the image.
        if b != 0:
            return None
        affinity = "b1_b2"  # the term A x is equal in both affinities
        if affinity == to_affinity:
            return plain
    if to_affinity == "both_x":
        if affinity == "b1_b2":
            return plain if b == 0 else None
        if a != 0:
            return None
    # A correction that is subtracted has the opposite sign of A and B.
    sign = CONVENTIONS[to_form.convention] or 1.0
    # With the sign of the convention: [1 a; 0 1 + b] for both_y, [1 + a b; 0 1] for b1_b2.
    if affinity == "both_y":
        scale = 1 + sign * b
        result = rescale_interior(plain, to_form, scale)
        result[11:] = sign * (1 / scale - 1), a / scale
    else:
        scale = 1 / (1 + sign * a)
        result = rescale_interior(plain, to_form, 1 / scale)
        result[11:] = b * scale, sign * (scale - 1)
    return result


def _rotate_rays(rays, turn_rad):
    """Rotate rays (n, 2) about the axis of the camera."""
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    return rays @ np.array([[cos, -sin], [sin, cos]])
