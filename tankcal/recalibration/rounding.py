"""Uncertainty by rounding of the quantities estimated from a table.

As independent errors of q / sqrt(12), q the last digit, rounding gives the covariance of the
adjustment. But rounding errors of successive rows are correlated: in a ring of 1630.0448 L/cm, the
errors grow by 0.0448 L per row and fall back every 22 rows. The table is therefore rounded again at
many offsets of its last digit, with the steps of possible tanks. The effect on the unknowns is a
second estimate; the larger estimate is used.
"""

import numpy as np

ROUGH = 1.15  # largest rms residual over rms rounding error of rows without other errors
DRAWS, SEED = 150, 21  # number of simulated roundings, and seed


def row_sds(former):
    """Standard deviations (rows,) of a table's volumes by its last digits, m3.

    Dips with even steps are exact; other dips contribute their own rounding.
    """
    dips, volumes = former.height_m, former.volume_m3
    finest = 1e-7 + 1e-12 * float(np.abs(volumes).max())
    sd = max(former.volume_quantum_m3, finest) / np.sqrt(12)
    if former.height_rounding_m is None:
        return np.full(len(dips), sd)
    return np.hypot(sd, np.gradient(volumes, dips) * former.height_rounding_m / np.sqrt(3))


def simulate_rounding(solution, rows, quantum_m3, draws=DRAWS):
    """Rounding errors of tanks compatible with a Fit, m3.

    Parameters
    ----------
    solution : Fit
    rows : Rows
    quantum_m3 : float
        Value of the last printed digit.
    draws : int, optional

    Returns
    -------
    (draws, rows) ndarray
    """
    sds = np.sqrt(np.diag(solution.cofactor))
    random = np.random.default_rng(SEED)
    safe = np.where(sds > 0, sds, 1.0)
    # Root of the covariance through the correlation matrix, which is better conditioned.
    values, vectors = np.linalg.eigh(solution.cofactor / np.outer(safe, safe))
    roots = vectors * np.sqrt(np.maximum(values, 0)) * safe[:, None]
    moves = random.normal(size=(draws, len(sds))) @ (solution.design @ roots).T
    # A common offset of all rows gives other rounding errors of an equally likely table.
    shifts = random.uniform(0, 1, (draws, 1))
    places = (solution.state.volume_m3(rows.dip_m) + moves) / quantum_m3 + shifts
    return (np.round(places) - places) * quantum_m3


def u_factors(solution, rows, quantum_m3):
    """Factors (u,) of the standard deviations of the unknowns of a Fit, 1 or more.

    Parameters
    ----------
    solution : Fit
    rows : Rows
    quantum_m3 : float
        Value of the last printed digit; 0: not rounded.
    """
    return np.maximum(_simulated_factors(solution, rows, quantum_m3), roughness(solution, rows))


def _simulated_factors(solution, rows, quantum):
    sds = np.sqrt(np.diag(solution.cofactor))
    if quantum <= 0 or solution.dof <= 0:
        return np.ones(len(sds))
    # Errors of the unknowns by errors of the rows: Q A' P.
    gain = solution.cofactor @ (solution.design / rows.sd_m3[:, None] ** 2).T
    errors = simulate_rounding(solution, rows, quantum) @ gain.T
    moved = np.sqrt(np.mean(errors**2, axis=0))
    return np.maximum(moved / np.where(sds > 0, sds, np.inf), 1.0)


def roughness(solution, rows):
    """Factor of u: 1, or more if the residuals exceed the rounding errors.

    Correlated residuals count as fewer rows: a correlation c of neighbours gives the factor
    sqrt((1 + c) / (1 - c)).
    """
    left = solution.left_m3 / rows.sd_m3
    size = np.sqrt(solution.chi2 / solution.dof) if solution.dof > 0 else 1.0
    if size < ROUGH:
        return 1.0
    # lag-one autocorrelation of the residuals
    c = np.clip(left[1:] @ left[:-1] / (left @ left), 0.0, 0.99)
    return float(size * np.sqrt((1 + c) / (1 - c)))
