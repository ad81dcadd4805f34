"""Random walls drawn from the prior of the wall components (`components`)."""

import numpy as np

from tankcal.geometry.field.components import COMPONENTS, Heights, mode_shares, weld_columns
from tankcal.geometry.field.sites import spans_of
from tankcal.geometry.girth import draw_waves, modes_of, nodes_of
from tankcal.units import FULL_TURN

NOTHING = 1e-12  # relative to the largest eigenvalue: smaller eigenvalues are rounding errors


def draw_departures(rng, sizes_m2, zeta, welds_rad, nominal_m, spans=None):
    """Draw departures of the courses of a wall from a cylinder, without radius and centre terms.

    Parameters
    ----------
    rng : numpy.random.Generator
    sizes_m2 : ndarray, shape (components,)
        Variances of the components, m2.
    zeta : ndarray, shape (k,)
        Heights within each course, -1 to 1.
    welds_rad : sequence of ndarray
        Azimuths of the known vertical welds of each course, from the bottom up.
    nominal_m : float
        Radius of the tank, m.
    spans : ndarray, shape (courses, 2), optional
        Relative heights of bottom and top of each course, as in `Sites`.

    Returns
    -------
    ndarray, shape (courses, k, n)
        Departures at n evenly spaced azimuths clockwise from 0, m.

    Examples
    --------
    >>> still = np.zeros(len(COMPONENTS))
    >>> departures = draw_departures(np.random.default_rng(1), still, np.zeros(2), [()] * 3, 6.5)
    >>> departures.shape[:2], float(np.abs(departures).max())
    ((3, 2), 0.0)
    """
    shares = mode_shares(modes_of(nominal_m), nominal_m)
    count, courses = nodes_of(nominal_m), len(welds_rad)
    azimuth = np.arange(count) * FULL_TURN / count
    # Profile of each weld along the azimuth, one row for each weld of a course.
    peaks = [weld_columns(azimuth, np.array(item, dtype=float), nominal_m).T for item in welds_rad]
    spans = spans_of(np.arange(courses + 1.0)) if spans is None else spans
    heights = [Heights.within(span, zeta) for span in spans]
    departures = np.zeros((courses, len(zeta), count))
    for item, size in zip(COMPONENTS, sizes_m2, strict=True):
        if not size:
            continue
        draws = 1 if item.common else courses
        if item.shape == "weld":  # equal at all heights of a course
            sizes = [rng.normal(size=1 if item.common else len(columns)) for columns in peaks]
            for course, columns in enumerate(peaks):
                peak_sizes = np.broadcast_to(sizes[0 if item.common else course], len(columns))
                departures[course] += np.sqrt(size) * (peak_sizes @ columns)
            continue
        if item.shape == "settled":  # depends on the height above the foot of the shell
            over_height = np.sqrt(size) * np.array(
                [item.height_columns(course_heights) for course_heights in heights]
            )
        else:
            over_height = np.sqrt(size) * _factor_covariance(
                item.height_covariance(heights[0], heights[0])
            )
        # A field is the product of its root over the height and a random function of azimuth.
        if item.shape == "mean":
            around_turn = rng.normal(size=(draws, over_height.shape[-1], 1))
        else:
            around_turn = draw_waves(rng, shares[item.shape], (draws, over_height.shape[-1]))
        departures += over_height @ around_turn
    return departures


def _factor_covariance(covariance):
    """Return columns (k, r) A with A A' = covariance, without zero eigenvalues."""
    values, vectors = np.linalg.eigh(covariance)
    positive = values > NOTHING * values[-1]
    return vectors[:, positive] * np.sqrt(values[positive])
