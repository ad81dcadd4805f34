"""Which parameters to keep: the rules of Silva and of Pessoa, and the recommendation of tankcal.

Silva: the number of parameters to drop is the number of components with a negligible share (0.7 %
in print, hence below 0.75 %). Of the parameters with loadings above 0.8 on the same component,
those with the smallest loadings are dropped. Loadings that differ by less than `alike` count as
equal (his tables reproduce to 0.05); of equal loadings the higher order is dropped. K2 and K3 are
therefore dropped before K1. Components are used in the order of their share. c, x0 and y0 are kept.

Pessoa: a parameter is kept if it is significant, or if it shifts the corner of the frame by the
image accuracy (0.5 px) or more. K3 is therefore kept, although F rejects it.

The recommendation gives the reasons as codes. No parameter is removed.

    significant                                         keep, even with a small effect
    not significant, effect below the image accuracy    may be dropped
    not significant, effect above the image accuracy    keep; test and effect disagree (reported)
    order lower than that of a kept parameter           keep (K1 with K3)

If the survey was adjusted again without the parameter, the change of points and volume decides. A
parameter is kept if this change is more than a third of their uncertainty. A parameter that is not
significant and changes them less may be dropped, whatever its effect at the edge. A stage of the
work may use a third of the error of the next stage (Merchant 1982, in Pessoa 2017).

Source: Silva 1995 (61-79 and chapter 5); Pessoa 2017 (11-13 and table 10).
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.model import PARAMETERS

NEGLIGIBLE_PERCENT, LOADING, ALIKE = 0.75, 0.8, 0.05  # limits of Silva's rule
LIMIT_PX = 0.5  # image accuracy in Pessoa's rule, px
BASIC = ("c", "x0", "y0")  # parameters that Silva's rule always keeps
PART = 1 / 3  # largest accepted change, as a share of the uncertainty
CORRELATED = 0.95  # correlation above which it is a reason
SEEN = 0.9  # distance of the farthest image point over that of the corner; below: extrapolation
FAMILIES = (("K1", "K2", "K3", "K4"), ("P1", "P3", "P4"), ("P2", "P3", "P4"))


@dataclass(frozen=True)
class SilvaRule:
    """Result of Silva's rule.

    Attributes
    ----------
    may_go : int
        Number of components with a negligible share.
    drop : tuple of str
        Names of the parameters to drop, in order; at most `may_go`.
    high : tuple
        Components with two or more high loadings: (index of the component from 0, share in %,
        ((name, loading), ...)).
    negligible_percent, loading, alike : float
        Limits of the rule.
    """

    may_go: int
    drop: tuple
    high: tuple
    negligible_percent: float
    loading: float
    alike: float


@dataclass(frozen=True)
class PessoaRule:
    """Result of Pessoa's rule.

    Attributes
    ----------
    limit_px, limit_um : float
        Accuracy for comparison with the shift of a corner; nan for the unit that is not used.
    drop : tuple of str
        Names of the parameters to drop.
    keep : tuple of (str, str)
        Name and reason: "significant", "edge", "both" or "not_known" (no test, or no limit for the
        shift).
    """

    limit_px: float
    limit_um: float
    drop: tuple
    keep: tuple


def silva_rule(components, *, negligible_percent=NEGLIGIBLE_PERCENT, alike=ALIKE):
    """Apply Silva's rule to principal components.

    Parameters
    ----------
    components : Components
        Principal components of the parameters.
    negligible_percent : float, optional
        Share below which a component is negligible, %.
    alike : float, optional
        Largest difference of loadings that count as equal.

    Returns
    -------
    SilvaRule
    """
    names, share = components.names, components.share_percent
    sizes = np.abs(np.nan_to_num(components.loadings))
    may_go = int(np.sum(share < negligible_percent))
    high, drop = [], []
    for number in range(len(names)):
        rows = np.flatnonzero(sizes[:, number] > LOADING).tolist()
        if len(rows) < 2:
            continue
        signed = components.loadings[:, number]
        high.append(
            (number, float(share[number]), tuple((names[i], float(signed[i])) for i in rows))
        )
        remaining = {names[i]: sizes[i, number] for i in rows if names[i] not in drop}
        while len(drop) < may_go and len(remaining) > 1:
            dropped = _smallest(remaining, alike)
            if dropped is None:
                break
            drop.append(dropped)
            del remaining[dropped]
    return SilvaRule(may_go, tuple(drop), tuple(high), negligible_percent, LOADING, alike)


def _smallest(loadings, alike):
    """Name of the parameter with the smallest loading, of equal loadings the highest order.

    None if all parameters are always kept (BASIC).
    """
    candidates = {name: size for name, size in loadings.items() if name not in BASIC}
    if not candidates:
        return None
    least = min(candidates.values())
    equal = [name for name, size in candidates.items() if size - least <= alike]
    return max(equal, key=_order)


def _order(name):
    """Order of a term (K3 above K2), then its index among the parameters."""
    power = int(name[1]) if name[0] in "KP" else 0
    return power, PARAMETERS.index(name) if name in PARAMETERS else 0


def pessoa_rule(tests, shifts, *, limit_px=LIMIT_PX, limit_um=np.nan):
    """Apply Pessoa's rule to single parameters.

    Parameters
    ----------
    tests : sequence of ZeroTest
        Test of each parameter.
    shifts : dict
        {name: Shift by the value of the parameter, or None}.
    limit_px : float, optional
        Image accuracy for comparison with the shift of the corner, px.
    limit_um : float, optional
        Image accuracy if the pixel size is not known, um.

    Returns
    -------
    PessoaRule
    """
    keep, drop, in_px = [], [], True
    for test in tests:
        (name,) = test.names
        shift = shifts.get(name)
        if not test.decides:
            keep.append((name, "significant"))
            continue
        in_px = shift is not None and np.isfinite(shift.corner_px) and in_px
        size = None if shift is None else shift.corner_px if in_px else shift.corner_um
        limit = limit_px if in_px else limit_um
        if size is None or np.isnan(limit) or test.significant is None:
            keep.append((name, "significant" if test.significant else "not_known"))
            continue
        reasons = (test.significant, size >= limit)
        if any(reasons):
            keep.append((name, "both" if all(reasons) else "significant" if reasons[0] else "edge"))
        else:
            drop.append(name)
    return PessoaRule(
        limit_px if in_px else np.nan, np.nan if in_px else limit_um, tuple(drop), tuple(keep)
    )


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
    test : ZeroTest
        Test of the parameter.
    own, left : Shift or None
        Shift by its value, and remaining shift if it is dropped.
    state : str
        "free" or "weighted".
    groups : tuple of ZeroTest
        Tests of the groups that contain the parameter.
    correlated : tuple of (str, float)
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
    correlated: tuple = ()
    product: dict | None = None
    failed: str | None = None


def recommend(evidence, limit, frame, held_back=()):
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
        Advice(item.name, True, (*item.reasons, {"code": "not_with_the_others"}))
        if item.name in held_back and not item.keep
        else item
        for item in advices
    ]
    kept = {item.name for item in advices if item.keep}
    return tuple(_keep_lower_orders(item, kept) for item in advices)


def _advise_on(evidence, limit, frame):
    """Create the Advice about a parameter from its own evidence, without the other parameters."""
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
        {"code": "correlated", "with": other, "correlation": r} for other, r in evidence.correlated
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


def _is_large(shift, limit):
    """Whether a shift at a corner reaches the image accuracy; None if it is not known."""
    if shift is None or np.isnan(limit.um):
        return None
    return shift.corner_um >= limit.um


def _reasons_of_effect(evidence, limit, significant, large):
    """Reasons from the effect of a parameter at the corner, compared with its test."""
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
    if changes_product(evidence.product):
        return True, ({"code": "product_moves", **evidence.product},)
    return (keep if significant else False), ({"code": "product_stays", **evidence.product},)


def make_joint_reasons(names, product, failed):
    """Create the reason about the effect of dropping several parameters together.

    Parameters
    ----------
    names : sequence of str
        Names of the parameters.
    product : dict or None
        Change of the product as in Evidence, or None if it is not known.
    failed : str or None
        Reason why the survey cannot be adjusted without the parameters.

    Returns
    -------
    tuple of dict
        At most one reason.
    """
    if failed is not None:
        return ({"code": "not_determined_without", "text": failed, "names": list(names)},)
    if product is None:
        return ()
    code = "together_move" if changes_product(product) else "together_stay"
    return ({"code": code, "names": list(names), **product},)


def changes_product(product):
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
