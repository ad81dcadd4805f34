"""Analysis of one set of interior parameters from its covariance, without a new adjustment."""

from dataclasses import replace

import numpy as np

from tankcal.calibration.edges import left_shifts, own_shift
from tankcal.calibration.parameters.components import components
from tankcal.calibration.parameters.conditioning import drop_parameters
from tankcal.calibration.parameters.findings import CameraParameters, Trial
from tankcal.calibration.parameters.recommendation import (
    CORRELATED,
    Evidence,
    Limit,
    advice,
    moves,
    reasons_together,
)
from tankcal.calibration.parameters.rules import LIMIT_PX, pessoa_rule, silva_rule
from tankcal.calibration.parameters.significance import group_tests, groups_among, single_tests
from tankcal.camera.model import PARAMETERS
from tankcal.messages import message

IMAGE = "image coordinate"


def adjusted_rows(interior):
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
    rows = adjusted_rows(interior)
    names = tuple(interior.free[i] for i in rows)
    values = np.array([interior.values[PARAMETERS.index(name)] for name in names])
    # Scale the covariance with the estimated sigma0^2, in place of the scale of the adjustment.
    factor = statistics.sigma0**2 / statistics.cov_scale if statistics.estimated else 1.0
    covariance = factor * interior.covariance[np.ix_(rows, rows)]
    dof = float(statistics.dof) if statistics.estimated else np.inf
    tests = single_tests(names, values, covariance, dof, choices.alpha)
    groups = group_tests(names, values, covariance, dof, choices.alpha, choices.groups)
    parts = components(names, covariance, values, of=choices.of, unscaled=choices.unscaled)
    limit = _accuracy_limit(interior, statistics, choices)
    own = {name: _own_shift(name, interior) for name in _names_in_model(interior)}
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
        "a_posteriori" if statistics.estimated else "a_priori", dof, statistics.sigma0,
        limit, tests, groups, parts, own, left, trials, silva, pessoa, (),
    )  # fmt: skip
    return add_joint_trial(advise(analysis))


def _names_in_model(interior):
    pairs = zip(PARAMETERS, interior.scope, strict=True)
    return [name for name, scope in pairs if scope != "off"]


def _own_shift(name, interior):
    return own_shift(name, interior.values, interior.form, interior.frame)


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
    groups = groups_among(names) if groups is None else groups
    wanted = [((name,), "single") for name in names] + [(group, "group") for group in groups]
    wanted += [(silva.drop, "silva"), (pessoa.drop, "pessoa")]
    because = {}
    for chosen, why in wanted:
        key = tuple(name for name in names if name in chosen)
        if key and "c" not in key and len(key) < len(names):
            because.setdefault(key, []).append(why)
    return tuple(
        Trial(key, tuple(why), drop_parameters(names, covariance, key, values), not interior.shared)
        for key, why in because.items()
    )


def remove_joint_trial(found):
    """Remove the Trial of all parameters that are recommended to be dropped together."""
    trials = (
        replace(trial, because=tuple(why for why in trial.because if why != "advised"))
        for trial in found.trials
    )
    return replace(found, trials=tuple(trial for trial in trials if trial.because))


def add_joint_trial(found):
    """Add a Trial of all parameters that are recommended to be dropped, together."""
    dropped = tuple(item.name for item in found.recommendation if not item.keep)
    trials = list(remove_joint_trial(found).trials)
    if dropped and dropped not in [item.names for item in trials]:
        predicted = drop_parameters(found.names, found.covariance, dropped, found.values)
        trials.append(Trial(dropped, (), predicted, not found.interior.shared))
    return replace(
        found,
        trials=tuple(
            replace(item, because=(*item.because, "advised")) if item.names == dropped else item
            for item in trials
        ),
    )


def hold_one_back(found):
    """Hold back one parameter if dropping all recommended parameters changes the product.

    The parameter with the largest effect alone is held back. If the product does not change, the
    same object is returned.
    """
    trial = next(
        (trial_of_one for trial_of_one in found.trials if "advised" in trial_of_one.because), None
    )
    if trial is None or len(trial.names) < 2:
        return found
    product = product_of(found, trial)
    if product is not None and not moves(product):
        return found
    alone = {
        trial_of_one.names[0]: product_of(found, trial_of_one)
        for trial_of_one in found.trials
        if len(trial_of_one.names) == 1
    }
    worst = max(trial.names, key=lambda name: (alone.get(name) or {}).get("largest_sds", np.inf))
    return replace(found, held_back=(*found.held_back, worst))


def advise_together(found):
    """Add the effect of dropping all recommended parameters together to the reasons."""
    trial = next((item for item in found.trials if "advised" in item.because), None)
    if trial is None or len(trial.names) < 2:
        return found
    reason = reasons_together(trial.names, product_of(found, trial), _failure(trial))
    return replace(
        found,
        recommendation=tuple(
            item if item.keep else replace(item, reasons=(*item.reasons, *reason))
            for item in found.recommendation
        ),
    )


def advise(found):
    """Update the recommendation of a CameraParameters from its trials."""
    singles = {t.names[0]: t for t in found.trials if "single" in t.because and t.comparable}
    evidence = tuple(
        Evidence(
            test=test,
            own=found.own.get(name),
            left=(found.left.get(name) or (None,))[0],
            state=found.interior.state[PARAMETERS.index(name)],
            groups=tuple(group for group in found.groups if name in group.names),
            alike=_correlated_with(found, name),
            product=product_of(found, singles.get(name)),
            failed=_failure(singles.get(name)),
        )
        for name, test in zip(found.names, found.tests, strict=True)
    )
    recommendation = advice(evidence, found.limit, found.interior.frame, found.held_back)
    return replace(found, recommendation=recommendation)


def _correlated_with(found, name):
    """Other parameters with a high correlation: ((name, correlation), ...)."""
    row = found.correlation[found.names.index(name)].tolist()
    return tuple(
        (other, r)
        for other, r in zip(found.names, row, strict=True)
        if other != name and abs(r) > CORRELATED
    )


def _failure(trial):
    if trial is None or trial.outcome is None or trial.outcome.moved is not None:
        return None
    return trial.outcome.failed


def product_of(found, trial):
    """Effect of a trial on points and volume as a dict, or None if it is not known."""
    if trial is None or trial.outcome is None or trial.outcome.moved is None:
        return None
    moved, after = trial.outcome.moved, trial.outcome.volume
    before = None if found.base is None else found.base[0]
    both = before is not None and after is not None
    return {
        "largest_sds": moved.largest_sds,
        "largest_mm": 1e3 * moved.largest_m,
        "volume_change_m3": after.value_m3 - before.value_m3 if both else None,
        "volume_u_m3": before.u_m3 if both else None,
    }
