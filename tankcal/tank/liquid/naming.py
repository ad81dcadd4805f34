"""Identification of the cause of misclosures between liquid and geometry by tests.

The statistic of an alternative of free size is w of its column. For an alternative of known size
(temperatures in Fahrenheit), it is the square root of the reduction of chi-square. Alternatives
whose chi-square is not significantly larger than that of the most likely alternative are named with
it. Of a kind with many members (a dip, a batch), one member is more often large by chance. All
kinds have equal prior probability, shared among their members, which subtracts 2 ln(members) from
w^2.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.adjust import noncentrality

ALIKE = 3.84  # chi-square at 5 %: a smaller difference between two causes is not significant
LEAST = 4.0  # least |w| of a named cause


@dataclass(frozen=True)
class Alternative:
    """Possible cause of misclosures.

    Attributes
    ----------
    kind : str
        "meter", "radii", "dip", "dip_zero", "batch", "leak", "bottom", "fahrenheit", "swapped".
    column : ndarray, shape (n,)
        Change of the misclosures for one unit of the cause, m3.
    of : str or int or None
        Member of the kind: a meter, a row.
    unit : str
        Unit of the size: "1", "m", "m3"; "" for a cause that either applies or not.
    is_whole : bool
        True: the size is either one or zero.
    most : float
        Largest possible size; a cause with a larger estimate is not named.
    """

    kind: str
    column: np.ndarray
    of: object = None
    unit: str = "1"
    is_whole: bool = False
    most: float = np.inf


@dataclass(frozen=True)
class Verdict:
    """Result of the test of an alternative.

    Attributes
    ----------
    cause : Alternative
    size, sd, w : float
        Estimate, in its unit; its standard deviation (inf: the steps cannot determine it); signed
        w.
    detectable : float
        Smallest size detected with a power of 0.8 at 0.1 %.
    is_named : bool
        Whether the cause is the most likely, with a sufficiently large |w|, or is not significantly
        less likely.
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


def name_causes(adjusted, alternatives):
    """Return the `Verdict`s of all alternatives, the most likely first.

    Parameters
    ----------
    adjusted : LiquidAdjustment
    alternatives : sequence of Alternative

    Returns
    -------
    tuple of Verdict
    """
    if not alternatives:
        return ()
    columns = np.stack([alternative.column for alternative in alternatives], axis=1)
    size, sd, w = adjusted.test(columns)
    for place, alternative in enumerate(alternatives):
        if alternative.is_whole and np.isfinite(sd[place]):
            # Reduction of chi-square for the fixed size one: (size^2 - (size - 1)^2) / sd^2.
            reduction = (2 * size[place] - 1) / sd[place] ** 2
            w[place] = np.sqrt(max(reduction, 0.0))
    kinds = [alternative.kind for alternative in alternatives]
    score = w**2 - 2 * np.log([kinds.count(kind) for kind in kinds])
    order = np.argsort(-score, kind="stable")
    large = (np.abs(w) > LEAST) & (
        np.abs(size) <= [alternative.most for alternative in alternatives]
    )
    best = np.max(score[large], initial=-np.inf)
    # Score: w^2 less the penalty for the number of members of the kind.
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
