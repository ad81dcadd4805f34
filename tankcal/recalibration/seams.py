"""Seams that nobody declared: where the second difference of a table jumps."""

import numpy as np

LEAST_APART_M = 0.8  # of two seams, and of a seam from the ends of the table
PLACES_APART_M = 0.01
LEAST_GAIN = 30.0  # of chi2 by a seam


def find_seams(dips_m, volumes_m3, sd_m3, count):
    """Dips of the seams, rising; fewer than `count` where fewer can be found.

    A parabola for each ring, the next one meeting it at the seam: seams are added one after the
    other where they lower chi2 most, and moved again while the others stand.

    Parameters
    ----------
    dips_m, volumes_m3, sd_m3 : (rows,) ndarray
    count : int
    """
    low, high = dips_m[0] + LEAST_APART_M, dips_m[-1] - LEAST_APART_M
    places = dips_m[(dips_m > low) & (dips_m < high)]
    if len(places) > 1:
        step = max(1, round(PLACES_APART_M / float(np.median(np.diff(dips_m)))))
        places = places[::step]
    seams = []
    for _ in range(count):
        gains = _gains(dips_m, volumes_m3, sd_m3, seams, places)
        if len(gains) == 0 or gains.max() < LEAST_GAIN:
            break
        seams.append(float(places[np.argmax(gains)]))
    for _ in range(3):
        for k in range(len(seams)):
            others = seams[:k] + seams[k + 1 :]
            gains = _gains(dips_m, volumes_m3, sd_m3, others, places)
            if len(gains) and gains.max() > 0:
                seams[k] = float(places[np.argmax(gains)])
    return np.array(sorted(seams))


def _gains(dips, volumes, sds, seams, places):
    """(places,) by how much one seam more lowers chi2; 0 near one that is there."""
    x = dips / dips[-1]
    columns = [np.ones_like(x), x, x**2]
    for seam in seams:
        above = np.maximum(x - seam / dips[-1], 0.0)
        columns += [above, above**2]
    q = np.linalg.qr(np.column_stack(columns) / sds[:, None])[0]
    value = volumes / sds
    left = value - q @ (q.T @ value)
    gains = np.zeros(len(places))
    for k, place in enumerate(places):
        if any(abs(place - seam) < LEAST_APART_M for seam in seams):
            continue
        above = np.maximum(x - place / dips[-1], 0.0)
        kinks = np.column_stack([above, above**2]) / sds[:, None]
        kinks = np.linalg.qr(kinks - q @ (q.T @ kinks))[0]
        gains[k] = float(np.sum((kinks.T @ left) ** 2))
    return gains
