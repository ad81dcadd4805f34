"""What the parameters of a camera are worth, as it is saved: kind "parameters" of camera.json.

Codes of `recommendation[].reasons`:

    principal            c belongs to every camera
    significant          {F, critical}
    not_significant      {F, critical}
    effect_above         {edge_um, edge_px, limit_um, limit_px}
    effect_below         {edge_um, edge_px, limit_um, limit_px}
    effect_not_known     no image accuracy to compare it with
    significant_but_tiny            the two disagree
    insignificant_but_large {left_um, left_px}  the two disagree; left: what is left in the corner
                         when the others take over
    correlated           {with, correlation}
    group_significant    {names, F, critical}: alone it may go, not all of them
    lower_order          {of []}: stays because these higher terms stay
    known_beforehand     its value was given with an sd: the test is of both
    product_stays        {largest_sds, largest_mm, volume_change_m3, volume_u_m3}
    product_moves        {largest_sds, largest_mm, volume_change_m3, volume_u_m3}
    not_with_the_others  it may go alone; with the others the product moves
    product_not_tried    nothing was adjusted again: it stays until it is tried
    not_determined_without {text, [names]}
    corner_not_seen      {reach_mm, corner_mm, seen_um, seen_px}: image points do not reach the
                         corner, the effect there is extrapolated
    together_stay, together_move  {names, largest_sds, largest_mm, volume_change_m3, volume_u_m3}:
                         all that may go, dropped at once
"""

import math
from typing import Literal

import numpy as np

from tankcal.calibration.edges import Shift
from tankcal.calibration.parameters.recommendation import Advice
from tankcal.camera.model import PARAMETERS, UNITS
from tankcal.record.camera_versions import CameraFile
from tankcal.record.schema import Saved, filled_from, key, to_plain

MM = 1e3


class ImageAccuracy(Saved):
    """Image accuracy that effects are compared with."""

    um: float = key("micrometres")
    px: float = key("pixels")
    source: str = key('"given" or "residuals"', named="from")


class EdgeShifts(Saved):
    """Shifts over the frame: largest and rms; seen: largest within reach of the image points."""

    own: Shift | None = key("of the value itself (null for c)")
    left: Shift | None = key("what is left when the others take over, predicted")
    left_turned: Shift | None = key("the same after the camera has been turned to fit, too")


class ParameterJudged(Saved):
    """A parameter of the model; F to significant are null for a fixed one, whose sd is 0."""

    name: str = key("of the parameter")
    unit: str = key("of value and sd")
    value: float = key("as adjusted")
    sd: float = key("0: fixed")
    F: float | None = key("test quantity against 0")
    critical: float | None = key("its critical value")
    p_value: float | None = key("probability of an F as large by chance")
    significant: bool | None = key("whether F is above the critical value")
    decides: bool = key("false for c: the test against 0 means nothing for a decision")
    state: str = key('"free", "weighted" or "fixed"')
    scope: str = key('"off", "block", "camera" or "photo"')
    edge_um: float | None = key("shift that it makes in the worst corner of the frame")
    edge_px: float | None = key("the same in pixels")
    edge: EdgeShifts = key("over the frame")


class GroupTest(Saved):
    """Parameters against zero, together."""

    names: list[str] = key("of the parameters")
    F: float | None = key("test quantity", of="f")
    critical: float | None = key("its critical value")
    p_value: float | None = key("probability of an F as large by chance")
    significant: bool | None = key("whether F is above the critical value")
    positive_definite: bool = key("false: no test is possible")


class PrincipalComponents(Saved):
    """Principal components of the parameters, the largest first."""

    of: str = key('"correlation" or "covariance"')
    names: list[str] = key("of the parameters")
    positive_definite: bool = key("of the matrix")
    smallest_eigenvalue: float = key("of the matrix")
    eigenvalues: list[float] = key("descending")
    share_percent: list[float] = key("of their sum")
    cumulative_percent: list[float] = key("of their sum")
    vectors: list[list[float]] = key("parameter x component")
    loadings: list[list[float]] = key("parameter x component")
    values: list[float] = key("of the components")
    values_of: str = key('"standardised" parameters or their "values"')


class PointsMoved(Saved):
    """How far adjusted points moved."""

    count: int = key("points compared")
    rms_mm: float = key("of the distance", of="rms_m", times=MM)
    largest_mm: float = key("distance", of="largest_m", times=MM)
    largest_point: str = key("that moved most")
    axis_rms_mm: list[float] = key("x, y, z", of="axis_rms_m", times=MM)
    axis_largest_mm: list[float] = key("x, y, z", of="axis_largest_m", times=MM)
    rms_sds: float = key("of each coordinate's change over its own sd")
    largest_sds: float = key("largest of these")
    largest_sds_point: str = key("its point")


class TopOfTable(Saved):
    """The volume at the top of the table; null: no tank, or no capacity."""

    volume_m3: float | None = key("at the top", of="value_m3")
    volume_u_m3: float | None = key("standard uncertainty", of="u_m3")
    volume_U_m3: float | None = key("expanded uncertainty", of="U_m3")
    height_m: float | None = key("dip of the top")
    wall_points: int | None = key("of the wall", of="points")


class TrialWithout(Saved):
    """The survey without some parameters; sigma0 and what follows null: not adjusted again."""

    names: list[str] = key("of those let go")
    because: list[str] = key('"single", "group", "silva", "pessoa", "advised" (all that may go)')
    comparable: bool = key("false where more than this set changed: the prediction is of another")
    kept: list[str] = key("the lists below are in their order")
    positive_definite: bool = key("false: those let go cannot be told apart")
    values_predicted: list[float] = key("of those kept")
    sds_predicted: list[float] = key("of those kept")
    correlation_predicted: list[list[float]] = key("of those kept")
    failed: str | None = key("why it could not be adjusted, or (with points) has no volume")
    sigma0: float | None = key("of the adjustment")
    values_adjusted: list[float] | None = key("of those kept")
    sds_adjusted: list[float] | None = key("for the sigma0 of the survey with all parameters")
    correlation_adjusted: list[list[float]] | None = key("of those kept")
    points: PointsMoved | None = key("against the survey with all parameters")
    volume_change_m3: float | None = key("at the top of the table")


class TrialWithVolume(TopOfTable, TrialWithout):
    """A trial, and the volume at the top of the table without these parameters."""


class WhyNoVolume(Saved):
    """The first key of what the survey with all parameters gives."""

    no_volume: str | None = key("why there is no volume")


class WithAll(TopOfTable, WhyNoVolume):
    """The volume at the top of the table with all parameters."""


class Loading(Saved):
    """How a parameter loads on a component."""

    name: str = key("of the parameter")
    loading: float = key("on the component")


class HighComponent(Saved):
    """A component on which two or more parameters load high."""

    component: int = key("number, from 1")
    share_percent: float = key("of the eigenvalues")
    high: list[Loading] = key("of those that load high")


class SilvasRule(Saved):
    """What Silva's rule says."""

    may_go: int = key("number of components with a negligible share")
    negligible_percent: float = key("limit of the share")
    loading: float = key("limit of the loading")
    alike: float = key("limit of likeness")
    drop: list[str] = key("names, in the order in which they go")
    components: list[HighComponent] = key("on which two or more load high")


class KeptBecause(Saved):
    """A parameter that Pessoa's rule keeps."""

    name: str = key("of the parameter")
    because: str = key('"significant", "edge", "both" or "not_known"')


class PessoasRule(Saved):
    """What Pessoa's rule says."""

    limit_px: float | None = key("that the shift of a corner is compared with")
    limit_um: float | None = key("the same; the one not used is null")
    drop: list[str] = key("names")
    keep: list[KeptBecause] = key("the others")


class PublishedRules(Saved):
    """What published rules say."""

    silva: SilvasRule = key("Silva 1995")
    pessoa: PessoasRule = key("Pessoa")


class ParametersFile(CameraFile, kw_only=True):
    """What the parameters of one set are worth."""

    kind: Literal["parameters"] = key("parameters", default="parameters")
    camera: str = key("name", of="interior.camera")
    photos: list[str] | None = key("when the set is not the whole camera's", of="interior.photos")
    source: str = key('"job" or "record"', named="from")
    convention: str = key("sign of the distortion's terms", of="interior.form.convention")
    affinity: str = key("form of the affinity terms", of="interior.form.affinity")
    radial_balance_mm: float = key("of the model", of="interior.form.radial_balance_mm")
    format_mm: list[float] | None = key("width and height", of="interior.format_mm")
    pixel_mm: list[float] | None = key("sides of a pixel", of="interior.frame.pixel_mm")
    half_frame_mm: list[float] = key("half width and height", of="interior.frame.half_mm")
    frame_known: bool = key("declared, or only seen", of="interior.frame_known")
    reach_mm: float = key("of the farthest image point", of="interior.frame.reach_mm")
    corner_mm: float = key("of the corners from the middle", of="interior.frame.corner_mm")
    dof: float = key("of the adjustment; null: sigma0 was not estimated")
    sigma0: float = key("of the adjustment")
    scale: str = key('"a_posteriori" (sds contain sigma0, F test) or "a_priori" (chi-square)')
    alpha: float = key("level of the tests", of="choices.alpha")
    image_accuracy: ImageAccuracy | None = key("null: it is not known")
    parameters: list[ParameterJudged] = key("of the model")
    names: list[str] = key("of those adjusted: rows and columns of `correlation`")
    correlation: list[list[float]] = key("of those adjusted")
    groups: list[GroupTest] = key("tests of several together")
    components: PrincipalComponents = key("of the parameters")
    without: list[TrialWithVolume] = key("sets that could be let go")
    with_all: WithAll | None = key("null: of a record, nothing was adjusted again")
    rules: PublishedRules = key("what published rules say")
    recommendation: list[Advice] = key("reasons: {code, ...}")


def as_json(result):
    """The `ParametersFile` of a `parameters.CameraParameters`, as plain data."""
    limit, parts = result.limit, result.components
    known = not math.isnan(limit.um) or not math.isnan(limit.px)
    unscaled = parts.unscaled or parts.of == "covariance"
    found = filled_from(
        ParametersFile,
        result,
        image_accuracy=filled_from(ImageAccuracy, limit) if known else None,
        parameters=[_parameter(result, name) for name in result.own],
        groups=[filled_from(GroupTest, test) for test in result.groups],
        components=filled_from(
            PrincipalComponents, parts, values_of="values" if unscaled else "standardised"
        ),
        without=[_without(result, trial) for trial in result.trials],
        with_all=result.base and WithAll(result.base[1], *_volume(result.base[0])),
        rules=PublishedRules(_silva(result.silva), _pessoa(result.pessoa)),
    )
    return to_plain(found)


def _parameter(result, name):
    interior, number = result.interior, PARAMETERS.index(name)
    adjusted = name in result.names
    test = result.tests[result.names.index(name)] if adjusted else None
    own, left = result.own[name], result.left.get(name) or (None, None)
    return ParameterJudged(
        name=name,
        unit=UNITS[name],
        value=interior.values[number],
        sd=result.sds[result.names.index(name)] if adjusted else 0.0,
        F=test and test.f,
        critical=test and test.critical,
        p_value=test and test.p_value,
        significant=test and test.significant,
        decides=test is None or test.decides,
        state=interior.state[number],
        scope=interior.scope[number],
        edge_um=own and own.corner_um,
        edge_px=own and own.corner_px,
        edge=EdgeShifts(own, *left),
    )


def _without(result, trial):
    predicted, outcome = trial.predicted, trial.outcome
    values, sds, correlation = _after(trial)
    volume = None if outcome is None else outcome.volume
    base = None if result.base is None else result.base[0]
    return TrialWithVolume(
        trial.names,
        trial.because,
        trial.comparable,
        predicted.kept,
        predicted.positive_definite,
        predicted.values,
        predicted.sds,
        predicted.correlation,
        outcome and outcome.failed,
        outcome.adjustment.sigma0 if outcome and outcome.adjustment else None,
        values,
        sds,
        correlation,
        outcome and filled_from(PointsMoved, outcome.moved),
        volume.value_m3 - base.value_m3 if volume and base else None,
        *_volume(volume),
    )


def _after(trial):
    """Values, sds, correlations of what is kept, as adjusted again; None three times without."""
    if trial.after is None:
        return None, None, None
    names, values, covariance = trial.after
    order = [names.index(name) for name in trial.predicted.kept]
    covariance = covariance[np.ix_(order, order)]
    sds = np.sqrt(np.diag(covariance))
    return values[order], sds, covariance / np.outer(sds, sds)


def _volume(volume):
    """The values of `TopOfTable`, None of None."""
    found = filled_from(TopOfTable, volume)
    return [None] * 5 if found is None else vars(found).values()


def _silva(rule):
    components = [
        HighComponent(number + 1, share, [Loading(*one) for one in high])
        for number, share, high in rule.high
    ]
    return filled_from(SilvasRule, rule, components=components)


def _pessoa(rule):
    return filled_from(PessoasRule, rule, keep=[KeptBecause(*one) for one in rule.keep])
