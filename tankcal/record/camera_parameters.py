"""What `parameters.CameraParameters` says, as plain data: one dict for each set of parameters.

Keys, in this order; every number is a float, null stands for what is not known or not finite.

    format, kind      "tankcal-camera/2", "parameters"
    camera            name                   photos     names when the set is not the whole camera's
    from              "job" | "record"       convention, affinity, radial_balance_mm  of the model
    format_mm, pixel_mm  [w, h] or null      half_frame_mm [2], frame_known: declared, or only seen
    reach_mm, corner_mm  distance of the farthest image point (null: not known) and of the corners
                      from the middle of the frame
    dof, sigma0       of the adjustment; dof null: sigma0 was not estimated
    scale             "a_posteriori" (sds contain sigma0, F test) | "a_priori" (chi-square)
    alpha             level of the tests
    image_accuracy    {um, px, from: "given" | "residuals"}; null when it is not known
    parameters        [{name, unit, value, sd, F, critical, p_value, significant, decides, state,
                        scope, edge_um, edge_px, edge {own, left, left_turned}}]
                      of the model; F to significant are null for a fixed one, whose sd is 0
                      decides    False for c: the test against 0 means nothing for a decision
                      edge_um    shift that the parameter makes in the worst corner of the frame
                      edge       each {corner_um, corner_px, largest_um, largest_px, rms_um, rms_px,
                                 seen_um, seen_px} (largest and rms over the frame; seen: largest
                                 within the reach of the image points) or null:
                                 own          of the value itself (null for c)
                                 left         what is left of it when the other parameters take over
                                              (their values without it, predicted)
                                 left_turned  the same after the camera has been turned to fit, too
    names             of the parameters that are adjusted: rows and columns of `correlation`
    correlation       [[...]]
    groups            [{names [], F, critical, p_value, significant, positive_definite}]
    components        {of: "correlation" | "covariance", names, positive_definite,
                       smallest_eigenvalue, eigenvalues [], share_percent [],
                       cumulative_percent [], vectors [[parameter][component]],
                       loadings [[parameter][component]], values [],
                       values_of: "standardised" | "values" of the parameters}
    without           [{names [], because ["single" | "group" | "silva" | "pessoa" | "advised"
                       (all that the recommendation lets go, together)], comparable,
                       kept [], positive_definite, values_predicted [], sds_predicted [],
                       correlation_predicted [[]], failed: null | text, sigma0, values_adjusted [],
                       sds_adjusted [], correlation_adjusted [[]], points, volume_m3,
                       volume_change_m3, volume_u_m3, volume_U_m3, height_m, wall_points}]
                      points  {count, rms_mm, largest_mm, largest_point, axis_rms_mm [3],
                               axis_largest_mm [3], rms_sds, largest_sds, largest_sds_point} | null
                      failed  why it could not be adjusted, or (with points) why it has no volume
                      null where nothing was adjusted again: sigma0 and all that follows. Lists are
                      in the order of `kept`; sds_adjusted are for the sigma0 of the survey with all
                      parameters, as the predicted ones are.
                      comparable  False where more than this set changed: the prediction is not of
                                  the same thing
    with_all          {no_volume: null | text, volume_m3, volume_u_m3, volume_U_m3, height_m,
                       wall_points}: with every parameter, to compare `without` with; null where
                      nothing was adjusted again
    rules             {silva {may_go, negligible_percent, loading, alike, drop [], components
                              [{component (from 1), share_percent, high [{name, loading}]}]},
                       pessoa {limit_px, limit_um, drop [], keep [{name, because: "significant" |
                              "edge" | "both" | "not_known"}]}}
    recommendation    [{name, keep, reasons [{code, ...}]}], codes:
                      principal            c belongs to every camera
                      significant          {F, critical}
                      not_significant      {F, critical}
                      effect_above         {edge_um, edge_px, limit_um, limit_px}
                      effect_below         {edge_um, edge_px, limit_um, limit_px}
                      effect_not_known     no image accuracy to compare it with
                      significant_but_tiny            the two disagree
                      insignificant_but_large {left_um, left_px}  the two disagree; left: what is
                                           left in the corner when the others take over
                      correlated           {with, correlation}
                      group_significant    {names, F, critical}: alone it may go, not all of them
                      lower_order          {of []}: stays because these higher terms stay
                      known_beforehand     its value was given with an sd: the test is of both
                      product_stays        {largest_sds, largest_mm, volume_change_m3, volume_u_m3}
                      product_moves        {largest_sds, largest_mm, volume_change_m3, volume_u_m3}
                      not_with_the_others  it may go alone; with the others the product moves
                      product_not_tried    nothing was adjusted again: it stays until it is tried
                      not_determined_without {text, [names]}
                      corner_not_seen      {reach_mm, corner_mm, seen_um, seen_px}: image points do
                                           not reach the corner, the effect there is extrapolated
                      together_stay        {names, largest_sds, largest_mm, volume_change_m3,
                      together_move         volume_u_m3}: all that may go, dropped at once
"""

import math
from dataclasses import asdict

import numpy as np

from tankcal.camera.model import PARAMETERS, UNITS
from tankcal.record.camera_versions import FORMAT
from tankcal.record.plain_data import plain


def as_json(result):
    """Plain dict of a `parameters.CameraParameters`; see the keys above."""
    interior, limit = result.interior, result.limit
    known = not math.isnan(limit.um) or not math.isnan(limit.px)
    return plain(
        {
            "format": FORMAT,
            "kind": "parameters",
            "camera": interior.camera,
            "photos": interior.photos,
            "from": result.source,
            "convention": interior.form.convention,
            "affinity": interior.form.affinity,
            "radial_balance_mm": interior.form.radial_balance_mm,
            "format_mm": interior.format_mm,
            "pixel_mm": interior.frame.pixel_mm,
            "half_frame_mm": interior.frame.half_mm,
            "frame_known": interior.frame_known,
            "reach_mm": interior.frame.reach_mm,
            "corner_mm": interior.frame.corner_mm,
            "dof": result.dof,
            "sigma0": result.sigma0,
            "scale": result.scale,
            "alpha": result.choices.alpha,
            "image_accuracy": {"um": limit.um, "px": limit.px, "from": limit.source}
            if known
            else None,
            "parameters": [_parameter(result, name) for name in result.own],
            "names": result.names,
            "correlation": result.correlation,
            "groups": [_group(test) for test in result.groups],
            "components": _components(result.components),
            "without": [_without(result, trial) for trial in result.trials],
            "with_all": None
            if result.base is None
            else {"no_volume": result.base[1], **_volume(result.base[0])},
            "rules": {"silva": _silva(result.silva), "pessoa": _pessoa(result.pessoa)},
            "recommendation": [
                {"name": one.name, "keep": one.keep, "reasons": list(one.reasons)}
                for one in result.recommendation
            ],
        }
    )


def _parameter(result, name):
    interior, number = result.interior, PARAMETERS.index(name)
    adjusted = name in result.names
    test = result.tests[result.names.index(name)] if adjusted else None
    own, (left, turned) = result.own[name], result.left.get(name) or (None, None)
    return {
        "name": name,
        "unit": UNITS[name],
        "value": interior.values[number],
        "sd": result.sds[result.names.index(name)] if adjusted else 0.0,
        "F": test and test.f,
        "critical": test and test.critical,
        "p_value": test and test.p_value,
        "significant": test and test.significant,
        "decides": test is None or test.decides,
        "state": interior.state[number],
        "scope": interior.scope[number],
        "edge_um": own and own.corner_um,
        "edge_px": own and own.corner_px,
        "edge": {
            "own": own and asdict(own),
            "left": left and asdict(left),
            "left_turned": turned and asdict(turned),
        },
    }


def _group(test):
    return {
        "names": test.names,
        "F": test.f,
        "critical": test.critical,
        "p_value": test.p_value,
        "significant": test.significant,
        "positive_definite": test.positive_definite,
    }


def _components(parts):
    return {
        "of": parts.of,
        "names": parts.names,
        "positive_definite": parts.positive_definite,
        "smallest_eigenvalue": parts.smallest_eigenvalue,
        "eigenvalues": parts.eigenvalues,
        "share_percent": parts.share_percent,
        "cumulative_percent": parts.cumulative_percent,
        "vectors": parts.vectors,
        "loadings": parts.loadings,
        "values": parts.values,
        "values_of": "values" if parts.unscaled or parts.of == "covariance" else "standardised",
    }


def _without(result, trial):
    predicted, outcome = trial.predicted, trial.outcome
    values, sds, correlation = _after(trial)
    volume = None if outcome is None else outcome.volume
    base = None if result.base is None else result.base[0]
    return {
        "names": trial.names,
        "because": trial.because,
        "comparable": trial.comparable,
        "kept": predicted.kept,
        "positive_definite": predicted.positive_definite,
        "values_predicted": predicted.values,
        "sds_predicted": predicted.sds,
        "correlation_predicted": predicted.correlation,
        "failed": outcome and outcome.failed,
        "sigma0": outcome.adjustment.sigma0 if outcome and outcome.adjustment else None,
        "values_adjusted": values,
        "sds_adjusted": sds,
        "correlation_adjusted": correlation,
        "points": _points(outcome.moved) if outcome and outcome.moved else None,
        "volume_change_m3": volume.value_m3 - base.value_m3 if volume and base else None,
        **_volume(volume),
    }


def _after(trial):
    """Values, sds, correlations of what is kept, as adjusted again; None three times without."""
    if trial.after is None:
        return None, None, None
    names, values, covariance = trial.after
    order = [names.index(name) for name in trial.predicted.kept]
    covariance = covariance[np.ix_(order, order)]
    sds = np.sqrt(np.diag(covariance))
    return values[order], sds, covariance / np.outer(sds, sds)


def _points(moved):
    return {
        "count": moved.count,
        "rms_mm": 1e3 * moved.rms_m,
        "largest_mm": 1e3 * moved.largest_m,
        "largest_point": moved.largest_point,
        "axis_rms_mm": 1e3 * moved.axis_rms_m,
        "axis_largest_mm": 1e3 * moved.axis_largest_m,
        "rms_sds": moved.rms_sds,
        "largest_sds": moved.largest_sds,
        "largest_sds_point": moved.largest_sds_point,
    }


def _volume(volume):
    return {
        "volume_m3": volume and volume.value_m3,
        "volume_u_m3": volume and volume.u_m3,
        "volume_U_m3": volume and volume.U_m3,
        "height_m": volume and volume.height_m,
        "wall_points": volume and volume.points,
    }


def _silva(rule):
    return {
        "may_go": rule.may_go,
        "negligible_percent": rule.negligible_percent,
        "loading": rule.loading,
        "alike": rule.alike,
        "drop": rule.drop,
        "components": [
            {
                "component": number + 1,
                "share_percent": share,
                "high": [{"name": name, "loading": size} for name, size in high],
            }
            for number, share, high in rule.high
        ],
    }


def _pessoa(rule):
    return {
        "limit_px": rule.limit_px,
        "limit_um": rule.limit_um,
        "drop": rule.drop,
        "keep": [{"name": name, "because": because} for name, because in rule.keep],
    }
