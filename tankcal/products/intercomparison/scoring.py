"""Scores of answers against assigned values, as in proficiency tests.

x is the answer, X the assigned value, U the stated expanded uncertainty, and u = U / k. The
assigned values come from a quadrature, whose numerical error is U_ref. The scores are those of
ISO 13528:2022, 9.7 and 9.6:

    E_n = (x - X) / sqrt(U^2 + U_ref^2)          zeta = (x - X) / sqrt(u^2 + u_ref^2)

For a coverage probability of 95 %, |E_n| <= 1 is expected for 95 % of the answers. The rows of a
table have nearly all errors in common. Tables, not rows, are therefore the independent units, and
the standard deviation of a share of rows follows from a ratio of sums over tables,

    p = sum m_i / sum n_i      s^2 = J / (J - 1) sum (m_i - p n_i)^2 / (sum n_i)^2

For the top rows of tables, the exact binomial bounds (Clopper and Pearson) are computed.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import beta

from tankcal.errors import InputError
from tankcal.job.tables import Log
from tankcal.messages import message
from tankcal.products.intercomparison.answers import PARTICIPANT, read_answers
from tankcal.products.intercomparison.package import load_package, load_truth
from tankcal.record.intercomparison import (
    ANSWERS,
    PACKAGE,
    MethodScore,
    ScoredRows,
    ScoredTable,
    ScoresFile,
    TableForm,
)
from tankcal.record.schema import warnings_of
from tankcal.version import find_version


def score_folders(folders, truth, package=None):
    """Score folders of answers.

    Parameters
    ----------
    folders : sequence of path
        Folders of answers, one for each participant.
    truth : path
        The file truth.json, or its folder.
    package : path, optional
        The package; its manifest must also state the SHA-256 of this truth.

    Returns
    -------
    ScoresFile

    Raises
    ------
    InputError
        If the folders, the truth or the package have problems, or if answers or manifest refer to
        another truth. The error lists all problems.
    """
    log, committed = Log(), []
    coverage = 0.95
    if package is not None:
        manifest = load_package(package, log)
        if manifest is not None:
            committed.append((PACKAGE.file, manifest["truth_sha256"]))
            coverage = manifest["coverage_probability"]
    truth_and_hash = load_truth(truth, committed, log)
    if truth_and_hash is None:
        log.stop_if_problems()
    truth_data, truth_sha256 = truth_and_hash
    requested = {
        item["tank"]: (item["heights_m"], set(truth_data["methods"]))
        for item in truth_data["tanks"]
    }
    problems, participants = list(log.problems), []
    for folder in folders:
        folder_log = Log()
        answers = read_answers(folder, requested, folder_log)
        if answers is not None and answers.saved.participant.package != truth_sha256:
            folder_log.problem(
                ANSWERS.file if (Path(folder) / ANSWERS.file).is_file() else PARTICIPANT,
                _other_package(answers.saved.participant.package, truth_sha256),
            )
        problems += [_add_folder(folder, item, folders) for item in folder_log.problems]
        if answers is not None:
            warnings = [_add_folder(folder, item, folders) for item in answers.warnings]
            participants.append(replace(answers, warnings=tuple(warnings)))
    if problems:
        raise InputError(problems)
    return score(participants, truth_data, truth_sha256, coverage)


def _other_package(promised, own):
    """Message that answers refer to another package."""
    return message(
        "ic_other_package",
        "the answers are to the package with truth_sha256 {promised}, the truth has {own}: it was "
        "changed, or belongs to another package",
        promised=promised,
        own=own,
    )


def _add_folder(folder, problem, folders):
    """Problem with the folder before its file name if several folders are scored."""
    if len(folders) < 2:
        return problem
    return replace(problem, file=f"{Path(folder).resolve().name}/{problem.file}")


EVERY = "*"  # replaces the method in scores of all methods
SAME_M = 1e-6  # largest difference of heights that are treated as equal
DELIVERIES_M = (0.01, 0.1, 2.0)  # differences of height of the scored deliveries
FEWEST_ROWS = 4  # least number of rows for the fit of zero and scale
BOUNDS = 0.95  # probability between the exact bounds


def score(participants, truth, truth_sha256, coverage=0.95):
    """Score the answers of several participants.

    Parameters
    ----------
    participants : sequence of Answers
        Answers of each participant.
    truth : dict
        Plain data of `package.load_truth`.
    truth_sha256 : str
        SHA-256 of the truth file.
    coverage : float
        Requested coverage probability of U.

    Returns
    -------
    ScoresFile
    """
    true = {item["tank"]: item for item in truth["tanks"]}
    tables = [
        score_table(number, answer, true[answer.tank])
        for number, item in enumerate(participants)
        for answer in item.saved.answers
    ]
    order = {method: i for i, method in enumerate([*truth["methods"], EVERY])}
    methods = []
    for number in range(len(participants)):
        tables_of_participant = [item for item in tables if item.participant == number]
        for method in order:
            tables_of_method = [
                item for item in tables_of_participant if method in (item.method, EVERY)
            ]
            asked = len(true) * (len(truth["methods"]) if method == EVERY else 1)
            if tables_of_method:
                methods.append(score_method(number, method, tables_of_method, asked))
    return ScoresFile(
        tankcal=find_version(),
        truth_sha256=truth_sha256,
        coverage_probability=coverage,
        participants=[item.saved.participant for item in participants],
        tables=sorted(tables, key=lambda item: (item.participant, item.tank, order[item.method])),
        methods=methods,
        warnings=warnings_of([w for item in participants for w in item.warnings]),
    )


def score_table(participant, answer, true):
    """Score one table of answers.

    Parameters
    ----------
    participant : int
        Index of the participant.
    answer : Answer
        Answers for one survey.
    true : dict
        The tank in the truth file.

    Returns
    -------
    ScoredTable
    """
    requested_m, assigned = np.array(true["heights_m"]), np.array(true["volume_m3"])
    order = np.argsort(answer.height_m)
    height = np.array(answer.height_m, float)[order]
    # Index of the requested height of each row.
    at = np.argmin(np.abs(requested_m[:, None] - height), axis=0)
    volume, U, k = (
        np.array([np.nan if value is None else value for value in values], float)[order]
        for values in (answer.volume_m3, answer.U_m3, answer.k)
    )
    exact, error, full = assigned[at], volume - assigned[at], assigned[-1]
    reference = true["numerical_error_m3"]
    E_n = error / np.hypot(U, reference)
    zeta = error / np.hypot(U / k, reference)
    is_judged = np.isfinite(E_n)
    has_top = at[-1] == len(requested_m) - 1
    return ScoredTable(
        participant=participant,
        tank=answer.tank,
        method=answer.method,
        rows=ScoredRows(
            *(value.tolist() for value in (requested_m[at], exact, error, U, E_n, zeta))
        ),
        missing=len(requested_m) - len(height),
        top_error_ppm=float(1e6 * error[-1] / full) if has_top else None,
        top_E_n=float(E_n[-1]) if has_top and is_judged[-1] else None,
        rms_ppm=float(1e6 * _rms(error) / full),
        within=int(np.sum(np.abs(E_n[is_judged]) <= 1)),
        judged=int(is_judged.sum()),
        mean_U_ppm=_or_none(1e6 * _mean(U[np.isfinite(U)]) / full),
        rms_zeta=_or_none(_rms(zeta[np.isfinite(zeta)])),
        form=form_of(height, volume, exact, full),
    )


def form_of(height, volume, exact, full):
    """Determine errors of zero, scale, form and deliveries of a table.

    Parameters
    ----------
    height, volume, exact : ndarray, shape (n,)
        Ascending heights, m, answers and assigned values, m3.
    full : float
        Largest assigned value, m3.

    Returns
    -------
    TableForm
    """
    error = volume - exact
    zero = scale = form = None
    if len(height) >= FEWEST_ROWS:
        # error = zero + scale * volume + form; the form is the residual of the line.
        design = np.column_stack([np.ones(len(exact)), exact])
        (zero, scale), *_ = np.linalg.lstsq(design, error, rcond=None)
        form = float(1e6 * _rms(error - design @ [zero, scale]) / full)
        zero, scale = float(zero), float(1e6 * scale)
    small, larger, large = (_deliveries(height, volume, exact, step) for step in DELIVERIES_M)
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
    """Relative errors of the deliveries between rows whose heights differ by `step`."""
    low, high = np.nonzero(np.abs(height[None, :] - height[:, None] - step) <= SAME_M)
    true = exact[high] - exact[low]
    return (volume[high] - volume[low] - true) / true


def score_method(participant, method, tables, asked):
    """Score the tables of a participant for a method, or for all methods.

    Parameters
    ----------
    participant : int
        Index of the participant.
    method : str
        Method, or EVERY.
    tables : sequence of ScoredTable
        Scored tables of this participant and method.
    asked : int
        Number of requested tables.

    Returns
    -------
    MethodScore
    """
    tops = np.array([table.top_error_ppm for table in tables if table.top_error_ppm is not None])
    E_n = np.array([table.top_E_n for table in tables if table.top_E_n is not None])
    within = np.array([table.within for table in tables])
    judged = np.array([table.judged for table in tables])
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
        rms_ppm=_pool_rms([table.rms_ppm for table in tables]),
        mean_U_ppm=_or_none(_mean(_drop_none(table.mean_U_ppm for table in tables))),
        share_within=share,
        u_share=u_share,
        tops_within=good,
        tops_judged=len(E_n),
        tops_low=low,
        tops_high=high,
        rms_zeta=_pool_rms([table.rms_zeta for table in tables]),
        form_ppm=_pool_rms([table.form.form_ppm for table in tables]),
        delivery_1cm_percent=_pool_rms([table.form.delivery_1cm_percent for table in tables]),
        delivery_10cm_percent=_pool_rms([table.form.delivery_10cm_percent for table in tables]),
        delivery_2m_ppm=_pool_rms([table.form.delivery_2m_ppm for table in tables]),
        falling_rows=sum(table.form.falling_rows for table in tables),
    )


def share_within(within, judged):
    """Share of rows with |E_n| <= 1, and its standard deviation over tables.

    Parameters
    ----------
    within, judged : ndarray of int, shape (tables,)
        Number of rows with |E_n| <= 1, and of all rows with an E_n.

    Returns
    -------
    share, sd : float or None
        None if not determined.

    Examples
    --------
    >>> import numpy as np
    >>> share_within(np.array([10, 5]), np.array([10, 10]))
    (0.75, 0.25)
    """
    has_rows = judged > 0
    within, judged = within[has_rows], judged[has_rows]
    if not len(judged):
        return None, None
    share, count = within.sum() / judged.sum(), len(judged)
    if count < 2:
        return float(share), None
    variance = count / (count - 1) * np.sum((within - share * judged) ** 2) / judged.sum() ** 2
    return float(share), float(np.sqrt(variance))


def exact_bounds(good, count):
    """Exact bounds of a probability, from `good` successes in `count` trials (Clopper and Pearson).

    Examples
    --------
    >>> [round(bound, 4) for bound in exact_bounds(5, 5)]
    [0.4782, 1.0]
    """
    if not count:
        return None, None
    tail = (1 - BOUNDS) / 2
    low = beta.ppf(tail, good, count - good + 1) if good else 0.0
    high = beta.ppf(1 - tail, good + 1, count - good) if good < count else 1.0
    return float(low), float(high)


def _drop_none(values):
    """Array of the values that are not None."""
    return np.array([value for value in values if value is not None], float)


def _pool_rms(values):
    """Root mean square of the values that are not None, or None."""
    return _or_none(_rms(_drop_none(values)))


def _mean(values):
    """Mean; nan for no values."""
    return float(np.mean(values)) if len(values) else np.nan


def _rms(values):
    """Root mean square; nan for no values."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else np.nan


def _or_none(value):
    """Value as float, or None if it is not finite."""
    return float(value) if np.isfinite(value) else None
