"""A second method: least squares with dense matrices and derivatives by differences."""

import numpy as np


def jacobian(misclosures, unknowns, steps):
    """(rows, k) derivatives by central differences of the fourth order."""
    columns = []
    for number, step in enumerate(steps):
        d = np.zeros(len(unknowns))
        d[number] = step
        one = misclosures(unknowns + d) - misclosures(unknowns - d)
        two = misclosures(unknowns + 2 * d) - misclosures(unknowns - 2 * d)
        columns.append((8 * one - two) / (12 * step))
    return np.column_stack(columns)


def solved(misclosures, start, sizes, steps=1e-2, rounds=20):
    """Least squares of whitened misclosures: unknowns, cofactors (k, k), sum of squares.

    sizes  (k,) about a standard deviation of each unknown
    steps  of the differences, in sizes

    Gauss and Newton: as many rounds as it takes until nothing moves by 1e-5 of its size.
    """
    sizes, unknowns = np.asarray(sizes, dtype=float), np.array(start, dtype=float)
    for _ in range(rounds):
        jac = jacobian(misclosures, unknowns, steps * sizes) * sizes
        move = np.linalg.lstsq(jac, -misclosures(unknowns), rcond=1e-14)[0]
        unknowns = unknowns + sizes * move
        if np.abs(move).max() < 1e-5:
            break
    else:
        raise AssertionError("the second method did not converge")
    jac = jacobian(misclosures, unknowns, steps * sizes) * sizes
    root = np.linalg.pinv(jac, rcond=1e-9)
    cofactors = sizes[:, None] * (root @ root.T) * sizes
    return unknowns, cofactors, float(np.sum(misclosures(unknowns) ** 2))
