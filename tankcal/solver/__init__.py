"""Least squares without geometry, for many unknowns: Gauss-Markov model with blocks.

The rows are F(x) - l, whitened. Some unknowns form blocks of three, and no row depends on two
blocks. These blocks are eliminated (Schur complement), and the remaining system is solved as a
dense system:

    N = [V  W; W' R],   S = R - W' V^-1 W,   Q_xx = S^-1,   Q_bb = V^-1 + V^-1 W S^-1 W' V^-1

Small problems with conditions between observations are solved by tankcal.adjust.

Source: Brown 1958; Triggs et al. 2000, Bundle adjustment - a modern synthesis, sections 6, 9.
"""

from tankcal.solver.iteration import UndeterminedError, linearise, solve
from tankcal.solver.model import Group, Model

__all__ = ["Group", "Model", "UndeterminedError", "linearise", "solve"]
