"""Least squares that knows no geometry, for many unknowns: Gauss-Markov with block structure.

Rows F(x) - l, whitened; unknowns that occur in blocks of three, no two of them in one row, are
eliminated (Schur complement), the rest is solved densely:

    N = [V  W; W' R],   S = R - W' V^-1 W,   Q_xx = S^-1,   Q_bb = V^-1 + V^-1 W S^-1 W' V^-1

Small problems with conditions between observations go through tankcal.adjust instead.
Source: Brown 1958; Triggs et al. 2000, Bundle adjustment - a modern synthesis, sections 6, 9.
"""

from tankcal.solver.iteration import UndeterminedError, linearise, solve
from tankcal.solver.model import Group, Model

__all__ = ["Group", "Model", "UndeterminedError", "linearise", "solve"]
