"""Results of the analysis of the parameters of a camera, and choices of the user."""

from dataclasses import dataclass

import numpy as np

from tankcal.calibration.edges import Shift
from tankcal.calibration.interiors import Interior
from tankcal.calibration.parameters.components import Components
from tankcal.calibration.parameters.conditioning import Without
from tankcal.calibration.parameters.recommendation import Advice, Limit
from tankcal.calibration.parameters.rules import PessoaRule, SilvaRule
from tankcal.calibration.parameters.significance import ALPHA, AgainstZero
from tankcal.survey.network import correlations


@dataclass(frozen=True)
class Choices:
    """Choices of the user.

    Attributes
    ----------
    alpha : float
        Significance level of the tests.
    groups : tuple of tuple of str, or None
        Groups of parameters to test, or None for the usual groups.
    of : str
        Matrix of the principal components: "correlation" or "covariance".
    unscaled : bool
        Whether the values of the components are computed as in Silva's program.
    limit_px, limit_um : float or None
        Image accuracy for comparison with the effect of a parameter, px or um. By default 0.5 px in
        Pessoa's rule, and the accuracy from the residuals in the recommendation.
    """

    alpha: float = ALPHA
    groups: tuple | None = None
    of: str = "correlation"
    unscaled: bool = False
    limit_px: float | None = None
    limit_um: float | None = None


@dataclass(frozen=True)
class Trial:
    """Set of parameters that could be dropped.

    Attributes
    ----------
    names : tuple of str
        Names of the parameters.
    because : tuple of str
        Reasons of the trial: "single", "group", "silva", "pessoa", "advised".
    predicted : Without
        Predicted values and covariance of the kept parameters.
    comparable : bool
        Whether dropping the parameters changes only this set of parameters.
    outcome : Outcome or None
        Result of a new adjustment, or None without a new adjustment.
    after : tuple or None
        Names, values (k,) and covariance (k, k) after the new adjustment, scaled as `predicted`.
    """

    names: tuple
    because: tuple
    predicted: Without
    comparable: bool
    outcome: object = None
    after: tuple | None = None


@dataclass(frozen=True)
class CameraParameters:
    """Analysis of one set of interior parameters.

    Attributes
    ----------
    interior : Interior
        Set of interior parameters.
    source : str
        "job" or "record".
    choices : Choices
        Choices of the user.
    names : tuple of str
        Names of the k adjusted parameters.
    values : ndarray, shape (k,)
        Values of the adjusted parameters.
    covariance : ndarray, shape (k, k)
        Covariance matrix, multiplied by sigma0^2 if `scale` is "a_posteriori".
    scale : str
        "a_posteriori" or "a_priori".
    dof, sigma0 : float
        Degrees of freedom and value of sigma0; inf and nan if sigma0 is not estimated.
    limit : Limit
        Image accuracy.
    tests, groups : tuple of AgainstZero
        Tests of single parameters and of groups.
    components : Components
        Principal components.
    own : dict
        {name: Shift or None}, shift by the value of the parameter.
    left : dict
        {name: (Shift, Shift after rotation)}, remaining shift if the parameter is dropped.
    trials : tuple of Trial
        Sets of parameters that could be dropped.
    silva, pessoa : SilvaRule, PessoaRule
        Results of the two rules.
    recommendation : tuple of Advice
        Recommendation for each parameter.
    held_back : tuple of str
        Parameters that can be dropped alone, but not together with the others.
    base : tuple or None
        TopVolume with all parameters or None, and reason of a failure or None; None for a record.
    """

    interior: Interior
    source: str
    choices: Choices
    names: tuple
    values: np.ndarray
    covariance: np.ndarray
    scale: str
    dof: float
    sigma0: float
    limit: Limit
    tests: tuple[AgainstZero, ...]
    groups: tuple[AgainstZero, ...]
    components: Components
    own: dict[str, Shift | None]
    left: dict[str, tuple[Shift, Shift]]
    trials: tuple[Trial, ...]
    silva: SilvaRule
    pessoa: PessoaRule
    recommendation: tuple[Advice, ...]
    held_back: tuple = ()
    base: tuple | None = None

    @property
    def sds(self):
        """Standard deviations (k,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self):
        """Correlation matrix (k, k)."""
        return correlations(self.covariance)


@dataclass(frozen=True)
class Statistics:
    """Statistics of an adjustment; groups are (kind, name, count, redundancy, rms in mm)."""

    sigma0: float
    dof: int
    cov_scale: float
    groups: list

    @property
    def estimated(self):
        """Whether sigma0 was estimated."""
        return self.dof > 0 and np.isfinite(self.sigma0) and self.sigma0 > 0
