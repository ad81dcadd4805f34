"""Frames brought together: one set of points onto another, for start values and diagnoses."""

import numpy as np

MIRRORED_BETTER = 0.3  # a reflection is believed when it leaves less than this share


def plan_fit(points, source, target):
    """Points (n, 3) turned and shifted in plan, shifted in height, as source fits target (k, 3).

    Turned over (a reflection in plan) when that fits far better and three points say so. Returns
    the points and the largest distance that is left.
    """
    return _plan_fit(points, source, target, -1.0 if turned_over(source, target) else 1.0)


def turned_over(source, target):
    """Whether a reflection in plan brings points (k, 3) far better onto others than a turn."""
    if len(source) < 3:
        return False
    straight, over = (_plan_fit(source, source, target, side)[1] for side in (1.0, -1.0))
    return over < MIRRORED_BETTER * straight


def _plan_fit(points, source, target, side):
    flip = np.array([side, 1.0, 1.0])
    middle, goal = (source * flip).mean(axis=0), target.mean(axis=0)
    a, b = source * flip - middle, target - goal
    u, v = a[:, 0] + 1j * a[:, 1], b[:, 0] + 1j * b[:, 1]
    turn = np.sum(np.conj(u) * v)
    turn = turn / abs(turn) if abs(turn) > 0 else 1.0

    def moved(xyz):
        d = xyz * flip - middle
        w = (d[:, 0] + 1j * d[:, 1]) * turn
        return goal + np.column_stack([w.real, w.imag, d[:, 2]])

    return moved(points), float(np.linalg.norm(moved(source) - target, axis=1).max())
