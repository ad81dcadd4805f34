"""Recommendation for each parameter, with its reasons as codes; no parameter is removed.

    significant                                         keep, even with a small effect
    not significant, effect below the image accuracy    may be dropped
    not significant, effect above the image accuracy    keep; test and effect disagree (reported)
    order lower than that of a kept parameter           keep (K1 with K3)

If the survey was adjusted again without the parameter, the change of points and volume decides. A
parameter is kept if this change is more than a third of their uncertainty. A parameter that is not
significant and changes them less may be dropped, whatever its effect at the edge. A stage of the
work may use a third of the error of the next stage (Merchant 1982, in Pessoa 2017).
"""

from dataclasses import dataclass

import numpy as np

PART = 1 / 3  # largest accepted change, as a share of the uncertainty
CORRELATED = 0.95  # correlation above which it is a reason
SEEN = 0.9  # distance of the farthest image point over that of the corner; below: extrapolation
FAMILIES = (("K1", "K2", "K3", "K4"), ("P1", "P3", "P4"), ("P2", "P3", "P4"))


@dataclass(frozen=True)
class Limit:
    """Image accuracy for comparison with effects, um and px; nan if it is not known.

    `source` is "given", or "residuals" of the adjustment.
    """

    um: float
    px: float
    source: str


@dataclass(frozen=True)
class Advice:
    """Whether to keep a parameter, and the reasons: dicts with a "code" and numbers."""

    name: str
    keep: bool
    reasons: tuple[dict, ...]


@dataclass(frozen=True)
class Evidence:
    """Evidence for the recommendation about one parameter.

    Attributes
    ----------
    test : AgainstZero
        Test of the parameter.
    own, left : Shift or None
        Shift by its value, and remaining shift if it is dropped.
    state : str
        "free" or "weighted".
    groups : tuple of AgainstZero
        Tests of the groups that contain the parameter.
    alike : tuple of (str, float)
        Names and correlations of highly correlated parameters.
    product : dict or None
        Change by dropping the parameter: largest_sds, volume_change_m3, volume_u_m3; None if it is
        not known.
    failed : str or None
        Reason why the survey cannot be adjusted without the parameter.
    """

    test: object
    own: object
    left: object
    state: str = "free"
    groups: tuple = ()
    alike: tuple = ()
    product: dict | None = None
    failed: str | None = None


def advice(evidence, limit, frame, held_back=()):
    """Recommend which parameters to keep.

    Parameters
    ----------
    evidence : sequence of Evidence
        Evidence for each parameter.
    limit : Limit
        Image accuracy.
    frame : Frame
        Frame of the image.
    held_back : sequence of str, optional
        Parameters that can be dropped alone, but not together with the others.

    Returns
    -------
    tuple of Advice
    """
    advices = [_advise_on(item, limit, frame) for item in evidence]
    advices = [
        _hold_back(item) if item.name in held_back and not item.keep else item for item in advices
    ]
    kept = {item.name for item in advices if item.keep}
    return tuple(_keep_lower_orders(item, kept) for item in advices)


def _advise_on(evidence, limit, frame):
    (name,) = evidence.test.names
    if not evidence.test.decides:
        return Advice(name, True, ({"code": "principal"},))
    tested = {"F": evidence.test.f, "critical": evidence.test.critical}
    significant = evidence.test.significant is not False
    reasons = [{"code": "significant" if significant else "not_significant", **tested}]
    large = _is_large(evidence.own, limit)
    reasons += _reasons_of_effect(evidence, limit, significant, large)
    extrapolated = large and evidence.own.seen_um < evidence.own.corner_um
    if extrapolated and frame.reach_mm < SEEN * frame.corner_mm:
        reasons.append(
            {
                "code": "corner_not_seen",
                "reach_mm": frame.reach_mm,
                "corner_mm": frame.corner_mm,
                "seen_um": evidence.own.seen_um,
                "seen_px": evidence.own.seen_px,
            }
        )
    reasons += [
        {"code": "correlated", "with": other, "correlation": r} for other, r in evidence.alike
    ]
    if not significant:
        reasons += [
            {"code": "group_significant", "names": list(g.names), "F": g.f, "critical": g.critical}
            for g in evidence.groups
            if g.significant
        ]
    if evidence.state == "weighted":
        reasons.append({"code": "known_beforehand"})
    keep, last = _decide_by_product(evidence, significant or large is not False, significant)
    return Advice(name, keep, (*reasons, *last))


def _hold_back(item):
    return Advice(item.name, True, (*item.reasons, {"code": "not_with_the_others"}))


def _is_large(shift, limit):
    """Whether a shift at a corner reaches the image accuracy; None if it is not known."""
    if shift is None or np.isnan(limit.um):
        return None
    return shift.corner_um >= limit.um


def _reasons_of_effect(evidence, limit, significant, large):
    if large is None:
        return [{"code": "effect_not_known"}]
    sizes = {
        "edge_um": evidence.own.corner_um, "edge_px": evidence.own.corner_px,
        "limit_um": limit.um, "limit_px": limit.px,
    }  # fmt: skip
    reasons = [{"code": "effect_above" if large else "effect_below", **sizes}]
    if significant and not large:
        reasons.append({"code": "significant_but_tiny"})
    if large and not significant:
        left = {"left_um": np.nan, "left_px": np.nan}
        if evidence.left is not None:
            left = {"left_um": evidence.left.corner_um, "left_px": evidence.left.corner_px}
        reasons.append({"code": "insignificant_but_large", **left})
    return reasons


def _decide_by_product(evidence, keep, significant):
    """Final decision to keep the parameter, and the reason from the change of the product."""
    if evidence.failed is not None:
        return True, ({"code": "not_determined_without", "text": evidence.failed},)
    if evidence.product is None:
        return keep, ({"code": "product_not_tried"},) if keep and not significant else ()
    if moves(evidence.product):
        return True, ({"code": "product_moves", **evidence.product},)
    return (keep if significant else False), ({"code": "product_stays", **evidence.product},)


def reasons_together(names, product, failed):
    """Return at most one reason about the effect of dropping several parameters together."""
    if failed is not None:
        return ({"code": "not_determined_without", "text": failed, "names": list(names)},)
    if product is None:
        return ()
    code = "together_move" if moves(product) else "together_stay"
    return ({"code": code, "names": list(names), **product},)


def moves(product):
    """Whether points or volume change by more than PART of their uncertainty."""
    volume, u = product["volume_change_m3"], product["volume_u_m3"]
    known = volume is not None and u is not None and u > 0
    return bool(product["largest_sds"] > PART or (known and abs(volume) > PART * u))


def _keep_lower_orders(item, kept):
    """Keep a parameter if a higher order of its family is kept."""
    higher = []
    for family in FAMILIES:
        if item.name in family[:-1]:
            after = family[family.index(item.name) + 1 :]
            higher += [name for name in after if name in kept and name not in higher]
    if item.keep or not higher:
        return item
    return Advice(item.name, True, (*item.reasons, {"code": "lower_order", "of": higher}))
