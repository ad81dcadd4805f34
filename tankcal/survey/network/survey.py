"""A survey as it goes into the adjustment: names, start values and observations, all in arrays."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tankcal.camera.model import PARAMETERS, Form

IMAGES = "image points"  # source of the image coordinates
SCOPES = ("off", "block", "camera", "photo")
FEWEST = 3  # values that speak of a point that can be determined
STATES = ("free", "weighted", "fixed")
DEFAULT_SCOPE = tuple("off" if name in ("K4", "P3", "P4") else "camera" for name in PARAMETERS)


@dataclass(frozen=True)
class Camera:
    """A camera and what the adjustment may do with each of its parameters (PARAMETERS).

    Attributes
    ----------
    values : ndarray, shape (13,)
        In the order of PARAMETERS, mm.
    form : Form
        How its distortion is written.
    sd : ndarray, shape (13,)
        Standard deviations known beforehand, for the weighted ones.
    scope : tuple
        13 of SCOPES: left out; one value for all photos, for each camera, for each photo.
    state : tuple
        13 of STATES.
    name : str
        As the user knows it.
    """

    values: np.ndarray
    form: Form = field(default_factory=Form)
    sd: np.ndarray = field(default_factory=lambda: np.full(13, np.nan))
    scope: tuple = DEFAULT_SCOPE
    state: tuple = ("free",) * 13
    name: str = "camera"


@dataclass(frozen=True)
class Photos:
    """Photographs. Values that are nan are not known and have to be found.

    Attributes
    ----------
    names : tuple of str
        Of the photos.
    camera : ndarray, shape (n,)
        Number of the camera.
    xyz_m : ndarray, shape (n, 3)
        Projection centres.
    rotation : ndarray, shape (n, 3, 3)
        R3(kappa) R2(phi) R1(omega).
    fixed : ndarray, shape (n, 4)
        True: x, y, z, the rotation is not adjusted.
    """

    names: tuple
    camera: np.ndarray
    xyz_m: np.ndarray
    rotation: np.ndarray
    fixed: np.ndarray = None


@dataclass(frozen=True)
class Instrument:
    """An instrument whose readings are (1 + scale) true + offset.

    Attributes
    ----------
    scale_sd, offset_sd_m : float
        0: fixed at the value; nan: free; else a weighted unknown.
    """

    name: str
    scale: float = 0.0
    offset_m: float = 0.0
    scale_sd: float = 0.0
    offset_sd_m: float = 0.0


@dataclass(frozen=True)
class System:
    """A further coordinate system of control points: X_system = (1 + scale) R X + shift.

    Attributes
    ----------
    scale_free : bool
        Whether its scale is an unknown.
    """

    name: str
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    shift_m: np.ndarray = field(default_factory=lambda: np.zeros(3))
    scale: float = 0.0
    scale_free: bool = False


@dataclass(frozen=True)
class Shared:
    """The k unknowns of a survey that have one name of `observations.NUISANCES`.

    Attributes
    ----------
    owners : tuple
        (k,) whose each is, as the user calls it.
    value : ndarray, shape (k,)
        Start, and known beforehand where it has an sd.
    sd : ndarray, shape (k,)
        0: fixed at the value; nan: free; else a weighted unknown.
    """

    owners: tuple
    value: np.ndarray
    sd: np.ndarray


@dataclass(frozen=True)
class Survey:
    """Everything that goes into one adjustment. Coordinates are in the survey's frame.

    The scatter of the readings that were averaged into an observation (its Trace) counts in sigma0
    and in the redundancy as if they had been adjusted one by one.

    Attributes
    ----------
    points : tuple of str
        Their names.
    xyz_m : ndarray, shape (points, 3)
        Start values.
    fixed : ndarray, shape (points, 3)
        True: not adjusted; None: nothing is.
    image_points : ImageCoordinates or None
        Of all cameras.
    photos : Photos or None
        None: no photographs.
    cameras : tuple of Camera
        Whose photos these are.
    observations : tuple of tankcal.survey.observations
        With coordinates in the survey's frame.
    sets : ndarray, shape (s,)
        Start azimuths of the zeros of the direction sets, rad.
    set_names : tuple
        (set-up, set or None) of each of the s sets; (): not named.
    instruments : tuple of Instrument
        With a scale or an offset.
    systems : tuple of System
        Further frames of coordinates.
    correlated : tuple of tankcal.survey.observations.Block
        Values of the observations (none of them
        held exactly) that are correlated; no value stands in two.
    kept : frozenset
        (file, row) of readings that no search for blunders may set aside.
    """

    points: tuple
    xyz_m: np.ndarray
    fixed: np.ndarray = None
    image_points: object = None
    photos: Photos = None
    cameras: tuple = ()
    observations: tuple = ()
    sets: np.ndarray = field(default_factory=lambda: np.zeros(0))
    instruments: tuple = ()
    systems: tuple = ()
    correlated: tuple = ()
    set_names: tuple = ()
    kept: frozenset = frozenset()

    @cached_property
    def nuisances(self):
        """{name of `observations.NUISANCES`: Shared}: unknowns that observations share."""
        tools, sets = self.instruments, len(self.sets)
        names = tuple(tool.name for tool in tools)

        def of(field):
            return np.array([getattr(tool, field) for tool in tools], dtype=float)

        circles = tuple(f"direction set {i + 1}" for i in range(sets))
        return {
            "scale": Shared(names, of("scale"), of("scale_sd")),
            "offset_m": Shared(names, of("offset_m"), of("offset_sd_m")),
            "orientation_rad": Shared(
                circles, np.array(self.sets, dtype=float), np.full(sets, np.nan)
            ),
        }

    @property
    def tables(self):
        """{source: Observations} of everything that was observed, as Residuals name it."""
        found = dict(enumerate(self.observations))
        return found if self.image_points is None else found | {IMAGES: self.image_points}

    def table(self, source):
        """The observations of a source as Residuals name it; None: they are not in the survey."""
        return self.tables.get(source)

    def by_form(self, images):
        """Pairs (Form, rows (k,)) of image coordinates (n,) whose cameras have one form."""
        forms = {}
        for number, camera in enumerate(self.cameras):
            forms.setdefault(camera.form, []).append(number)
        if len(forms) == 1:
            return [(form, np.arange(len(images))) for form in forms]
        camera = self.photos.camera[images.photo]
        return [(form, np.isin(camera, mine).nonzero()[0]) for form, mine in forms.items()]

    def values_of_points(self):
        """(points,) how many values, fixed coordinates among them, speak of each point."""
        count = np.zeros(len(self.points), dtype=int)
        for one in self.tables.values():
            for name in one.ties:
                count += one.rows * np.bincount(one.of_used(name), minlength=len(count))
        return count if self.fixed is None else count + self.fixed.sum(axis=1)

    def without(self, sources):
        """The survey without some of its tables of observations (numbers), correlations with them.

        The others are counted anew, in `correlated` as well.
        """
        kept = [i for i in range(len(self.observations)) if i not in set(sources)]
        number = np.full(len(self.observations), -1)
        number[kept] = np.arange(len(kept))
        blocks = []
        for block in self.correlated:
            stays = number[block.source] >= 0
            if stays.any():
                blocks.append(
                    replace(
                        block,
                        source=number[block.source[stays]],
                        row=block.row[stays],
                        component=block.component[stays],
                        covariance=block.covariance[np.ix_(stays, stays)],
                    )
                )
        return replace(
            self,
            observations=tuple(self.observations[i] for i in kept),
            correlated=tuple(blocks),
        )

    def with_sds(self, factors):
        """The survey with the sds of groups multiplied; factors {source: factor}, see Residuals."""
        observations = tuple(
            replace(one, sd=one.sd * factors.get(number, 1.0))
            for number, one in enumerate(self.observations)
        )
        images = self.image_points
        if images is not None:
            images = replace(images, sd=images.sd * factors.get(IMAGES, 1.0))
        blocks = tuple(
            replace(one, covariance=one.covariance * np.outer(size, size))
            for one in self.correlated
            for size in [np.array([factors.get(i, 1.0) for i in one.source.tolist()])]
        )
        return replace(self, observations=observations, image_points=images, correlated=blocks)
