"""The conventions of publications, each into each other, with the covariance.

Exact where the image stays the same to the last term: a change of sign between correction_added and
correction_subtracted (K, P, A, B turn round, P3 and P4 stay), another balance R0, and the
affinities both_y and b1_b2, which differ by a scale of all,

    [1  A; 0  1 + B] = (1 + B) [1/(1 + B)  A/(1 + B); 0  1]

so that c takes (1 + B). All else (the inverse of a polynomial is none; B of both_x turns the image;
an affinity before_distortion moves the point at which the distortion holds) is fitted over the
frame, and what is left is stated.

Source: Silva 1995 (39-47, 58); Pessoa 2017 (3-6, 10); Boerlin & Grussenmeyer 2013 (DBAT).
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.camera.formats.fitting import USUAL, fit
from tankcal.camera.formats.frame import (
    SAME_POINT_PX,
    differences_px,
    frame_points,
    make_framed_camera,
    pixels_to_mm,
    rays_of,
)
from tankcal.camera.model import CONVENTIONS, PARAMETERS, Form, balanced_about, rescale_interior
from tankcal.errors import SolutionError
from tankcal.messages import message

PUBLISHED = {
    "silva": Form("correction_added", "both_y"),
    "pessoa": Form("correction_subtracted", "both_x"),
    "dbat": Form("correction_added", "before_distortion"),  # its residual function 1
    "plain": Form(),
}
TURNS_ROUND = (3, 4, 5, 6, 7, 8)  # K1..K4, P1, P2; A and B where they are part of the distortion


@dataclass(frozen=True)
class Converted:
    """The same camera in another form.

    interior    (13,)        form  its Form
    error_px    largest distance of an image point over the frame from the camera that was given,
                the rays being the same; 0 but for rounding where is_exact
    rms_px      root mean square of that distance
    is_exact    by formula; else fitted over the frame
    covariance  (13, 13) of interior, or None where none was given
    turn_rad    by which the camera was turned about its axis (added to kappa): 0 unless asked for
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
    """Converted: the camera in the form to_form.

    interior, form     (13,) and Form of what is given
    size_px, pixel_mm  (2,) of the frame over which is fitted and the error is stated
    used               names of the parameters that the form may use, the others are 0; None: those
                       that the formula gives, in a fit the usual ones (c, x0, y0, K1..K3, P1, P2,
                       A, B) and those that are given and not 0. K4, P3 and P4 make the mean error
                       smaller, though not always the largest
    covariance         (13, 13) of interior, carried over by the derivatives of the conversion
    may_turn           let a fit turn the camera about its axis

    Raises SolutionError where the distortion folds the image within the frame.
    """
    given = make_framed_camera(interior, form, pixel_mm, size_px)

    def convert(values):
        return _converted(values, given, to_form, used, may_turn)

    found, turn, is_exact = convert(given.interior)
    points = frame_points(size_px)
    rays = _turned(rays_of(given, points), turn)
    off = differences_px(make_framed_camera(found, to_form, given.pixel_mm, size_px), rays, points)
    rms = float(np.sqrt(np.mean(off**2)))
    after = None
    if covariance is not None:
        after = propagate_by_differences(
            lambda values: convert(values)[0], given.interior, covariance
        )
    return Converted(found, to_form, float(off.max()), rms, is_exact, after, turn)


def camera_in_form(camera, name, covariance=None):
    """A FramedCamera in the form of a publication, one of PUBLISHED, and its covariance.

    covariance  (13, 13) of camera.interior, its diagonal nan where no sd is known, or None: then
                that of the result is None, too

    See converted. What has no sd counts as exact for the sds of the others, and has none again.
    """
    known = None if covariance is None else np.nan_to_num(covariance)
    to_form, frame = PUBLISHED[name], (camera.size_px, camera.pixel_mm)
    found = convert_camera(camera.interior, camera.form, to_form, *frame, covariance=known)
    changed = replace(camera, interior=found.interior, form=found.form, error_px=found.error_px)
    if covariance is None:
        return changed, None
    return changed, _with_lacking(found.covariance, changed, camera.interior, covariance)


def _with_lacking(after, camera, values, covariance):
    """A covariance (13, 13) after a conversion, as the one before where it says nothing.

    camera              FramedCamera after the conversion
    values, covariance  (13,) and (13, 13) before

    Nan: a value, not 0, had no sd. What had none, or was held, and has one that no image point
    feels, is as it was: that is rounding.
    """
    before = np.diag(covariance)
    is_open = np.isnan(before) | (before == 0)
    sds = np.sqrt(np.where(is_open, np.maximum(np.diag(after), 0.0), 0.0))
    is_felt = _effect_px(camera, sds) > SAME_POINT_PX
    found = np.where(is_open & ~is_felt, 0.0, after)
    found = np.where((is_open & ~is_felt)[:, None], 0.0, found)
    is_unknown = np.isnan(before) & ((values != 0) | ~is_felt)
    return found + np.diag(np.where(is_unknown, np.nan, 0.0))


def _effect_px(camera, changes):
    """(13,) largest movements of the image over the frame by each of (13,) changes."""
    points = frame_points(camera.size_px)
    rays = rays_of(camera, points)
    changed = camera.interior + np.diag(changes)
    return np.array(
        [differences_px(replace(camera, interior=one), rays, points).max() for one in changed]
    )


def propagate_by_differences(function, values, covariance):
    """Covariance (m, m) of function(values) (m,), by central differences of a small part of a sd.

    values      (n,)
    covariance  (n, n), rows and columns of 0 for values that are not uncertain

    Raises SolutionError when the covariance is none: not finite, not symmetric, negative.
    """
    values, covariance = np.asarray(values, dtype=float), np.asarray(covariance, dtype=float)
    sd = _standard_deviations(covariance, len(values))
    columns = []
    for i in np.flatnonzero(sd):
        step = np.zeros_like(values)
        step[i] = max(1e-3 * sd[i], 1e-7 * abs(values[i]))
        columns.append((function(values + step) - function(values - step)) / (2 * step[i]))
    if not columns:
        return np.zeros((len(function(values)),) * 2)
    jacobian = np.column_stack(columns)
    uncertain = sd > 0
    return jacobian @ covariance[np.ix_(uncertain, uncertain)] @ jacobian.T


def _standard_deviations(covariance, count):
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


def _converted(values, given, to_form, used, may_turn):
    """(interior, turn_rad, is_exact)"""
    barred = [i for i, name in enumerate(PARAMETERS) if used is not None and name not in used]
    exact = _by_formula(values, given.form, to_form)
    if exact is not None and not np.any(exact[barred]):
        return exact, 0.0, True
    source = make_framed_camera(values, given.form, given.pixel_mm, given.size_px)
    points = frame_points(given.size_px)
    seen = pixels_to_mm(points, given.pixel_mm, given.size_px)
    names = tuple(used) if used is not None else _usual(values)
    start = _first_values(values, given.form, to_form)
    start[barred] = 0.0
    plain = Form(to_form.convention, to_form.affinity)
    extras = ("turn",) if may_turn else ()
    found = fit(rays_of(source, points), seen, given.pixel_mm, plain, start, names, extras)
    return (
        balanced_about(found.interior, plain, to_form.radial_balance_mm)[0],
        found.turn_rad,
        False,
    )


def _usual(values):
    return USUAL + tuple(name for name, value in zip(PARAMETERS, values, strict=True) if value)


def _first_values(values, form, to_form):
    """(13,) of the plain form, to begin with: right to the first order, nothing of A and B."""
    plain = balanced_about(values, form, 0.0)[0]
    if (CONVENTIONS[form.convention] > 0) != (CONVENTIONS[to_form.convention] > 0):
        plain[list(TURNS_ROUND)] *= -1
    plain[[11, 12]] = 0.0
    return plain


def _by_formula(values, form, to_form):
    """(13,) by formula, or None where there is none."""
    one, other = CONVENTIONS[form.convention], CONVENTIONS[to_form.convention]
    if abs(one) != abs(other):
        return None
    plain = balanced_about(values, form, 0.0)[0]
    if one != other:
        plain[list(TURNS_ROUND)] *= -1
        if form.affinity != "before_distortion":
            plain[11:] *= -1
    plain = _with_affinity(plain, form.affinity, to_form)
    if plain is None:
        return None
    same = Form(to_form.convention, to_form.affinity)
    return balanced_about(plain, same, to_form.radial_balance_mm)[0]


def _with_affinity(plain, affinity, to_form):
    """(13,) with A and B of another affinity, or None where there is no formula."""
    a, b = plain[11:]
    wanted = to_form.affinity
    if affinity == wanted or (a == 0 and b == 0):
        return plain
    if "before_distortion" in (affinity, wanted):
        return None
    if affinity == "both_x":
        if b != 0:
            return None
        affinity = "b1_b2"  # A x is the same in both
        if affinity == wanted:
            return plain
    if wanted == "both_x":
        if affinity == "b1_b2":
            return plain if b == 0 else None
        if a != 0:
            return None
    sign = CONVENTIONS[to_form.convention] or 1.0
    # with the sign of the convention: [1 a; 0 1 + b] of both_y, [1 + a b; 0 1] of b1_b2
    if affinity == "both_y":
        scale = 1 + sign * b
        found = rescale_interior(plain, to_form, scale)
        found[11:] = sign * (1 / scale - 1), a / scale
    else:
        scale = 1 / (1 + sign * a)
        found = rescale_interior(plain, to_form, 1 / scale)
        found[11:] = b * scale, sign * (scale - 1)
    return found


def _turned(rays, turn_rad):
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    return rays @ np.array([[cos, -sin], [sin, cos]])
