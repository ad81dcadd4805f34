"""Which parameters to drop: the rules of Silva and of Pessoa, each as its author applied it.

Silva: as many parameters can go as components have a negligible share (0.7 % in print, so below
0.75 %); among the parameters that load above 0.8 on the same component those of smallest loading
go. Loadings that differ by less than `alike` count as equal (his tables reproduce to 0.05), and of
equal ones the higher order goes: so K2 and K3 go, not K1. Components are taken in the order of
their share. c, x0 and y0 stay.

Pessoa: a parameter stays when it is significant, and also when it shifts the corner of the frame by
as much as the image accuracy (0.5 px): so K3 stays, although F rejects it.

Source: Silva 1995 (61-79 and chapter 5); Pessoa 2017 (11-13 and table 10).
"""

from dataclasses import dataclass

import numpy as np

from tankcal.camera.model import PARAMETERS

NEGLIGIBLE_PERCENT, LOADING, ALIKE = 0.75, 0.8, 0.05
LIMIT_PX = 0.5
BASIC = ("c", "x0", "y0")


@dataclass(frozen=True)
class SilvaRule:
    """What Silva's rule says.

    may_go              number of components with a negligible share
    drop                names, in the order in which they go; at most `may_go`
    high                for each component on which two or more load high: (number of the component,
                        share %, ((name, loading), ...)), the numbers from 0
    negligible_percent, loading, alike  the limits that were used
    """

    may_go: int
    drop: tuple
    high: tuple
    negligible_percent: float
    loading: float
    alike: float


@dataclass(frozen=True)
class PessoaRule:
    """What Pessoa's rule says.

    limit_px, limit_um  accuracy that the shift of a corner is compared with; the one not used: nan
    drop                names
    keep                (name, because): "significant", "edge", "both" or "not_known" (no test, or
                        no limit to compare the shift with)
    """

    limit_px: float
    limit_um: float
    drop: tuple
    keep: tuple


def silva_rule(
    components, *, negligible_percent=NEGLIGIBLE_PERCENT, loading=LOADING, alike=ALIKE, stay=BASIC
):
    """The SilvaRule of `components.Components`.

    negligible_percent  share below which a component is negligible
    loading             above which a parameter loads high on a component
    alike               loadings that differ by less count as equal; 0: none do
    stay                names that never go
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
        left = {names[i]: sizes[i, number] for i in rows if names[i] not in drop}
        while len(drop) < may_go and len(left) > 1:
            goes = _smallest(left, alike, stay)
            if goes is None:
                break
            drop.append(goes)
            del left[goes]
    return SilvaRule(may_go, tuple(drop), tuple(high), negligible_percent, loading, alike)


def _smallest(loadings, alike, stay):
    """Name of the smallest loading, the highest order of those that are alike; None: all stay."""
    able = {name: size for name, size in loadings.items() if name not in stay}
    if not able:
        return None
    least = min(able.values())
    near = [name for name, size in able.items() if size - least <= alike]
    return max(near, key=_order)


def _order(name):
    """Order of a term, K3 above K2; then its place among the parameters."""
    power = int(name[1]) if name[0] in "KP" else 0
    return power, PARAMETERS.index(name) if name in PARAMETERS else 0


def pessoa_rule(tests, shifts, *, limit_px=LIMIT_PX, limit_um=np.nan):
    """The PessoaRule of single parameters.

    tests     significance.AgainstZero of each parameter
    shifts    {name: edges.Shift of its value, or None}
    limit_px  image accuracy that the corner's shift is compared with
    limit_um  the same where the size of a pixel is not known
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
