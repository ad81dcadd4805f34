"""Which cause misclosures of liquid and geometry have: each is tested, the likeliest named.

An alternative of free size has w of its column; one of a known size (temperatures in Fahrenheit)
the square root of what chi-square loses by it. Alternatives that explain the misclosures nearly as
well as the likeliest, as far as chi-square tells two of them apart, are named with it. Of a kind
with many members (a dip, a batch) one is large by chance sooner: every kind is as likely as any
other beforehand, and its members share that, which takes 2 ln(members) off their w^2.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.adjust import noncentrality

ALIKE = 3.84  # of chi-square: two causes that differ by less cannot be told apart, at 5 %
LEAST = 4.0  # |w| from which a cause is named


@dataclass(frozen=True)
class Alternative:
    """A cause that misclosures may have.

    Attributes
    ----------
    kind : str
        "meter", "radii", "dip", "dip_zero", "batch", "leak", "bottom", "fahrenheit", "swapped".
    column : ndarray, shape (n,)
        What one unit of it adds to the misclosures, m3.
    of : str or int or None
        Of several of a kind which: a meter, a row.
    unit : str
        Of its size: "1", "m", "m3"; "" of one that is so or not.
    is_whole : bool
        True: its size is one, or it is not so.
    most : float
        The largest size that it may have; a test that asks for a larger one does not name it.
    """

    kind: str
    column: np.ndarray
    of: object = None
    unit: str = "1"
    is_whole: bool = False
    most: float = np.inf


@dataclass(frozen=True)
class Verdict:
    """How an alternative fared.

    Attributes
    ----------
    cause : Alternative
    size, sd, w : float
        Estimate, in its unit; sd of it (inf: the steps cannot show it); w signed.
    detectable : float
        The smallest size that the test would show, with power 0.8 at 0.1 %.
    is_named : bool
        The likeliest, where |w| is large enough, and those that cannot be told from it.
    undetected_U : float or None
        External reliability: largest change of a volume of the table by an error of the size
        `detectable`, over the U of that volume; None: not computed for causes of this kind.
    """

    cause: Alternative
    size: float
    sd: float
    w: float
    detectable: float
    is_named: bool = False
    undetected_U: float | None = None


def name_causes(found, alternatives):
    """`Verdict`s of all alternatives, the likeliest first.

    Parameters
    ----------
    found : LiquidAdjustment
    alternatives : sequence of Alternative

    Returns
    -------
    tuple of Verdict
    """
    if not alternatives:
        return ()
    columns = np.stack([one.column for one in alternatives], axis=1)
    size, sd, w = found.test(columns)
    for place, one in enumerate(alternatives):
        if one.is_whole and np.isfinite(sd[place]):
            lost = (2 * size[place] - 1) / sd[place] ** 2
            w[place] = np.sqrt(max(lost, 0.0))
    kinds = [one.kind for one in alternatives]
    score = w**2 - 2 * np.log([kinds.count(kind) for kind in kinds])
    order = np.argsort(-score, kind="stable")
    large = (np.abs(w) > LEAST) & (np.abs(size) <= [one.most for one in alternatives])
    best = np.max(score[large], initial=-np.inf)
    named = large & (best - score < ALIKE)
    delta = noncentrality()
    return tuple(
        Verdict(
            alternatives[i],
            float(size[i]),
            float(sd[i]),
            float(w[i]),
            float(delta * sd[i]),
            bool(named[i]),
        )
        for i in order
    )
