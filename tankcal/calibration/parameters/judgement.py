"""Analysis of one set of interior parameters, and its update by new adjustments.

Tests, components, predictions and rules follow from the covariance of the set. Trials add the
effect of dropping parameters on points and volume, which updates the recommendation.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.calibration.edges import Shift, left_shifts, own_shift
from tankcal.calibration.interiors import Interior
from tankcal.calibration.parameters.recommendation import (
    CORRELATED,
    LIMIT_PX,
    Advice,
    Evidence,
    Limit,
    PessoaRule,
    SilvaRule,
    changes_product,
    make_joint_reasons,
    pessoa_rule,
    recommend,
    silva_rule,
)
from tankcal.calibration.parameters.significance import (
    ALPHA,
    Components,
    Prediction,
    ZeroTest,
    components,
    drop_parameters,
    group_tests,
    select_groups,
    single_tests,
)
from tankcal.camera.model import PARAMETERS
from tankcal.messages import message
from tankcal.survey.network import correlations

IMAGE = "image coordinate"


@dataclass(frozen=True)
class Choices:
    """Choices of the user.

    Attributes
    ----------
    alpha : float
        Significance level of the tests.
    groups : tuple of tuple of str, or None
        Groups of parameters to test, or None for the usual groups.
    of : str
        Matrix of the principal components: "correlation" or "covariance".
    unscaled : bool
        Whether the values of the components are computed as in Silva's program.
    limit_px, limit_um : float or None
        Image accuracy for comparison with the effect of a parameter, px or um. By default 0.5 px in
        Pessoa's rule, and the accuracy from the residuals in the recommendation.
    """

    alpha: float = ALPHA
    groups: tuple | None = None
    of: str = "correlation"
    unscaled: bool = False
    limit_px: float | None = None
    limit_um: float | None = None


@dataclass(frozen=True)
class Trial:
    """Set of parameters that could be dropped.

    Attributes
    ----------
    names : tuple of str
        Names of the parameters.
    because : tuple of str
        Reasons of the trial: "single", "group", "silva", "pessoa", "advised".
    predicted : Prediction
        Predicted values and covariance of the kept parameters.
    comparable : bool
        Whether dropping the parameters changes only this set of parameters.
    outcome : Outcome or None
        Result of a new adjustment, or None without a new adjustment.
    after : tuple or None
        Names, values (k,) and covariance (k, k) after the new adjustment, scaled as `predicted`.
    """

    names: tuple
    because: tuple
    predicted: Prediction
    comparable: bool
    outcome: object = None
    after: tuple | None = None


@dataclass(frozen=True)
class CameraParameters:
    """Analysis of one set of interior parameters.

    Attributes
    ----------
    interior : Interior
        Set of interior parameters.
    source : str
        "job" or "record".
    choices : Choices
        Choices of the user.
    names : tuple of str
        Names of the k adjusted parameters.
    values : ndarray, shape (k,)
        Values of the adjusted parameters.
    covariance : ndarray, shape (k, k)
        Covariance matrix, multiplied by sigma0^2 if `scale` is "a_posteriori".
    scale : str
        "a_posteriori" or "a_priori".
    dof, sigma0 : float
        Degrees of freedom and value of sigma0; inf and nan if sigma0 is not estimated.
    limit : Limit
        Image accuracy.
    tests, groups : tuple of ZeroTest
        Tests of single parameters and of groups.
    components : Components
        Principal components.
    own : dict
        {name: Shift or None}, shift by the value of the parameter.
    left : dict
        {name: (Shift, Shift after rotation)}, remaining shift if the parameter is dropped.
    trials : tuple of Trial
        Sets of parameters that could be dropped.
    silva, pessoa : SilvaRule, PessoaRule
        Results of the two rules.
    recommendation : tuple of Advice
        Recommendation for each parameter.
    held_back : tuple of str
        Parameters that can be dropped alone, but not together with the others.
    base : tuple or None
        TopVolume with all parameters or None, and reason of a failure or None; None for a record.
    """

    interior: Interior
    source: str
    choices: Choices
    names: tuple
    values: np.ndarray
    covariance: np.ndarray
    scale: str
    dof: float
    sigma0: float
    limit: Limit
    tests: tuple[ZeroTest, ...]
    groups: tuple[ZeroTest, ...]
    components: Components
    own: dict[str, Shift | None]
    left: dict[str, tuple[Shift, Shift]]
    trials: tuple[Trial, ...]
    silva: SilvaRule
    pessoa: PessoaRule
    recommendation: tuple[Advice, ...]
    held_back: tuple = ()
    base: tuple | None = None

    @property
    def sds(self):
        """Standard deviations (k,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self):
        """Correlation matrix (k, k)."""
        return correlations(self.covariance)


@dataclass(frozen=True)
class Statistics:
    """Statistics of an adjustment; groups are (kind, name, count, redundancy, rms in mm)."""

    sigma0: float
    dof: int
    cov_scale: float
    groups: list

    @property
    def is_estimated(self):
        """Whether sigma0 was estimated."""
        return self.dof > 0 and np.isfinite(self.sigma0) and self.sigma0 > 0


def find_adjusted_rows(interior):
    """Rows of the covariance with a positive variance; exact conditions can make it zero."""
    return np.flatnonzero(np.diag(interior.covariance) > 0)


def judge_parameters(interior, statistics, choices, source):
    """Analyse one set of interior parameters.

    Parameters
    ----------
    interior : Interior
        Set of interior parameters.
    statistics : Statistics
        Statistics of the adjustment.
    choices : Choices
        Choices of the user.
    source : str
        "job" or "record".

    Returns
    -------
    CameraParameters
    """
    rows = find_adjusted_rows(interior)
    names = tuple(interior.free[i] for i in rows)
    values = np.array([interior.values[PARAMETERS.index(name)] for name in names])
    # Scale the covariance with the estimated sigma0^2, in place of the scale of the adjustment.
    factor = statistics.sigma0**2 / statistics.cov_scale if statistics.is_estimated else 1.0
    covariance = factor * interior.covariance[np.ix_(rows, rows)]
    dof = float(statistics.dof) if statistics.is_estimated else np.inf
    tests = single_tests(names, values, covariance, dof, choices.alpha)
    groups = group_tests(names, values, covariance, dof, choices.alpha, choices.groups)
    parts = components(names, covariance, values, of=choices.of, unscaled=choices.unscaled)
    limit = _accuracy_limit(interior, statistics, choices)
    own = {
        name: own_shift(name, interior.values, interior.form, interior.frame)
        for name, scope in zip(PARAMETERS, interior.scope, strict=True)
        if scope != "off"
    }
    silva = silva_rule(parts)
    limit_px = LIMIT_PX if choices.limit_px is None else choices.limit_px
    pessoa = pessoa_rule(tests, own, limit_px=limit_px, limit_um=limit.um)
    trials = _make_trials(interior, names, values, covariance, choices.groups, silva, pessoa)
    left = {
        t.names[0]: _remaining_shifts(interior, t.predicted)
        for t in trials
        if "single" in t.because
    }
    analysis = CameraParameters(
        interior, source, choices, names, values, covariance,
        "a_posteriori" if statistics.is_estimated else "a_priori", dof, statistics.sigma0,
        limit, tests, groups, parts, own, left, trials, silva, pessoa, (),
    )  # fmt: skip
    return add_joint_trial(advise(analysis))


def _remaining_shifts(interior, predicted):
    """Remaining shifts if parameters are dropped (left_shifts); None without a prediction."""
    if not predicted.positive_definite:
        return None
    others = np.array(interior.values)
    others[[PARAMETERS.index(name) for name in predicted.dropped]] = 0.0
    others[[PARAMETERS.index(name) for name in predicted.kept]] = predicted.values
    if not others[0] > 0:
        return None
    return left_shifts(interior.values, others, interior.form, interior.frame)


def _accuracy_limit(interior, statistics, choices):
    """Return the Limit of the user, or the standard deviation of an image coordinate.

    The standard deviation is estimated from the residuals of the camera, or of all cameras.
    """
    pixel_mm = interior.frame.pixel_mm
    pixel_um = np.nan if pixel_mm is None else 1e3 * float(np.mean(pixel_mm))
    if choices.limit_um is not None:
        return Limit(choices.limit_um, choices.limit_um / pixel_um, "given")
    if choices.limit_px is not None:
        if pixel_mm is None:
            raise ValueError(
                message(
                    "camera_no_pixels",
                    "the size of a pixel of {camera} is not known; expected the limit in "
                    "micrometres",
                    camera=interior.camera,
                )
            )
        return Limit(choices.limit_px * pixel_um, choices.limit_px, "given")
    images = [group for group in statistics.groups if group[0] == IMAGE and group[4] is not None]
    images = [group for group in images if group[1] == interior.camera] or images
    redundancy = sum(redundancy for _, _, _, redundancy, _ in images)
    if redundancy <= 0:
        return Limit(np.nan, np.nan, "residuals")
    um = 1e3 * np.sqrt(sum(count * rms**2 for _, _, count, _, rms in images) / redundancy)
    return Limit(float(um), float(um / pixel_um), "residuals")


def _make_trials(interior, names, values, covariance, groups, silva, pessoa):
    """Create the Trials: single parameters, groups, and the sets of the two rules."""
    groups = select_groups(names) if groups is None else groups
    wanted = [((name,), "single") for name in names] + [(group, "group") for group in groups]
    wanted += [(silva.drop, "silva"), (pessoa.drop, "pessoa")]
    because = {}
    for chosen, why in wanted:
        key = tuple(name for name in names if name in chosen)
        if key and "c" not in key and len(key) < len(names):
            because.setdefault(key, []).append(why)
    return tuple(
        Trial(
            key, tuple(why), drop_parameters(names, covariance, key, values), not interior.is_shared
        )
        for key, why in because.items()
    )


def remove_joint_trial(analysis):
    """Remove the Trial of all parameters that are recommended to be dropped together."""
    trials = (
        replace(trial, because=tuple(why for why in trial.because if why != "advised"))
        for trial in analysis.trials
    )
    return replace(analysis, trials=tuple(trial for trial in trials if trial.because))


def add_joint_trial(analysis):
    """Add a Trial of all parameters that are recommended to be dropped, together."""
    dropped = tuple(item.name for item in analysis.recommendation if not item.keep)
    trials = list(remove_joint_trial(analysis).trials)
    if dropped and dropped not in [item.names for item in trials]:
        predicted = drop_parameters(analysis.names, analysis.covariance, dropped, analysis.values)
        trials.append(Trial(dropped, (), predicted, not analysis.interior.is_shared))
    return replace(
        analysis,
        trials=tuple(
            replace(item, because=(*item.because, "advised")) if item.names == dropped else item
            for item in trials
        ),
    )


def hold_back_worst(analysis):
    """Hold back one parameter if dropping all recommended parameters changes the product.

    The parameter with the largest effect alone is held back. If the product does not change, the
    same object is returned.
    """
    joint = _find_joint_trial(analysis)
    if joint is None:
        return analysis
    product = _product_change(analysis, joint)
    if product is not None and not changes_product(product):
        return analysis
    alone = {
        trial.names[0]: _product_change(analysis, trial)
        for trial in analysis.trials
        if len(trial.names) == 1
    }
    # A parameter without a trial of its own counts as the worst.
    worst = max(joint.names, key=lambda name: (alone.get(name) or {}).get("largest_sds", np.inf))
    return replace(analysis, held_back=(*analysis.held_back, worst))


def _find_joint_trial(analysis):
    """Trial of two or more parameters that are recommended to be dropped together, or None."""
    trial = next((trial for trial in analysis.trials if "advised" in trial.because), None)
    return None if trial is None or len(trial.names) < 2 else trial


def advise_together(analysis):
    """Add the effect of dropping all recommended parameters together to the reasons."""
    joint = _find_joint_trial(analysis)
    if joint is None:
        return analysis
    reason = make_joint_reasons(joint.names, _product_change(analysis, joint), _failure(joint))
    return replace(
        analysis,
        recommendation=tuple(
            item if item.keep else replace(item, reasons=(*item.reasons, *reason))
            for item in analysis.recommendation
        ),
    )


def advise(analysis):
    """Update the recommendation of a CameraParameters from its trials."""
    singles = {t.names[0]: t for t in analysis.trials if "single" in t.because and t.comparable}
    evidence = tuple(
        Evidence(
            test=test,
            own=analysis.own.get(name),
            left=(analysis.left.get(name) or (None,))[0],
            state=analysis.interior.state[PARAMETERS.index(name)],
            groups=tuple(group for group in analysis.groups if name in group.names),
            correlated=_find_correlated(analysis, name),
            product=_product_change(analysis, singles.get(name)),
            failed=_failure(singles.get(name)),
        )
        for name, test in zip(analysis.names, analysis.tests, strict=True)
    )
    recommendation = recommend(
        evidence, analysis.limit, analysis.interior.frame, analysis.held_back
    )
    return replace(analysis, recommendation=recommendation)


def _find_correlated(analysis, name):
    """Other parameters with a high correlation: ((name, correlation), ...)."""
    row = analysis.correlation[analysis.names.index(name)].tolist()
    return tuple(
        (other, r)
        for other, r in zip(analysis.names, row, strict=True)
        if other != name and abs(r) > CORRELATED
    )


def _failure(trial):
    """Reason why the survey cannot be adjusted without the parameters of a trial, or None."""
    if trial is None or trial.outcome is None or trial.outcome.changes is not None:
        return None
    return trial.outcome.failed


def _product_change(analysis, trial):
    """Effect of a trial on points and volume as a dict, or None if it is not known."""
    if trial is None or trial.outcome is None or trial.outcome.changes is None:
        return None
    points, after = trial.outcome.changes, trial.outcome.volume
    before = None if analysis.base is None else analysis.base[0]
    both = before is not None and after is not None
    return {
        "largest_sds": points.largest_sds,
        "largest_mm": 1e3 * points.largest_m,
        "volume_change_m3": after.value_m3 - before.value_m3 if both else None,
        "volume_u_m3": before.u_m3 if both else None,
    }
