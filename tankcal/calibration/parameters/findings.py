"""What is found about the parameters of a camera, and what the user decides about it."""

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
    """What the user decides.

    Attributes
    ----------
    alpha : float
        Level of the tests.
    groups : tuple of tuple of str, or None
        Groups of parameters; None: the usual.
    of : str
        Matrix that is analysed: "correlation" or "covariance".
    unscaled : bool
        Values of components as Silva's program made them.
    limit_px : float or None
        Image accuracy that effects are compared with, px; None: 0.5 px in Pessoa's rule, and that
        of the residuals in our recommendation.
    limit_um : float or None
        The same in um.
    """

    alpha: float = ALPHA
    groups: tuple | None = None
    of: str = "correlation"
    unscaled: bool = False
    limit_px: float | None = None
    limit_um: float | None = None


@dataclass(frozen=True)
class Trial:
    """A set of parameters that could be dropped.

    because     codes: "single", "group", "silva", "pessoa"
    predicted   conditioning.Without
    outcome     dropping.Outcome, or None: not adjusted again
    comparable  False where dropping them changes more than this set of parameters
    after       (names, values (k,), covariance (k, k) scaled like the prediction), or None
    """

    names: tuple
    because: tuple
    predicted: Without
    comparable: bool
    outcome: object = None
    after: tuple | None = None


@dataclass(frozen=True)
class CameraParameters:
    """Everything about the parameters of one set.

    interior    interiors.Interior             source  "job" or "record"
    names       (k,) of those adjusted         values  (k,)
    covariance  (k, k), with sigma0^2 where `scale` is "a_posteriori"
    dof         of sigma0; inf where it is not estimated; sigma0 nan then
    limit       recommending.Limit             tests, groups  tuples of significance.AgainstZero
    own         {name: edges.Shift or None}    left    {name: (Shift, Shift turned to fit)}
    held_back   names that could go alone, but not with the others that may go
    base        (TopVolume or None, why there is none or None): with all parameters; None: a record
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
        """(k,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self):
        """(k, k) correlations."""
        return correlations(self.covariance)


@dataclass(frozen=True)
class Statistics:
    """Of the adjustment; groups (kind, name, count, redundancy, rms in mm)."""

    sigma0: float
    dof: int
    cov_scale: float
    groups: list

    @property
    def estimated(self):
        """Whether sigma0 says anything."""
        return self.dof > 0 and np.isfinite(self.sigma0) and self.sigma0 > 0
