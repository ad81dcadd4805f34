"""Formulas of the coverage factor for integer and non-integer degrees of freedom v.

The function TINV truncates degrees of freedom to integers, unlike the record. Up to v = 1000,
Student's t follows exactly from the beta distribution, since t^2 / (v + t^2) is Beta(1/2, v/2).
Above, Fisher's expansion is used up to the fourth power of 1/v. Source: Abramowitz and Stegun,
Handbook of Mathematical Functions, 26.5.27 and 26.7.5.
"""

_MOST_BETA = 1000  # largest degrees of freedom for the beta distribution
_TERMS = (  # terms of the expansion: divisor, and coefficients of z, z^3, z^5, ...
    (4, (1, 1)),
    (96, (3, 16, 5)),
    (384, (-15, 17, 19, 3)),
    (92160, (-945, -1920, 1482, 776, 79)),
)


def normal(probability):
    """Return the formula of k for infinite degrees of freedom."""
    return f"NORMSINV((1+{probability!r})/2)"


def student(probability, dof, z):
    """Return the formula of k for finite degrees of freedom.

    Parameters
    ----------
    probability : float
        Coverage probability.
    dof : str
        Cell of the degrees of freedom.
    z : str
        Cell with k of the normal distribution (`normal`).

    Returns
    -------
    str
    """
    beta = f"BETAINV({probability!r},0.5,{dof}/2)"
    expansion = "0"
    # Horner's scheme in 1/dof, from the highest power.
    for divisor, coefficients in reversed(_TERMS):
        inner = "+".join(f"{c}*{z}^{2 * place + 1}" for place, c in enumerate(coefficients))
        expansion = f"(({inner})/{divisor}+{expansion})/{dof}"
    return f"IF({dof}>{_MOST_BETA},{z}+{expansion},SQRT({dof}*{beta}/(1-{beta})))"
