"""What the rounding of a table leaves uncertain of what is read out of it.

As independent errors of q / sqrt(12), q the last digit, it is the covariance of the adjustment.
But rounding is not independent from row to row: a ring of 1630.0448 L/cm has errors that climb by
0.0448 L a row and fall back every 22 rows. So the table is rounded again at many places of its last
digit, with the steps of tanks that it leaves possible, and what that does to the unknowns is the
other measure; the larger one counts.
"""

import numpy as np

ROUGH = 1.15  # rms over what rounding leaves: above it, rows have more in them than rounding
DRAWS, SEED = 150, 21


def sd_of_rows(former):
    """(rows,) standard deviations of a table's volumes by its last digits.

    Dips of an even step are what the table was made for; others were rounded, too.
    """
    dips, volumes = former.height_m, former.volume_m3
    finest = 1e-7 + 1e-12 * float(np.abs(volumes).max())
    own = max(former.volume_quantum_m3, finest) / np.sqrt(12)
    if former.height_rounding_m is None:
        return np.full(len(dips), own)
    return np.hypot(own, np.gradient(volumes, dips) * former.height_rounding_m / np.sqrt(3))


def rounded_again(found, rows, quantum_m3, draws=DRAWS):
    """(draws, rows) rounding errors of tanks that a Fit leaves possible, m3."""
    sds = np.sqrt(np.diag(found.cofactor))
    random = np.random.default_rng(SEED)
    safe = np.where(sds > 0, sds, 1.0)
    values, vectors = np.linalg.eigh(found.cofactor / np.outer(safe, safe))
    roots = vectors * np.sqrt(np.maximum(values, 0)) * safe[:, None]
    moves = random.normal(size=(draws, len(sds))) @ (found.design @ roots).T
    shifts = random.uniform(0, 1, (draws, 1))
    places = (found.state.volume_m3(rows.dip_m) + moves) / quantum_m3 + shifts
    return (np.round(places) - places) * quantum_m3


def scale_of_u(found, rows, quantum_m3):
    """(u,) what the standard deviations of the unknowns of a Fit are multiplied by; 1 or more.

    Parameters
    ----------
    found : Fit
    rows : Rows
    quantum_m3 : float
        Value of the last printed digit; 0: nothing was rounded.
    """
    return np.maximum(_by_steps(found, rows, quantum_m3), roughness(found, rows))


def _by_steps(found, rows, quantum):
    sds = np.sqrt(np.diag(found.cofactor))
    if quantum <= 0 or found.dof <= 0:
        return np.ones(len(sds))
    gain = found.cofactor @ (found.design / rows.sd_m3[:, None] ** 2).T
    errors = rounded_again(found, rows, quantum) @ gain.T
    moved = np.sqrt(np.mean(errors**2, axis=0))
    return np.maximum(moved / np.where(sds > 0, sds, np.inf), 1.0)


def roughness(found, rows):
    """What u is multiplied by: 1, or more where rows depart by more than their rounding.

    Departures that go on from row to row count for fewer rows than there are: with a correlation c
    of neighbours by sqrt((1 + c) / (1 - c)).
    """
    left = found.left_m3 / rows.sd_m3
    size = np.sqrt(found.chi2 / found.dof) if found.dof > 0 else 1.0
    if size < ROUGH:
        return 1.0
    c = np.clip(left[1:] @ left[:-1] / (left @ left), 0.0, 0.99)
    return float(size * np.sqrt((1 + c) / (1 - c)))
