"""Scores of answers against assigned values, as proficiency tests have them.

With x the answer, X the assigned value, U and u = U / k as stated (ISO 13528:2022, 9.7 and 9.6; the
assigned values are those of a quadrature, U_ref is its numerical error):

    E_n = (x - X) / sqrt(U^2 + U_ref^2)          zeta = (x - X) / sqrt(u^2 + u_ref^2)

|E_n| <= 1 is expected of 95 % of what is stated with U at 95 %. Rows of one table share nearly all
of their errors, so tables, not rows, are the independent units: the standard deviation of a share
of rows is that of a ratio of sums over tables,

    p = sum m_i / sum n_i      s^2 = J / (J - 1) sum (m_i - p n_i)^2 / (sum n_i)^2

and of the tops of tables the exact binomial bounds (Clopper and Pearson) are given.
"""

import numpy as np
from scipy.stats import beta

from tankcal.record.intercomparison import (
    MethodScore,
    ScoredRows,
    ScoredTable,
    ScoresFile,
    TableForm,
    version,
)
from tankcal.record.texts import warnings_of

EVERY = "*"  # in place of a method: all of them
SAME_M = 1e-6
DELIVERIES_M = (0.01, 0.1, 2.0)
FEWEST_ROWS = 4  # that a line is put through
BOUNDS = 0.95  # probability between the exact bounds


def score(participants, truth, truth_sha256, coverage=0.95):
    """The `ScoresFile` of several `answers.Answers`.

    Parameters
    ----------
    participants : sequence of Answers
    truth : dict
        As of `package.load_truth`.
    truth_sha256 : str
    coverage : float
        That was asked for.
    """
    true = {one["tank"]: one for one in truth["tanks"]}
    tables = [
        score_table(place, answer, true[answer.tank])
        for place, one in enumerate(participants)
        for answer in one.saved.answers
    ]
    order = {method: i for i, method in enumerate([*truth["methods"], EVERY])}
    methods = []
    for place in range(len(participants)):
        own = [one for one in tables if one.participant == place]
        for method in order:
            some = [one for one in own if method in (one.method, EVERY)]
            asked = len(true) * (len(truth["methods"]) if method == EVERY else 1)
            if some:
                methods.append(score_method(place, method, some, asked))
    return ScoresFile(
        tankcal=version(),
        truth_sha256=truth_sha256,
        coverage_probability=coverage,
        participants=[one.saved.participant for one in participants],
        tables=sorted(tables, key=lambda one: (one.participant, one.tank, order[one.method])),
        methods=methods,
        warnings=warnings_of([w for one in participants for w in one.warnings]),
    )


def score_table(participant, answer, true):
    """The `ScoredTable` of one answer.

    true  the tank of the truth file
    """
    wanted, assigned = np.array(true["heights_m"]), np.array(true["volume_m3"])
    order = np.argsort(answer.height_m)
    height = np.array(answer.height_m, float)[order]
    at = np.argmin(np.abs(wanted[:, None] - height), axis=0)
    volume, U, k = (
        np.array([np.nan if one is None else one for one in values], float)[order]
        for values in (answer.volume_m3, answer.U_m3, answer.k)
    )
    exact, error, full = assigned[at], volume - assigned[at], assigned[-1]
    reference = true["numerical_error_m3"]
    E_n = error / np.hypot(U, reference)
    zeta = error / np.hypot(U / k, reference)
    judged = np.isfinite(E_n)
    has_top = at[-1] == len(wanted) - 1
    return ScoredTable(
        participant=participant,
        tank=answer.tank,
        method=answer.method,
        rows=ScoredRows(*(one.tolist() for one in (wanted[at], exact, error, U, E_n, zeta))),
        missing=len(wanted) - len(height),
        top_error_ppm=float(1e6 * error[-1] / full) if has_top else None,
        top_E_n=float(E_n[-1]) if has_top and judged[-1] else None,
        rms_ppm=float(1e6 * _rms(error) / full),
        within=int(np.sum(np.abs(E_n[judged]) <= 1)),
        judged=int(judged.sum()),
        mean_U_ppm=_or_none(1e6 * _mean(U[np.isfinite(U)]) / full),
        rms_zeta=_or_none(_rms(zeta[np.isfinite(zeta)])),
        form=form_of(height, volume, exact, full),
    )


def form_of(height, volume, exact, full):
    """The `TableForm` of a table.

    height, volume, exact  (n,) rising heights, answers, assigned values     full  the largest value
    """
    error = volume - exact
    zero = scale = form = None
    if len(height) >= FEWEST_ROWS:
        design = np.column_stack([np.ones(len(exact)), exact])
        (zero, scale), *_ = np.linalg.lstsq(design, error, rcond=None)
        form = float(1e6 * _rms(error - design @ [zero, scale]) / full)
        zero, scale = float(zero), float(1e6 * scale)
    small, larger, large = (_deliveries(height, volume, exact, one) for one in DELIVERIES_M)
    return TableForm(
        falling_rows=int(np.sum(np.diff(volume) <= 0)),
        zero_m3=zero,
        scale_ppm=scale,
        form_ppm=form,
        delivery_1cm_percent=_or_none(100 * _rms(small)),
        delivery_10cm_percent=_or_none(100 * _rms(larger)),
        delivery_2m_ppm=_or_none(1e6 * _rms(large)),
        worst_2m_ppm=float(1e6 * large[np.argmax(np.abs(large))]) if len(large) else None,
    )


def _deliveries(height, volume, exact, step):
    """Relative errors of deliveries between rows that are so far apart."""
    low, high = np.nonzero(np.abs(height[None, :] - height[:, None] - step) <= SAME_M)
    true = exact[high] - exact[low]
    return (volume[high] - volume[low] - true) / true


def score_method(participant, method, tables, asked):
    """The `MethodScore` of some tables of one participant."""
    tops = np.array([one.top_error_ppm for one in tables if one.top_error_ppm is not None])
    E_n = np.array([one.top_E_n for one in tables if one.top_E_n is not None])
    within = np.array([one.within for one in tables])
    judged = np.array([one.judged for one in tables])
    share, u_share = share_within(within, judged)
    good = int(np.sum(np.abs(E_n) <= 1))
    low, high = exact_bounds(good, len(E_n))
    return MethodScore(
        participant=participant,
        method=method,
        tables=len(tables),
        asked=asked,
        bias_ppm=_or_none(_mean(tops)),
        u_bias_ppm=float(np.std(tops, ddof=1) / np.sqrt(len(tops))) if len(tops) > 1 else None,
        rms_top_ppm=_or_none(_rms(tops)),
        rms_ppm=_pooled([one.rms_ppm for one in tables]),
        mean_U_ppm=_or_none(_mean(_known(one.mean_U_ppm for one in tables))),
        share_within=share,
        u_share=u_share,
        tops_within=good,
        tops_judged=len(E_n),
        tops_low=low,
        tops_high=high,
        rms_zeta=_pooled([one.rms_zeta for one in tables]),
        form_ppm=_pooled([one.form.form_ppm for one in tables]),
        delivery_1cm_percent=_pooled([one.form.delivery_1cm_percent for one in tables]),
        delivery_10cm_percent=_pooled([one.form.delivery_10cm_percent for one in tables]),
        delivery_2m_ppm=_pooled([one.form.delivery_2m_ppm for one in tables]),
        falling_rows=sum(one.form.falling_rows for one in tables),
    )


def share_within(within, judged):
    """Share of rows within their intervals, and its standard deviation over tables.

    within, judged  (tables,) rows within, and rows judged

    Examples
    --------
    >>> import numpy as np
    >>> share_within(np.array([10, 5]), np.array([10, 10]))
    (0.75, 0.25)
    """
    some = judged > 0
    within, judged = within[some], judged[some]
    if not len(judged):
        return None, None
    share, count = within.sum() / judged.sum(), len(judged)
    if count < 2:
        return float(share), None
    variance = count / (count - 1) * np.sum((within - share * judged) ** 2) / judged.sum() ** 2
    return float(share), float(np.sqrt(variance))


def exact_bounds(good, count, probability=BOUNDS):
    """Bounds of a probability of which so many of `count` were good (Clopper and Pearson).

    Examples
    --------
    >>> [round(one, 4) for one in exact_bounds(5, 5)]
    [0.4782, 1.0]
    """
    if not count:
        return None, None
    tail = (1 - probability) / 2
    low = beta.ppf(tail, good, count - good + 1) if good else 0.0
    high = beta.ppf(1 - tail, good + 1, count - good) if good < count else 1.0
    return float(low), float(high)


def _known(values):
    return np.array([one for one in values if one is not None], float)


def _pooled(values):
    """rms of those that are known."""
    return _or_none(_rms(_known(values)))


def _mean(values):
    return float(np.mean(values)) if len(values) else np.nan


def _rms(values):
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else np.nan


def _or_none(value):
    return float(value) if np.isfinite(value) else None
