"""Image points corrected for the depth of their objects: an outer iteration of the adjustment.

Adjust; from the adjusted points and photos follows the depth of each image point, from it the
distortion there (tankcal.camera.focus); the image points as they would be in focus are adjusted
again, until the correction no longer changes.
"""

from dataclasses import replace

import numpy as np

from tankcal.camera.focus import refer_to_focus
from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.survey.results import DepthOfField

CLOSE_MM = 1e-6  # change of a correction that is none
MOST_ROUNDS = 20
NEAREST = 2.0  # focal lengths: an object nearer than that has no image


def adjust_in_depth(measurements, adjust, progress):
    """(what `adjust` gave, the Measurements that it was given, DepthOfField or None).

    adjust  adjust(measurements, like) -> (Searched, ...); like: network.Adjusted close to it, None

    Only with settings.depth_of_field, and for cameras with a lens. Raises SolutionError when the
    corrections do not settle.
    """
    found = adjust(measurements, None)
    lenses = {one.camera.name: one for one in measurements.cameras if one.lens is not None}
    if not (measurements.settings.depth_of_field and lenses and measurements.image_points):
        return found, measurements, None
    given, now = measurements.image_points, measurements
    for rounds in range(1, MOST_ROUNDS + 1):
        corrected, left = _corrected(given, found[0].adjusted, lenses)
        change = float(np.abs(corrected - now.image_points.xy_mm).max(initial=0.0))
        if change < CLOSE_MM:
            size = corrected - given.xy_mm
            largest, rms = np.abs(size).max(initial=0.0), np.sqrt(np.mean(size**2))
            return found, now, DepthOfField(rounds, change, float(largest), float(rms), left)
        progress(
            message(
                "focusing",
                "correcting image points for their depth: round {rounds}, {change:.3g} um",
                rounds=rounds,
                change=1000.0 * change,
            )
        )
        now = replace(measurements, image_points=replace(given, xy_mm=corrected))
        found = adjust(now, found[0].adjusted)
    raise SolutionError(
        message(
            "focus_unsteady",
            "the corrections for the depth of field still change by {change:.3g} um after "
            "{rounds} adjustments: adjustment.depth_of_field",
            change=1000.0 * change,
            rounds=MOST_ROUNDS,
        )
    )


def _corrected(images, adjusted, lenses):
    """Image points (n, 2) in focus, and the number of those that have no depth to speak of."""
    survey, problem, state = adjusted.survey, adjusted.problem, adjusted.solution.unknowns
    points = {name: i for i, name in enumerate(survey.points)}
    photos = {name: i for i, name in enumerate(survey.photos.names)}
    point = np.array([points.get(name, -1) for name in images.point], dtype=int)
    photo = np.array([photos.get(name, -1) for name in images.photo], dtype=int)
    centre = problem.centre_m + state.photo_xyz_m
    away = adjusted.xyz_m[point] - centre[photo]
    depth = -1000 * np.einsum("nk,nk->n", state.rotation[photo, 2], away)
    depth[(point < 0) | (photo < 0)] = np.nan
    found, left = images.xy_mm.copy(), 0
    camera = np.array([one.name for one in survey.cameras], dtype=object)[survey.photos.camera]
    for name, setup in lenses.items():
        mine = np.flatnonzero((camera[photo] == name) & np.isfinite(depth))
        near = depth[mine] <= NEAREST * setup.lens.focal_length_mm
        left, mine = left + int(near.sum()), mine[~near]
        interior = state.interior[problem.interior_of[photo[mine]]]
        found[mine] = refer_to_focus(
            images.xy_mm[mine], depth[mine], interior, setup.camera.form, setup.lens
        )
    return found, left
