"""One set of parameters of a camera judged by its covariance alone, nothing adjusted again."""

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
    """Rows of the covariance with a variance: exact conditions may leave a parameter without."""
    return np.flatnonzero(np.diag(interior.covariance) > 0)


def judge_parameters(interior, statistics, choices, source):
    """The CameraParameters of one set, nothing adjusted again."""
    rows = adjusted_rows(interior)
    names = tuple(interior.free[i] for i in rows)
    values = np.array([interior.values[PARAMETERS.index(name)] for name in names])
    factor = statistics.sigma0**2 / statistics.cov_scale if statistics.estimated else 1.0
    covariance = factor * interior.covariance[np.ix_(rows, rows)]
    dof = float(statistics.dof) if statistics.estimated else np.inf
    tests = single_tests(names, values, covariance, dof, choices.alpha)
    groups = group_tests(names, values, covariance, dof, choices.alpha, choices.groups)
    parts = components(names, covariance, values, of=choices.of, unscaled=choices.unscaled)
    limit = _limit(interior, statistics, choices)
    own = {name: _own(name, interior) for name in _in_model(interior)}
    silva = silva_rule(parts)
    limit_px = LIMIT_PX if choices.limit_px is None else choices.limit_px
    pessoa = pessoa_rule(tests, own, limit_px=limit_px, limit_um=limit.um)
    trials = _trials(interior, names, values, covariance, choices.groups, silva, pessoa)
    left = {t.names[0]: _left(interior, t.predicted) for t in trials if "single" in t.because}
    found = CameraParameters(
        interior, source, choices, names, values, covariance,
        "a_posteriori" if statistics.estimated else "a_priori", dof, statistics.sigma0,
        limit, tests, groups, parts, own, left, trials, silva, pessoa, (),
    )  # fmt: skip
    return add_joint_trial(advise(found))


def _in_model(interior):
    pairs = zip(PARAMETERS, interior.scope, strict=True)
    return [name for name, scope in pairs if scope != "off"]


def _own(name, interior):
    return own_shift(name, interior.values, interior.form, interior.frame)


def _left(interior, predicted):
    """The two Shifts that are left when parameters are dropped; None: no prediction."""
    if not predicted.positive_definite:
        return None
    others = np.array(interior.values)
    others[[PARAMETERS.index(name) for name in predicted.dropped]] = 0.0
    others[[PARAMETERS.index(name) for name in predicted.kept]] = predicted.values
    if not others[0] > 0:
        return None
    return left_shifts(interior.values, others, interior.form, interior.frame)


def _limit(interior, statistics, choices):
    """The Limit: as given, or the sd of an image coordinate that the residuals show."""
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
    images = [one for one in statistics.groups if one[0] == IMAGE and one[4] is not None]
    images = [one for one in images if one[1] == interior.camera] or images
    redundancy = sum(redundancy for _, _, _, redundancy, _ in images)
    if redundancy <= 0:
        return Limit(np.nan, np.nan, "residuals")
    um = 1e3 * np.sqrt(sum(count * rms**2 for _, _, count, _, rms in images) / redundancy)
    return Limit(float(um), float(um / pixel_um), "residuals")


def _trials(interior, names, values, covariance, groups, silva, pessoa):
    """Each set of parameters that may go: single ones, groups, those of the two rules."""
    groups = groups_among(names) if groups is None else groups
    wanted = [((name,), "single") for name in names] + [(one, "group") for one in groups]
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
    """The CameraParameters without that Trial."""
    trials = (
        replace(one, because=tuple(why for why in one.because if why != "advised"))
        for one in found.trials
    )
    return replace(found, trials=tuple(one for one in trials if one.because))


def add_joint_trial(found):
    """The CameraParameters with a Trial of all that its recommendation lets go, together."""
    goes = tuple(one.name for one in found.recommendation if not one.keep)
    trials = list(remove_joint_trial(found).trials)
    if goes and goes not in [one.names for one in trials]:
        predicted = drop_parameters(found.names, found.covariance, goes, found.values)
        trials.append(Trial(goes, (), predicted, not found.interior.shared))
    return replace(
        found,
        trials=tuple(
            replace(one, because=(*one.because, "advised")) if one.names == goes else one
            for one in trials
        ),
    )


def hold_one_back(found):
    """The CameraParameters with one parameter held back where all that may go move the product.

    The one whose absence alone moves most; the same object where they stay.
    """
    trial = next((one for one in found.trials if "advised" in one.because), None)
    if trial is None or len(trial.names) < 2:
        return found
    product = product_of(found, trial)
    if product is not None and not moves(product):
        return found
    alone = {one.names[0]: product_of(found, one) for one in found.trials if len(one.names) == 1}
    worst = max(trial.names, key=lambda name: (alone.get(name) or {}).get("largest_sds", np.inf))
    return replace(found, held_back=(*found.held_back, worst))


def advise_together(found):
    """The CameraParameters whose advice says what dropping all that may go does at once."""
    trial = next((one for one in found.trials if "advised" in one.because), None)
    if trial is None or len(trial.names) < 2:
        return found
    reason = reasons_together(trial.names, product_of(found, trial), _failed(trial))
    return replace(
        found,
        recommendation=tuple(
            one if one.keep else replace(one, reasons=(*one.reasons, *reason))
            for one in found.recommendation
        ),
    )


def advise(found):
    """The CameraParameters with the recommendation that its trials support."""
    singles = {t.names[0]: t for t in found.trials if "single" in t.because and t.comparable}
    evidence = tuple(
        Evidence(
            test=test,
            own=found.own.get(name),
            left=(found.left.get(name) or (None,))[0],
            state=found.interior.state[PARAMETERS.index(name)],
            groups=tuple(group for group in found.groups if name in group.names),
            alike=_alike(found, name),
            product=product_of(found, singles.get(name)),
            failed=_failed(singles.get(name)),
        )
        for name, test in zip(found.names, found.tests, strict=True)
    )
    told = advice(evidence, found.limit, found.interior.frame, found.held_back)
    return replace(found, recommendation=told)


def _alike(found, name):
    row = found.correlation[found.names.index(name)].tolist()
    return tuple(
        (other, r)
        for other, r in zip(found.names, row, strict=True)
        if other != name and abs(r) > CORRELATED
    )


def _failed(trial):
    if trial is None or trial.outcome is None or trial.outcome.moved is not None:
        return None
    return trial.outcome.failed


def product_of(found, trial):
    """What dropping one parameter does to points and volume; None: not known."""
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
