"""Correction of image points for the depth of their objects: an outer iteration of the adjustment.

Adjusted points and photos give the depth of each image point, and the depth gives the distortion
there (tankcal.camera.focus). The image points are corrected to the plane of focus and adjusted
again until the correction no longer changes.
"""

from dataclasses import replace

import numpy as np

from tankcal.camera.focus import refer_to_focus
from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.survey.results import DepthOfField

CLOSE_MM = 1e-6  # change of the correction regarded as none
MOST_ROUNDS = 20  # adjustments before the iteration is abandoned
NEAREST = 2.0  # focal lengths: an object nearer than that has no image


def adjust_in_depth(measurements, adjust, progress):
    """Adjust a survey with image points corrected for depth.

    The correction requires settings.depth_of_field and a camera with a lens.

    Parameters
    ----------
    measurements : Measurements
    adjust : callable
        adjust(measurements, like) returns (SearchResult, ...); like is a similar network.Adjusted
        or None.
    progress : callable
        progress(text) is called before each round.

    Returns
    -------
    tuple
        Result of `adjust`, the corrected Measurements, and DepthOfField or None.

    Raises
    ------
    SolutionError
        If the corrections do not converge.
    """
    result = adjust(measurements, None)
    lenses = {setup.camera.name: setup for setup in measurements.cameras if setup.lens is not None}
    if not (measurements.settings.depth_of_field and lenses and measurements.image_points):
        return result, measurements, None
    original, current = measurements.image_points, measurements
    for rounds in range(1, MOST_ROUNDS + 1):
        # Always correct the original readings: correcting corrected ones would accumulate.
        corrected, left = _correct_for_depth(original, result[0].adjusted, lenses)
        change = float(np.abs(corrected - current.image_points.xy_mm).max(initial=0.0))
        if change < CLOSE_MM:
            size = corrected - original.xy_mm
            largest, rms = np.abs(size).max(initial=0.0), np.sqrt(np.mean(size**2))
            return result, current, DepthOfField(rounds, change, float(largest), float(rms), left)
        progress(
            message(
                "focusing",
                "correcting image points for their depth: round {rounds}, {change:.3g} um",
                rounds=rounds,
                change=1000.0 * change,
            )
        )
        current = replace(measurements, image_points=replace(original, xy_mm=corrected))
        result = adjust(current, result[0].adjusted)
    raise SolutionError(
        message(
            "focus_unsteady",
            "the corrections for the depth of field still change by {change:.3g} um after "
            "{rounds} adjustments: adjustment.depth_of_field",
            change=1000.0 * change,
            rounds=MOST_ROUNDS,
        )
    )


def _correct_for_depth(images, adjusted, lenses):
    """Return image points (n, 2) in focus, and the number of points without a usable depth."""
    survey, problem, state = adjusted.survey, adjusted.problem, adjusted.solution.unknowns
    points = {name: i for i, name in enumerate(survey.points)}
    photos = {name: i for i, name in enumerate(survey.photos.names)}
    point = np.array([points.get(name, -1) for name in images.point], dtype=int)
    photo = np.array([photos.get(name, -1) for name in images.photo], dtype=int)
    centre = problem.centre_m + state.photo_xyz_m
    away = adjusted.xyz_m[point] - centre[photo]
    # Depth along the optical axis (third row of the rotation), in mm; the camera looks towards -z.
    depth = -1000 * np.einsum("nk,nk->n", state.rotation[photo, 2], away)
    depth[(point < 0) | (photo < 0)] = np.nan
    corrected, left = images.xy_mm.copy(), 0
    camera = np.array([camera_of_survey.name for camera_of_survey in survey.cameras], dtype=object)[
        survey.photos.camera
    ]
    for name, setup in lenses.items():
        indices = np.flatnonzero((camera[photo] == name) & np.isfinite(depth))
        # An object nearer than two focal lengths has no sharp image, so the correction is
        # undefined.
        near = depth[indices] <= NEAREST * setup.lens.focal_length_mm
        left, indices = left + int(near.sum()), indices[~near]
        interior = state.interior[problem.interior_of[photo[indices]]]
        corrected[indices] = refer_to_focus(
            images.xy_mm[indices], depth[indices], interior, setup.camera.form, setup.lens
        )
    return corrected, left
