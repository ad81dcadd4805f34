"""Significance of the parameters of a camera: kind "parameters" of camera.json.

Codes of `recommendation[].reasons`:

    principal            c belongs to every camera
    significant          {F, critical}
    not_significant      {F, critical}
    effect_above         {edge_um, edge_px, limit_um, limit_px}
    effect_below         {edge_um, edge_px, limit_um, limit_px}
    effect_not_known     no image accuracy for comparison
    significant_but_tiny            test and effect disagree
    insignificant_but_large {left_um, left_px}  test and effect disagree; left: remaining effect in
                         the corner after compensation by other parameters
    correlated           {with, correlation}
    group_significant    {names, F, critical}: it may be dropped alone, but not the whole group
    lower_order          {of []}: kept since these higher terms are kept
    known_beforehand     its value was declared with an sd: the test includes both
    product_stays        {largest_sds, largest_mm, volume_change_m3, volume_u_m3}
    product_moves        {largest_sds, largest_mm, volume_change_m3, volume_u_m3}
    not_with_the_others  it may be dropped alone; together with others the product changes
    product_not_tried    no further adjustment: it is kept until the product is tested
    not_determined_without {text, [names]}
    corner_not_seen      {reach_mm, corner_mm, seen_um, seen_px}: image points do not reach the
                         corner, where the effect is extrapolated
    together_stay, together_move  {names, largest_sds, largest_mm, volume_change_m3, volume_u_m3}:
                         all removable parameters, dropped at once
"""

import math
from dataclasses import fields
from typing import Literal

import numpy as np

from tankcal.calibration.interiors import Shift
from tankcal.calibration.parameters.recommendation import Advice
from tankcal.camera.model import PARAMETERS, UNITS
from tankcal.record.camera_versions import CameraFile
from tankcal.record.schema import Saved, fill_from, key, to_plain

MM = 1e3


class ImageAccuracy(Saved):
    """Image accuracy with which effects are compared."""

    um: float = key("micrometres")
    px: float = key("pixels")
    source: str = key('"given" or "residuals"', named="from")


class EdgeShifts(Saved):
    """Shifts over the frame: largest and rms; seen: largest within reach of the image points."""

    own: Shift | None = key("of the value itself (null for c)")
    left: Shift | None = key("predicted remainder after compensation by other parameters")
    left_turned: Shift | None = key("predicted remainder after compensation also by a rotation")


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
    decides: bool = key("false for c, for which the test against 0 is not relevant")
    state: str = key('"free", "weighted" or "fixed"')
    scope: str = key('"off", "block", "camera" or "photo"')
    edge_um: float | None = key("shift of the worst corner of the frame by the value")
    edge_px: float | None = key("shift of this corner in pixels")
    edge: EdgeShifts = key("over the frame")


class GroupTest(Saved):
    """Joint test of several parameters against zero."""

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
    """Changes of the adjusted points."""

    count: int = key("points compared")
    rms_mm: float = key("of the distance", of="rms_m", times=MM)
    largest_mm: float = key("distance", of="largest_m", times=MM)
    largest_point: str = key("with the largest change")
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
    """The survey without some parameters; null from sigma0 on if it was not adjusted again."""

    names: list[str] = key("of the dropped parameters")
    because: list[str] = key('"single", "group", "silva", "pessoa", "advised" (all removable)')
    comparable: bool = key("false if other sets changed too, unlike in the prediction")
    kept: list[str] = key("names, in the order of the following lists")
    positive_definite: bool = key("false: the dropped parameters are not separable")
    values_predicted: list[float] = key("of the kept parameters")
    sds_predicted: list[float] = key("of the kept parameters")
    correlation_predicted: list[list[float]] = key("of the kept parameters")
    failed: str | None = key("reason of a failed adjustment, or (with points) of a missing volume")
    sigma0: float | None = key("of the adjustment")
    values_adjusted: list[float] | None = key("of the kept parameters")
    sds_adjusted: list[float] | None = key("for the sigma0 of the survey with all parameters")
    correlation_adjusted: list[list[float]] | None = key("of the kept parameters")
    points: PointsMoved | None = key("against the survey with all parameters")
    volume_change_m3: float | None = key("at the top of the table")


class TrialWithVolume(TopOfTable, TrialWithout):
    """A trial, and the volume at the top of the table without these parameters."""


class WhyNoVolume(Saved):
    """The first key of the survey with all parameters."""

    no_volume: str | None = key("reason of a missing volume")


class WithAll(TopOfTable, WhyNoVolume):
    """The volume at the top of the table with all parameters."""


class Loading(Saved):
    """Loading of a parameter on a component."""

    name: str = key("of the parameter")
    loading: float = key("on the component")


class HighComponent(Saved):
    """A component with high loadings of two or more parameters."""

    component: int = key("number, from 1")
    share_percent: float = key("of the eigenvalues")
    high: list[Loading] = key("high loadings")


class SilvasRule(Saved):
    """Result of Silva's rule."""

    may_go: int = key("number of components with a negligible share")
    negligible_percent: float = key("limit of the share")
    loading: float = key("limit of the loading")
    alike: float = key("limit of likeness")
    drop: list[str] = key("names, in the order of removal")
    components: list[HighComponent] = key("with two or more high loadings")


class KeptBecause(Saved):
    """A parameter that Pessoa's rule keeps."""

    name: str = key("of the parameter")
    because: str = key('"significant", "edge", "both" or "not_known"')


class PessoasRule(Saved):
    """Result of Pessoa's rule."""

    limit_px: float | None = key("limit of the shift of a corner; null: limit_um is used")
    limit_um: float | None = key("limit of the shift of a corner; null: limit_px is used")
    drop: list[str] = key("names")
    keep: list[KeptBecause] = key("all other parameters")


class PublishedRules(Saved):
    """Results of published rules."""

    silva: SilvasRule = key("Silva 1995")
    pessoa: PessoasRule = key("Pessoa")


class ParametersFile(CameraFile, kw_only=True):
    """Significance of the parameters of a set."""

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
    frame_known: bool = key("declared, not estimated from image points", of="interior.frame_known")
    reach_mm: float = key("of the farthest image point", of="interior.frame.reach_mm")
    corner_mm: float = key("of the corners from the middle", of="interior.frame.corner_mm")
    dof: float = key("of the adjustment; null: sigma0 was not estimated")
    sigma0: float = key("of the adjustment")
    scale: str = key('"a_posteriori" (sds contain sigma0, F test) or "a_priori" (chi-square)')
    alpha: float = key("level of the tests", of="choices.alpha")
    image_accuracy: ImageAccuracy | None = key("null: it is not known")
    parameters: list[ParameterJudged] = key("of the model")
    names: list[str] = key("of adjusted parameters: rows and columns of `correlation`")
    correlation: list[list[float]] = key("of the adjusted parameters")
    groups: list[GroupTest] = key("joint tests of several parameters")
    components: PrincipalComponents = key("of the parameters")
    without: list[TrialWithVolume] = key("sets of removable parameters")
    with_all: WithAll | None = key("null: of a record, not adjusted again")
    rules: PublishedRules = key("results of published rules")
    recommendation: list[Advice] = key("reasons: {code, ...}")


def plain_parameters(result):
    """Return the `ParametersFile` of a `judgement.CameraParameters`, as plain data."""
    limit, parts = result.limit, result.components
    known = not math.isnan(limit.um) or not math.isnan(limit.px)
    unscaled = parts.unscaled or parts.of == "covariance"
    components = [
        HighComponent(number + 1, share, [Loading(*loading) for loading in high])
        for number, share, high in result.silva.high
    ]
    file = fill_from(
        ParametersFile,
        result,
        image_accuracy=fill_from(ImageAccuracy, limit) if known else None,
        parameters=[_parameter(result, name) for name in result.own],
        groups=[fill_from(GroupTest, test) for test in result.groups],
        components=fill_from(
            PrincipalComponents, parts, values_of="values" if unscaled else "standardised"
        ),
        without=[_trial(result, trial) for trial in result.trials],
        with_all=result.base and WithAll(result.base[1], *_volume(result.base[0])),
        rules=PublishedRules(
            fill_from(SilvasRule, result.silva, components=components),
            fill_from(
                PessoasRule, result.pessoa, keep=[KeptBecause(*kept) for kept in result.pessoa.keep]
            ),
        ),
    )
    return to_plain(file)


def _parameter(result, name):
    interior, number = result.interior, PARAMETERS.index(name)
    adjusted = name in result.names
    test = result.tests[result.names.index(name)] if adjusted else None
    shift, remainders = result.own[name], result.left.get(name) or (None, None)
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
        edge_um=shift and shift.corner_um,
        edge_px=shift and shift.corner_px,
        edge=EdgeShifts(shift, *remainders),
    )


def _trial(result, trial):
    predicted, outcome = trial.predicted, trial.outcome
    values, sds, correlation = _adjusted_values(trial)
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
        outcome and fill_from(PointsMoved, outcome.changes),
        volume.value_m3 - base.value_m3 if volume and base else None,
        *_volume(volume),
    )


def _adjusted_values(trial):
    """Return values, sds and correlations of kept parameters; three times None if not adjusted."""
    if trial.after is None:
        return None, None, None
    names, values, covariance = trial.after
    order = [names.index(name) for name in trial.predicted.kept]
    covariance = covariance[np.ix_(order, order)]
    sds = np.sqrt(np.diag(covariance))
    return values[order], sds, covariance / np.outer(sds, sds)


def _volume(volume):
    """Return the values of `TopOfTable`; each is None without volume."""
    top = fill_from(TopOfTable, volume)
    return [None] * len(fields(TopOfTable)) if top is None else vars(top).values()
