"""The amplitudes of a shell's form, by the restricted likelihood of its measured radii.

Source: Patterson & Thompson 1971 (restricted maximum likelihood).
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.optimize

from tankcal.errors import SolutionError
from tankcal.geometry.form import Form, free_columns, unit_form, whiten
from tankcal.messages import message

LEAST_FORM_M2, MOST_FORM_M2 = 1e-12, 1.0
LEAST_NOISE_M = 1e-6  # what is given as perfect is not quite
MOST_FOLLOWED = 70  # directions of the common form that are followed through all courses
LEAST_RISE = 0.5  # of half a course, between points that tell of a rising form
LOG_STEP = 0.3  # of the differences that give the curvature of the likelihood


def estimate_form(samples, noise=1.0):
    """Amplitudes of a shell's form by restricted maximum likelihood (Patterson & Thompson 1971).

    The likelihood is that of radii with free radius and centre (and taper, lean, barrel where a
    sample's degree has them) and random modes k >= 2 of variance amplitude k^-3. With one course
    its own form cannot be told from the common one and is zero; without points at two heights of a
    course so is the rising form. The noise is never estimated here: in one section it cannot be
    told from the form.

    Parameters
    ----------
    samples : sequence of Sample
        One for every section.
    noise : float, optional
        Factor of their covariances.

    Returns
    -------
    Form
    """
    names = sorted({sample.course for sample in samples})
    courses = [[sample for sample in samples if sample.course == name] for name in names]
    evidence = _evidence(courses, noise)
    amplitudes = _most_likely(evidence, np.array([True, len(names) > 1, _rises(courses)]))
    dof = _degrees_of_freedom(evidence, amplitudes, len(names))
    return Form(*map(float, amplitudes), *map(float, dof), *_contrasts(evidence))


def _rises(courses):
    """Whether points at two heights of one course tell how the form changes between them."""
    return any(
        np.ptp(np.concatenate([sample.zeta for sample in samples])) > LEAST_RISE
        and (len(samples) > 1 or samples[0].degree > 0)
        for samples in courses
    )


@dataclass(frozen=True)
class _Evidence:
    """What the courses tell, whitened: (courses, n, ...), short courses filled up with zeros.

    columns  free columns, the directions of a common form of amplitude one that are followed
             through all courses, and last the radii
    free     number of the free columns; filled (courses, free) one where a course has fewer
    counts   (courses,) radii less free columns
    level    covariance of the radii by a form of amplitude one; finer: by the directions that are
             not followed; rising: by a rising form of amplitude one
    """

    columns: np.ndarray
    free: int
    filled: np.ndarray
    level: np.ndarray
    finer: np.ndarray
    rising: np.ndarray
    counts: np.ndarray


def _evidence(courses, noise):
    """`_Evidence` of a list of courses, each a list of samples."""
    stacked = [_whitened_course(samples, noise) for samples in courses]
    waves = np.vstack([waves for _, _, waves, _ in stacked])
    _, strength, directions = np.linalg.svd(waves, full_matrices=False)
    strongest = directions[:MOST_FOLLOWED][strength[:MOST_FOLLOWED] > 1e-6 * strength[0]].T
    condensed = [_condensed(*one, strongest) for one in stacked]
    rows = max(len(radii) for radii, *_ in condensed)
    free = max(one.shape[1] for _, one, *_ in condensed)
    counts = np.array([one.shape[1] for _, one, *_ in condensed])

    def filled(arrays, columns):
        return np.array([np.pad(a, _missing(a.shape, (rows, columns))) for a in arrays])

    radii, frees, followed, finer, rising = zip(*condensed, strict=True)
    columns = [
        filled(frees, free),
        filled(followed, strongest.shape[1]),
        filled([radius[:, None] for radius in radii], 1),
    ]
    finer = _gram(filled(finer, waves.shape[1]))
    return _Evidence(
        columns=np.concatenate(columns, axis=2),
        free=free,
        filled=(np.arange(free) >= counts[:, None]).astype(float),
        level=_gram(columns[1]) + finer,
        finer=finer,
        rising=_gram(filled(rising, MOST_FOLLOWED)),
        counts=np.array([len(one) for one in radii]) - counts,
    )


def _missing(shape, wanted):
    return [(0, want - have) for have, want in zip(shape, wanted, strict=True)]


def _gram(stack):
    return stack @ stack.transpose(0, 2, 1)


def _whitened_course(samples, noise):
    """Radii, free columns, waves and rising waves of all samples of a course."""
    free, rest = [], []
    for s in samples:
        covariance = _floored(noise * s.covariance_m2)
        waves = unit_form(s.azimuth_rad)
        columns = [(s.radius_m - s.radius_m.mean())[:, None], waves]
        columns.append(waves[:, :MOST_FOLLOWED] * s.zeta[:, None])
        free.append(whiten(_determined(s), covariance))
        rest.append(whiten(np.hstack(columns), covariance))
    radii, waves, rising = np.split(np.vstack(rest), [1, 1 + waves.shape[1]], axis=1)
    return radii[:, 0], scipy.linalg.block_diag(*free), waves, rising


def _determined(sample):
    columns = free_columns(sample.azimuth_rad, sample.zeta, sample.degree)
    if np.linalg.matrix_rank(columns) < columns.shape[1]:
        raise SolutionError(
            message(
                "spectrum_undetermined",
                "the points of a section do not determine its centre and radius",
            )
        )
    return columns


def _floored(covariance):
    floor = LEAST_NOISE_M**2
    return covariance + floor * (1.0 if np.ndim(covariance) == 1 else np.eye(len(covariance)))


def _condensed(radii, free, waves, rising, strongest):
    """What tells of the form: with more points than columns the rest tells of the noise alone."""
    followed = waves @ strongest
    finer = waves - followed @ strongest.T
    arrays = radii, free, followed, finer, rising
    explained = np.hstack([free, followed, rising])
    if len(radii) <= explained.shape[1]:
        return arrays
    turned = np.linalg.qr(explained)[0].T
    return tuple(turned @ array for array in arrays)


def _misfit(evidence, amplitudes):
    """Doubled negative log-likelihood but for a constant, and its derivative by the amplitudes.

    Each course with its own form marginalised, then the common one, through which alone the courses
    know of each other. Of the common form the 70 directions that the points see best are followed
    through all courses (all there are where the courses share their azimuths), the others are taken
    as each course's own. By an amplitude A of covariance K: tr(P K) - y' P K P y.
    """
    common, own, rising = amplitudes
    free = evidence.free
    covariance = own * evidence.level + common * evidence.finer + rising * evidence.rising
    covariance += np.eye(covariance.shape[1])
    inverse = np.linalg.inv(covariance)
    solved = inverse @ evidence.columns
    moments = evidence.columns.transpose(0, 2, 1) @ solved
    normal = moments[:, :free, :free] + evidence.filled[:, :, None] * np.eye(free)
    reduction = np.linalg.solve(normal, solved[:, :, :free].transpose(0, 2, 1))
    projector = inverse - solved[:, :, :free] @ reduction
    rest = projector @ evidence.columns[:, :, free:]
    joint = np.sum(evidence.columns[:, :, free:].transpose(0, 2, 1) @ rest, axis=0)
    inner = common * joint[:-1, :-1] + np.eye(len(joint) - 1)
    spread = np.linalg.inv(inner)
    pull = spread @ joint[:-1, -1]
    value = joint[-1, -1] - common * joint[:-1, -1] @ pull
    value += sum(np.linalg.slogdet(one)[1].sum() for one in (covariance, normal, inner))
    waves = rest[:, :, :-1]
    left = rest[:, :, -1] - common * waves @ pull  # P y
    whole = projector - common * waves @ spread @ waves.transpose(0, 2, 1)  # blocks of P
    outer = left[:, :, None] * left[:, None, :]

    def slope(kernel):
        return np.sum((whole - outer) * kernel)

    by_followed = np.sum(spread * joint[:-1, :-1]) - pull @ pull
    slopes = [by_followed + slope(evidence.finer), slope(evidence.level), slope(evidence.rising)]
    return value, np.array(slopes)


def _most_likely(evidence, sought):
    """(3,) amplitudes at the minimum of the misfit: a coarse grid, then down the slope."""

    def misfit(logs):
        amplitudes = np.zeros(3)
        amplitudes[sought] = np.exp(logs)
        value, slopes = _misfit(evidence, amplitudes)
        return value, (amplitudes * slopes)[sought]

    lowest, highest = np.log(LEAST_FORM_M2), np.log(MOST_FORM_M2)
    share = np.array([0.5, 0.5, 0.1])[sought]
    starts = [level + np.log(share) for level in np.arange(lowest + 3.0, highest, 3.0)]
    start = min(starts, key=lambda logs: misfit(logs)[0])
    bounds = [(lowest, highest)] * len(start)
    options = {"ftol": 1e-6}
    best = scipy.optimize.minimize(
        misfit, start, method="L-BFGS-B", jac=True, bounds=bounds, options=options
    ).x
    amplitudes = np.zeros(3)
    amplitudes[sought] = np.exp(best)
    return amplitudes


def _degrees_of_freedom(evidence, amplitudes, courses):
    """Degrees of freedom of the common and of the own form, one at least.

    2 A^2 / var(A) of an amplitude A is the curvature of -2 log L by log A. For the common form A is
    the variance of the mean of the courses, common + own / courses: that is what they tell
    independently of the own form, and it stays well determined where the common form is near zero.
    """
    found = []
    for index, size in ((0, amplitudes[0] + amplitudes[1] / courses), (1, amplitudes[1])):
        slopes = []
        for factor in np.exp([-LOG_STEP, LOG_STEP]):
            moved = amplitudes.copy()
            moved[index] += (factor - 1) * size
            slopes.append(factor * size * _misfit(evidence, moved)[1][index])
        found.append(max((slopes[1] - slopes[0]) / (2 * LOG_STEP), 1.0))
    return found


def _contrasts(evidence):
    """Residuals that tell of the common form, one set of them, and of the own form, the others."""
    common = float(evidence.counts.max())
    return common, max(float(evidence.counts.sum()) - common, 1.0)
