"""The coverage factor of any degrees of freedom, whole or not, by a formula of the sheet.

TINV cuts degrees of freedom to whole numbers; the record does not. Up to 1000 of them the beta
distribution gives Student's t exactly, t^2 / (v + t^2) being Beta(1/2, v/2); above, Fisher's
expansion in 1/v to its fourth power. Source: Abramowitz and Stegun, Handbook of
Mathematical Functions, 26.5.27 and 26.7.5.
"""

_MOST_BETA = 1000
_TERMS = (  # of the expansion: divisor, then coefficients of z, z^3, z^5, ...
    (4, (1, 1)),
    (96, (3, 16, 5)),
    (384, (-15, 17, 19, 3)),
    (92160, (-945, -1920, 1482, 776, 79)),
)


def normal(probability):
    """The formula of k for infinite degrees of freedom."""
    return f"NORMSINV((1+{probability!r})/2)"


def student(probability, dof, z):
    """The formula of k; dof and z are cells, z that of `normal`."""
    beta = f"BETAINV({probability!r},0.5,{dof}/2)"
    expansion = "0"
    for divisor, coefficients in reversed(_TERMS):
        inner = "+".join(f"{c}*{z}^{2 * place + 1}" for place, c in enumerate(coefficients))
        expansion = f"(({inner})/{divisor}+{expansion})/{dof}"
    return f"IF({dof}>{_MOST_BETA},{z}+{expansion},SQRT({dof}*{beta}/(1-{beta})))"
