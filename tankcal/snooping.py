"""Data snooping about the smooth form of a shell: what is clutter, and what is a dent.

The radii of the wall are fitted by one radius a course, an axis, and a form of azimuth and height
that has the spectrum of real shells as its prior. Points that deny that form are rejected, the
worst first, and those that agree with it after all come back.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.adjust import Adjustment, adjust
from tankcal.form import harmonics, mode_variances

CRITICAL_W = 3.29  # two-sided, 0.1 % of sound points are rejected (Baarda 1968)
MODES = 24  # highest mode of the form that the snooping allows for
REJECTED = 1e3  # factor on the sd of a rejected point: it is predicted, not fitted
LEAST_NOISE_M = 1e-4  # a sound point is never rejected for less than a third of a millimetre


@dataclass(frozen=True)
class Wall:
    """What the snooping left: mask, axis (x, y, dx/dz, dy/dz), residuals, tests, point noise."""

    wall: np.ndarray
    axis: np.ndarray
    slope_cofactor: np.ndarray
    w: np.ndarray
    residual: np.ndarray
    noise: float
    noise_dof: float


def snoop(local, course, candidates, axis, relative, slope_sd, snooping):
    """Reject the worst points about the smooth form until all are sound; re-admit whom it spares.

    A pass rejects the points within a tenth of the worst and fits anew. When none is left to
    reject, rejected points that agree with the fit after all come back, each once.
    """
    index = np.flatnonzero(candidates)
    xyz, of, relative = local[index], course[index], relative[index]
    accepted, returned = np.ones(len(index), dtype=bool), np.zeros(len(index), dtype=bool)
    state = None
    while True:
        state = _fit_form(xyz, of, axis, relative, slope_sd, accepted, state)
        size = np.abs(state.w)
        worst = accepted & (size > CRITICAL_W)
        sound = ~accepted & ~returned & (size <= CRITICAL_W)
        if snooping and worst.any():
            accepted &= ~(worst & (size >= 0.9 * size[worst].max()))
        elif snooping and sound.any():
            accepted, returned = accepted | sound, returned | sound
        else:
            return _wall_of(state, index, accepted, len(local))


def _wall_of(state, index, accepted, count):
    """The `Wall` of all `count` points from the fit of the candidates `index`."""
    wall, w, residual = np.zeros(count, dtype=bool), np.full(count, np.nan), np.full(count, np.nan)
    wall[index], w[index], residual[index] = accepted, state.w, state.residual
    fit = state.fit
    dof = float(np.sum(fit.redundancy[: len(index)][accepted]))
    return Wall(wall, fit.unknowns[:4], fit.cofactor[2:4, 2:4], w, residual, state.noise, dof)


@dataclass(frozen=True)
class _FormFit:
    """A fit of the form: its components, and residual and test quantity of every candidate."""

    fit: Adjustment
    noise: float
    form: float
    residual: np.ndarray
    w: np.ndarray


def _fit_form(xyz, course, axis, relative, slope_sd, accepted, before):
    """Shell with form, its point noise and form amplitude as two variance components.

    Helmert's simple iteration: each standard deviation is scaled by the root of its group's sum of
    squared normalised residuals over its redundancy (Foerstner 1979). The point noise is kept
    robust: never above 1.4826 times the median residual. Accepted points beyond two standard
    deviations weigh less (Huber 1964), so that clutter does not bend the form.
    """
    noise, form = (before.noise, before.form) if before else (0.005, 0.010)
    residual = before.residual if before else np.zeros(len(xyz))
    axis = before.fit.unknowns[:4] if before else axis
    n = len(xyz)
    for _ in range(3 if before else 10):
        was = noise, form
        doubt = np.maximum(1.0, np.abs(residual) / (2 * noise * relative))
        sd = noise * relative * np.where(accepted, doubt, REJECTED)
        fit = adjust(*shell_problem(xyz, course, axis, sd, form, slope_sd))
        axis, residual = fit.unknowns[:4], fit.residuals[:n]
        noise = _noise(residual[accepted] / relative[accepted], fit.redundancy[:n][accepted])
        form = max(form * _component(fit, slice(n, -2)), 0.1 * noise)
        if np.allclose(was, (noise, form), rtol=0.05):
            break
    return _FormFit(fit, noise, form, residual, _left_out(fit, residual, sd, noise * relative))


def _left_out(fit, residual, sd, noise):
    """(n,) residual of each point from the fit without it, over its standard deviation.

    For a point of full weight this is Baarda's w = v / (s sqrt(r)); for a rejected one it tests
    whether the point agrees with all the others.
    """
    r = np.maximum(fit.redundancy[: len(residual)], 1e-9)
    return (residual / r) / np.sqrt(noise**2 + sd**2 * (1 - r) / r)


def _noise(residual, redundancy):
    """Point noise: root of the squares over the redundancy, at most the normal median's."""
    whole = np.sqrt(np.sum(residual**2) / np.sum(redundancy))
    robust = 1.4826 * np.median(np.abs(residual) / np.sqrt(np.maximum(redundancy, 1e-9)))
    return max(min(whole, robust), LEAST_NOISE_M)


def _component(fit, group):
    redundancy = np.sum(fit.redundancy[group])
    return np.sqrt(np.sum(fit.normalised[group] ** 2) / max(redundancy, 1e-9))


def shell_problem(xyz, course, axis, sd, form, slope_sd):
    """Arguments of `adjust` for radii = R of the course + form(azimuth, height).

    The form is the same at all heights but for a part that grows linearly with height; its modes
    and the slope are unknowns with a prior (an observation of zero). Without `form` the shell is
    round. sd (n,) of the radii.
    """
    courses, row_of = np.unique(course, return_inverse=True)
    n, modes = len(xyz), 0 if form is None else 2 * (MODES - 1)
    first_mode = 4 + len(courses)
    height = xyz[:, 2] / max(np.abs(xyz[:, 2]).max(), 1e-9)
    by_radius = np.zeros((n, len(courses)))
    by_radius[np.arange(n), row_of] = -1.0
    priors = np.zeros((2 * modes + 2, first_mode + 2 * modes))
    priors[: 2 * modes, first_mode:] = np.eye(2 * modes)
    priors[2 * modes :, 2:4] = np.eye(2)

    def model(x, observations):
        offset, distance = from_axis(xyz, x[:4])
        azimuth = np.arctan2(offset[:, 0], offset[:, 1])
        sin, cos = offset[:, 0] / distance, offset[:, 1] / distance
        form_now, turn = np.zeros(n), np.zeros(n)
        by_form = np.zeros((n, 2 * modes))
        if modes:
            waves = harmonics(azimuth, MODES)[:, 3:]
            by_form = np.hstack([waves, waves * height[:, None]])
            slopes = harmonics(azimuth, MODES, derivative=1)[:, 3:]
            form_now = by_form @ x[first_mode:]
            turn = np.hstack([slopes, slopes * height[:, None]]) @ x[first_mode:] / distance
        by_xy = -np.column_stack([sin - turn * cos, cos + turn * sin])
        by_axis = np.hstack([by_xy, by_xy * xyz[:, 2:]])
        top = np.hstack([by_axis, by_radius, -by_form])
        misclosure = distance - x[4:first_mode][row_of] - form_now
        modelled = np.concatenate([misclosure, x[first_mode:], x[2:4]])
        return modelled - observations, np.vstack([top, priors]), None

    distance = from_axis(xyz, axis)[1]
    radii = [np.median(distance[row_of == i]) for i in range(len(courses))]
    start = np.concatenate([axis, radii, np.zeros(2 * modes)])
    prior = form**2 * mode_variances(MODES) if modes else np.zeros(0)
    variances = np.concatenate([sd**2, prior, prior, np.full(2, slope_sd**2)])
    return model, start, np.zeros(len(variances)), variances


def from_axis(local, axis):
    """Horizontal offsets (n, 2) and distances (n,) from the axis at each point's own height."""
    offset = local[:, :2] - axis[:2] - local[:, 2:] * axis[2:4]
    return offset, np.hypot(offset[:, 0], offset[:, 1])
