"""Rules of Silva and of Pessoa for dropping parameters, each as its author applied it.

Silva: the number of parameters to drop is the number of components with a negligible share (0.7 %
in print, hence below 0.75 %). Of the parameters with loadings above 0.8 on the same component,
those with the smallest loadings are dropped. Loadings that differ by less than `alike` count as
equal (his tables reproduce to 0.05); of equal loadings the higher order is dropped. K2 and K3 are
therefore dropped before K1. Components are used in the order of their share. c, x0 and y0 are kept.

Pessoa: a parameter is kept if it is significant, or if it shifts the corner of the frame by the
image accuracy (0.5 px) or more. K3 is therefore kept, although F rejects it.

Source: Silva 1995 (61-79 and chapter 5); Pessoa 2017 (11-13 and table 10).
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.model import PARAMETERS

NEGLIGIBLE_PERCENT, LOADING, ALIKE = 0.75, 0.8, 0.05  # limits of Silva's rule
LIMIT_PX = 0.5  # image accuracy in Pessoa's rule, px
BASIC = ("c", "x0", "y0")  # parameters that Silva's rule always keeps


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


def silva_rule(
    components, *, negligible_percent=NEGLIGIBLE_PERCENT, loading=LOADING, alike=ALIKE, stay=BASIC
):
    """Apply Silva's rule to principal components.

    Parameters
    ----------
    components : Components
        Principal components of the parameters.
    negligible_percent : float, optional
        Share below which a component is negligible, %.
    loading : float, optional
        Loading above which a parameter has a high loading.
    alike : float, optional
        Largest difference of loadings that count as equal.
    stay : sequence of str, optional
        Parameters that are always kept.

    Returns
    -------
    SilvaRule
    """
    names, share = components.names, components.share_percent
    sizes = np.abs(np.nan_to_num(components.loadings))
    may_go = int(np.sum(share < negligible_percent))
    high, drop = [], []
    for number in range(len(names)):
        rows = np.flatnonzero(sizes[:, number] > loading).tolist()
        if len(rows) < 2:
            continue
        signed = components.loadings[:, number]
        high.append(
            (number, float(share[number]), tuple((names[i], float(signed[i])) for i in rows))
        )
        remaining = {names[i]: sizes[i, number] for i in rows if names[i] not in drop}
        while len(drop) < may_go and len(remaining) > 1:
            dropped = _smallest(remaining, alike, stay)
            if dropped is None:
                break
            drop.append(dropped)
            del remaining[dropped]
    return SilvaRule(may_go, tuple(drop), tuple(high), negligible_percent, loading, alike)


def _smallest(loadings, alike, stay):
    """Name of the parameter with the smallest loading, of equal loadings the highest order.

    None if all parameters are kept.
    """
    candidates = {name: size for name, size in loadings.items() if name not in stay}
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
    tests : sequence of AgainstZero
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
