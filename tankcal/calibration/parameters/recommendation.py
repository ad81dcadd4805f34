"""Our own recommendation for each parameter, with its reasons as codes; never a deletion.

    significant                                  stays, also when its effect is tiny
    not significant, effect under the image accuracy    may be dropped
    not significant, effect above it             stays: test and effect disagree, which is said
    lower order than one that stays              stays (K1 with K3)

What dropping it does to the points and to the volume decides last, where it was tried: a parameter
whose absence moves them by more than a third of their uncertainty stays; one that is not
significant and moves them by less may be dropped, whatever its effect at the edge (a stage of the
work may use a third of the error of the next: Merchant 1982, in Pessoa 2017).
"""

from dataclasses import dataclass

import numpy as np

PART = 1 / 3  # of an uncertainty that a change may use up
CORRELATED = 0.95
SEEN = 0.9  # reach of the image points over that of the corner: less leaves the corner to guess
FAMILIES = (("K1", "K2", "K3", "K4"), ("P1", "P3", "P4"), ("P2", "P3", "P4"))


@dataclass(frozen=True)
class Limit:
    """Image accuracy that effects are compared with; nan: not known.

    source  "given", or "residuals" of the adjustment
    """

    um: float
    px: float
    source: str


@dataclass(frozen=True)
class Advice:
    """Whether a parameter should be kept, and why: dicts with a "code" and numbers."""

    name: str
    keep: bool
    reasons: tuple[dict, ...]


@dataclass(frozen=True)
class Evidence:
    """What is known of one parameter.

    test     significance.AgainstZero           own, left  edges.Shift or None
    state    "free" or "weighted"               product    change by dropping it, dict with
    groups   tuple of AgainstZero that hold it             largest_sds, volume_change_m3 and
    alike    ((name, correlation), ...)                    volume_u_m3; None: not known
    failed   why it cannot be dropped, or None
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
    """A tuple of Advice; evidence is a tuple of Evidence, limit a Limit, frame an edges.Frame.

    held_back  names that could go alone, but not with the others that may go
    """
    found = [_advice(one, limit, frame) for one in evidence]
    found = [_held(one) if one.name in held_back and not one.keep else one for one in found]
    stays = {one.name for one in found if one.keep}
    return tuple(_with_higher_orders(one, stays) for one in found)


def _advice(one, limit, frame):
    (name,) = one.test.names
    if not one.test.decides:
        return Advice(name, True, ({"code": "principal"},))
    tested = {"F": one.test.f, "critical": one.test.critical}
    significant = one.test.significant is not False
    reasons = [{"code": "significant" if significant else "not_significant", **tested}]
    large = _large(one.own, limit)
    reasons += _of_effect(one, limit, significant, large)
    extrapolated = large and one.own.seen_um < one.own.corner_um
    if extrapolated and frame.reach_mm < SEEN * frame.corner_mm:
        reasons.append(
            {
                "code": "corner_not_seen",
                "reach_mm": frame.reach_mm,
                "corner_mm": frame.corner_mm,
                "seen_um": one.own.seen_um,
                "seen_px": one.own.seen_px,
            }
        )
    reasons += [{"code": "correlated", "with": other, "correlation": r} for other, r in one.alike]
    if not significant:
        reasons += [
            {"code": "group_significant", "names": list(g.names), "F": g.f, "critical": g.critical}
            for g in one.groups
            if g.significant
        ]
    if one.state == "weighted":
        reasons.append({"code": "known_beforehand"})
    keep, last = _decided(one, significant or large is not False, significant)
    return Advice(name, keep, (*reasons, *last))


def _held(one):
    return Advice(one.name, True, (*one.reasons, {"code": "not_with_the_others"}))


def _large(shift, limit):
    """Whether a shift reaches the image accuracy; None: not known."""
    if shift is None or np.isnan(limit.um):
        return None
    return shift.corner_um >= limit.um


def _of_effect(one, limit, significant, large):
    if large is None:
        return [{"code": "effect_not_known"}]
    sizes = {
        "edge_um": one.own.corner_um, "edge_px": one.own.corner_px,
        "limit_um": limit.um, "limit_px": limit.px,
    }  # fmt: skip
    found = [{"code": "effect_above" if large else "effect_below", **sizes}]
    if significant and not large:
        found.append({"code": "significant_but_tiny"})
    if large and not significant:
        left = {"left_um": np.nan, "left_px": np.nan}
        if one.left is not None:
            left = {"left_um": one.left.corner_um, "left_px": one.left.corner_px}
        found.append({"code": "insignificant_but_large", **left})
    return found


def _decided(one, keep, significant):
    """Whether it stays after all, and what its absence does to the product."""
    if one.failed is not None:
        return True, ({"code": "not_determined_without", "text": one.failed},)
    if one.product is None:
        return keep, ({"code": "product_not_tried"},) if keep and not significant else ()
    if moves(one.product):
        return True, ({"code": "product_moves", **one.product},)
    return (keep if significant else False), ({"code": "product_stays", **one.product},)


def reasons_together(names, product, failed):
    """Reasons (0 or 1) that say what dropping all of several parameters does at once."""
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


def _with_higher_orders(one, stays):
    """The Advice, kept when a higher term of its family is."""
    higher = []
    for family in FAMILIES:
        if one.name in family[:-1]:
            after = family[family.index(one.name) + 1 :]
            higher += [name for name in after if name in stays and name not in higher]
    if one.keep or not higher:
        return one
    return Advice(one.name, True, (*one.reasons, {"code": "lower_order", "of": higher}))
