"""Alignment of a free piece to partial knowledge of its frame, by a similarity transformation.

Three coordinates of one point, a height of another, plumb lines, levelled differences, azimuths or
single elements of a photo are too few for a similarity by points, but enough for a start. Damped
least squares estimates the seven parameters from 24 starts, the rotations of a cube. Undetermined
parameters keep their start values.
"""

from dataclasses import replace
from itertools import permutations, product

import numpy as np

from tankcal.adjust import Damping, gauss_newton
from tankcal.geometry.rotations import apply_small_rotation
from tankcal.survey.observations import HeightDifferences
from tankcal.survey.start.pieces import Motion

STEPS = 30
FAR = 5.0  # largest step of the logarithm of the scale


def align_piece(survey, piece, known, place_m):
    """Fit a piece to known coordinates and observed verticals and azimuths.

    Parameters
    ----------
    survey : network.Survey
    piece : Piece
    known : ndarray, shape (points, 3)
        Known coordinates; nan: unknown.
    place_m : ndarray, shape (photos, 3)
        Projection centres; nan: unknown.

    Returns
    -------
    Motion
    """
    places = np.vstack([piece.xyz_m, piece.place_m])
    count = np.isfinite(places).sum(axis=0)
    middle = np.nansum(places, axis=0) / np.maximum(count, 1)
    clues = _Clues(survey, piece, known, place_m)
    at_rest = Motion(np.eye(3), np.zeros(3), 1.0, 0.0)
    if not len(clues.misfits(at_rest)):
        return at_rest
    best = None
    for rotation in _cube():
        motion = _fit_from(clues, rotation, clues.middle - rotation @ middle)
        # The margin keeps the first of equal solutions, whatever the rounding.
        if best is None or motion.misfit_m < best.misfit_m * (1 - 1e-6):
            best = motion
    return best


def _cube():
    """Yield the 24 rotations (3, 3) that map a cube onto itself, the identity first."""
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            rotation = np.eye(3)[list(order)] * np.array(signs)[:, None]
            if np.linalg.det(rotation) > 0:
                yield rotation


class _Clues:
    """Known data of the frame, as misfits in metres of a transformed piece."""

    def __init__(self, survey, piece, known_m, place_m):
        points = piece.known[:, None] & np.isfinite(known_m)
        photos = piece.oriented[:, None] & np.isfinite(place_m)
        self.places = np.vstack([piece.xyz_m, piece.place_m])
        self.known_m = np.vstack([known_m, place_m])
        self.size = max(piece.extent, 1e-9)
        self.which = np.nonzero(np.vstack([points, photos]))
        self.others = [_between(item, piece.known) for item in survey.observations
                       if item.knows_frame]  # fmt: skip
        target = np.where(np.vstack([points, photos]), self.known_m, np.nan)
        counts = np.isfinite(target).sum(axis=0)
        levelled = any(isinstance(item, HeightDifferences) and len(item) for item in self.others)
        self.metres = levelled or np.isfinite(target).any(axis=1).sum() > 1
        self.middle = np.where(counts, np.nansum(target, axis=0) / np.maximum(counts, 1), 0.0)

    def misfits(self, motion):
        """Misfits (n,) in metres of the transformed piece."""
        xyz = motion.of(self.places)
        parts = [(xyz - self.known_m)[self.which]]
        for item in self.others:
            parts += item.off_frame(xyz[item.end] - xyz[item.start])
        return np.concatenate(parts)


def _between(observations, known):
    """Rows of an observation between known points."""
    return observations.taken(
        observations.in_use & known[observations.start] & known[observations.end]
    )


def _fit_from(clues, rotation, shift_m):
    """Fit a Motion by damped least squares from one start."""
    tiny, size = 1e-6, clues.size

    def step_at(motion, damping):
        misfits = clues.misfits(motion)
        # Seven parameters: numerical derivatives are accurate enough for a start value.
        jac = np.empty((len(misfits), 7))
        for k in range(7):
            moved = _move(motion, tiny * np.eye(7)[k], size)
            jac[:, k] = (clues.misfits(moved) - misfits) / tiny
        # Without a length, plumb lines would fit best at scale zero, so the scale is held.
        if not clues.metres:
            jac[:, 6] = 0.0
        normal = jac.T @ jac
        ridge = damping * np.eye(7) * max(float(normal.diagonal().max()), 1e-30)
        return -np.linalg.solve(normal + ridge, jac.T @ misfits)

    def square(motion):
        misfits = clues.misfits(motion)
        return misfits @ misfits

    motion = gauss_newton(
        step_at,
        Motion(rotation, shift_m, 1.0, 0.0),
        move=lambda motion, step: _move(motion, step, size),
        is_better=lambda candidate, motion: square(candidate) < square(motion),
        is_small=lambda step: np.abs(step).max() < 1e-10,
        most_steps=STEPS,
        damping=Damping(relax=10.0),
    )
    return replace(motion, misfit_m=float(np.sqrt(square(motion))))


def _move(motion, step, size):
    """Motion after a step (7,): rotation, shift over `size`, logarithm of the scale."""
    return Motion(
        apply_small_rotation(motion.rotation[None], step[None, :3])[0],
        motion.shift_m + size * step[3:6],
        motion.scale * np.exp(np.clip(step[6], -FAR, FAR)),
        motion.misfit_m,
    )
