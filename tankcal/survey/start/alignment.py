"""A free piece turned, shifted and stretched onto the little that is known of its frame.

Three coordinates of one point, a height of another, plumb lines, levelled differences, azimuths,
single elements of a photo: too little for a similarity by points, enough for a start. The seven
parameters are found by damped least squares from 24 starts, the rotations of a cube; what nothing
determines stays as it is.
"""

from itertools import permutations, product

import numpy as np

from tankcal.geometry.rotations import apply_small_rotation
from tankcal.survey.observations import HeightDifferences
from tankcal.survey.start.pieces import Motion

STEPS = 30
FAR = 5.0  # largest step of the logarithm of the scale


def align_piece(survey, piece, known, place_m):
    """The Motion that brings a piece onto known coordinates and observed verticals and azimuths.

    known    (points, 3) coordinates of the frame, nan where not known
    place_m  (photos, 3) projection centres, nan where not known
    """
    places = np.vstack([piece.xyz_m, piece.place_m])
    count = np.isfinite(places).sum(axis=0)
    middle = np.nansum(places, axis=0) / np.maximum(count, 1)
    clues = _Clues(survey, piece, known, place_m)
    if not len(clues.misfits(np.eye(3), np.zeros(3), 1.0)):
        return Motion(np.eye(3), np.zeros(3), 1.0, 0.0)
    best = None
    for rotation in _cube():
        shift = clues.middle - rotation @ middle
        found = _settled(clues, rotation, shift)
        if best is None or found.misfit_m < best.misfit_m * (1 - 1e-6):
            best = found
    return best


def _cube():
    """The 24 rotations (3, 3) that turn a cube into itself, the identity first."""
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            rotation = np.eye(3)[list(order)] * np.array(signs)[:, None]
            if np.linalg.det(rotation) > 0:
                yield rotation


class _Clues:
    """What is known of the frame, as misfits in metres of a piece that is moved."""

    def __init__(self, survey, piece, known, place_m):
        points = piece.known[:, None] & np.isfinite(known)
        photos = piece.oriented[:, None] & np.isfinite(place_m)
        self.places = np.vstack([piece.xyz_m, piece.place_m])
        self.told = np.vstack([known, place_m])
        self.size = max(piece.extent, 1e-9)
        self.which = np.nonzero(np.vstack([points, photos]))
        self.others = [_between(one, piece.known) for one in survey.observations
                       if one.knows_frame]  # fmt: skip
        told = np.where(np.vstack([points, photos]), self.told, np.nan)
        counts = np.isfinite(told).sum(axis=0)
        levelled = any(isinstance(one, HeightDifferences) and len(one) for one in self.others)
        self.metres = levelled or np.isfinite(told).any(axis=1).sum() > 1
        self.middle = np.where(counts, np.nansum(told, axis=0) / np.maximum(counts, 1), 0.0)

    def misfits(self, rotation, shift, scale):
        xyz = scale * self.places @ rotation.T + shift
        found = [(xyz - self.told)[self.which]]
        for one in self.others:
            found += one.off_frame(xyz[one.end] - xyz[one.start])
        return np.concatenate(found)


def _between(one, known):
    return one.taken(one.in_use & known[one.start] & known[one.end])


def _settled(clues, rotation, shift):
    """The Motion after damped steps from one start."""
    scale, damping = 1.0, 1e-3
    misfits = clues.misfits(rotation, shift, scale)
    size = clues.size
    tiny = 1e-6
    for _ in range(STEPS):
        jac = np.empty((len(misfits), 7))
        for k in range(7):
            moved = _stepped(rotation, shift, scale, tiny * np.eye(7)[k], size)
            jac[:, k] = (clues.misfits(*moved) - misfits) / tiny
        if not clues.metres:  # else plumb lines would be best in a piece of no size
            jac[:, 6] = 0.0
        normal = jac.T @ jac
        ridge = damping * np.eye(7) * max(float(normal.diagonal().max()), 1e-30)
        step = -np.linalg.solve(normal + ridge, jac.T @ misfits)
        moved = _stepped(rotation, shift, scale, step, size)
        found = clues.misfits(*moved)
        if found @ found < misfits @ misfits:
            (rotation, shift, scale), misfits = moved, found
            damping = max(damping / 10, 1e-9)
            if np.abs(step).max() < 1e-10:
                break
        else:
            damping *= 10
    return Motion(rotation, shift, scale, float(np.sqrt(misfits @ misfits)))


def _stepped(rotation, shift, scale, step, size):
    turn = apply_small_rotation(rotation[None], step[None, :3])[0]
    return turn, shift + size * step[3:6], scale * np.exp(np.clip(step[6], -FAR, FAR))
