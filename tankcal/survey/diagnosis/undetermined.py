"""Points that cannot be adjusted, and coordinates without observations."""

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import join_with_and, list_some, message
from tankcal.survey.network.assembly import one_ray_sentence
from tankcal.survey.observations import ControlCoordinates

SHOWN = 5  # points in a sentence


def find_left_out(survey):
    """{point: reason} of the points with too few observations."""
    plan, height, rows, rays, measured = _counts(survey)
    held = np.zeros((len(survey.points), 3), dtype=bool) if survey.fixed is None else survey.fixed
    plan_held, height_held = held[:, :2].sum(axis=1), held[:, 2]
    in_plan, in_height = plan > 0, height > 0
    # A point observed in plan needs two values, one observed in height needs one.
    needed = 2 * in_plan + in_height
    have = rows + plan_held * in_plan + height_held * in_height
    # Enough values in total may still lack one of the plan coordinates.
    poor = (have < needed) | (in_plan & (plan + plan_held < 2)) | ~measured
    return {
        survey.points[i]: _why(survey.points[i], rays[i], rows[i], needed[i], measured[i])
        for i in np.flatnonzero(poor)
    }


def _why(name, rays, rows, needed, measured):
    """Reason for leaving out a point."""
    if not measured:
        return unmeasured_sentence(name)
    if rays == 1 and rows == 2:
        return one_ray_sentence(name)
    return message(
        "too_few_observations",
        "point {point} has too few observations: {count} for {needed} coordinates",
        point=name,
        count=rows,
        needed=needed,
    )


def unmeasured_sentence(name):
    """Sentence about a point without measurements."""
    return message("not_measured", "point {point} is not measured", point=name)


def find_untouched_coordinates(survey):
    """Mask (points, 3) of coordinates without observations, and warnings about them."""
    plan, height, _, _, _ = _counts(survey)
    idle = np.column_stack([plan == 0, plan == 0, height == 0])
    warnings = []
    for columns, what in ((slice(0, 2), join_with_and(["x", "y"])), (slice(2, 3), "z")):
        names = [survey.points[i] for i in np.flatnonzero(idle[:, columns].all(axis=1))]
        if names:
            text = message(
                "untouched",
                "{axes} of {points}: not observed by anything; the value given is kept, or 0",
                axes=what,
                points=list_some(names, SHOWN),
            )
            warnings.append(Problem("job.toml", text, None, "adjustment"))
    return idle, warnings


def _counts(survey):
    """Numbers of values for plan, height and all of each point; its rays; whether it is
    measured."""
    n = len(survey.points)
    plan, height, rows = np.zeros((3, n), dtype=int)
    rays, measured = np.zeros(n, dtype=int), np.zeros(n, dtype=bool)
    images = survey.image_points
    if images is not None:
        rays = np.bincount(images.point, minlength=n)
        measured |= rays > 0
        for counter in (plan, height, rows):
            counter += 2 * rays
    for table in survey.observations:
        if isinstance(table, ControlCoordinates):
            _add_control(table, plan, height, rows)
            continue
        if not table.ties:
            continue
        # Repeated readings of one line count once.
        _, lines = np.unique(
            [getattr(table, name) for name in table.ties], axis=1, return_index=True
        )
        for name in table.ties:
            count = table.rows * np.bincount(getattr(table, name)[lines], minlength=n)
            plan += count * (0 in table.axes)
            height += count * (2 in table.axes)
            rows += count
            measured |= (count > 0) & table.of_survey
    return plan, height, rows, rays, measured


def _add_control(control, plan, height, rows):
    """Add control coordinates to the counts."""
    flat = control.axis < 2
    np.add.at(plan, control.point[flat], 1)
    np.add.at(height, control.point[~flat], 1)
    np.add.at(rows, control.point, 1)
