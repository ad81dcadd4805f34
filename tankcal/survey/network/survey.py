"""A survey as input of the adjustment: names, start values and observations, as arrays."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tankcal.camera.model import PARAMETERS, Form

IMAGES = "image points"  # source of the image coordinates
SCOPES = ("off", "block", "camera", "photo")
FEWEST = 3  # values required to determine a point
STATES = ("free", "weighted", "fixed")
DEFAULT_SCOPE = tuple("off" if name in ("K4", "P3", "P4") else "camera" for name in PARAMETERS)


@dataclass(frozen=True)
class Camera:
    """A camera, and the treatment of its parameters (PARAMETERS) in the adjustment.

    Attributes
    ----------
    values : ndarray, shape (13,)
        In the order of PARAMETERS, mm.
    form : Form
        Form of the distortion.
    sd : ndarray, shape (13,)
        A priori standard deviations of weighted parameters.
    scope : tuple
        13 of SCOPES: omitted; one value for all photos, for each camera, for each photo.
    state : tuple
        13 of STATES.
    name : str
    """

    values: np.ndarray
    form: Form = field(default_factory=Form)
    sd: np.ndarray = field(default_factory=lambda: np.full(13, np.nan))
    scope: tuple = DEFAULT_SCOPE
    state: tuple = ("free",) * 13
    name: str = "camera"


@dataclass(frozen=True)
class Photos:
    """Photographs; unknown values are nan.

    Attributes
    ----------
    names : tuple of str
    camera : ndarray, shape (n,)
        Number of the camera.
    xyz_m : ndarray, shape (n, 3)
        Projection centres.
    rotation : ndarray, shape (n, 3, 3)
        R3(kappa) R2(phi) R1(omega).
    fixed : ndarray, shape (n, 4)
        True: x, y, z, or the rotation is not adjusted.
    """

    names: tuple
    camera: np.ndarray
    xyz_m: np.ndarray
    rotation: np.ndarray
    fixed: np.ndarray = None


@dataclass(frozen=True)
class Instrument:
    """An instrument with readings (1 + scale) true + offset.

    Attributes
    ----------
    scale_sd, offset_sd_m : float
        0: fixed at the value; nan: free; otherwise a weighted unknown.
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
        Whether the scale is unknown.
    """

    name: str
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    shift_m: np.ndarray = field(default_factory=lambda: np.zeros(3))
    scale: float = 0.0
    scale_free: bool = False


@dataclass(frozen=True)
class Shared:
    """The k unknowns of a survey with one name of `observations.NUISANCES`.

    Attributes
    ----------
    owners : tuple, length k
        Names of the instruments or direction sets.
    value : ndarray, shape (k,)
        Start value, and a priori value where it has an sd.
    sd : ndarray, shape (k,)
        0: fixed at the value; nan: free; otherwise a weighted unknown.
    """

    owners: tuple
    value: np.ndarray
    sd: np.ndarray


@dataclass(frozen=True)
class Survey:
    """Input of one adjustment. Coordinates are in the frame of the survey.

    The scatter of readings averaged into an observation (its Trace) counts in sigma0 and in the
    redundancy as if the readings had been adjusted separately.

    Attributes
    ----------
    points : tuple of str
        Names.
    xyz_m : ndarray, shape (points, 3)
        Start values.
    fixed : ndarray, shape (points, 3)
        True: not adjusted; None: all are adjusted.
    image_points : ImageCoordinates or None
        Of all cameras.
    photos : Photos or None
        None: no photographs.
    cameras : tuple of Camera
        Cameras of the photos.
    observations : tuple of tankcal.survey.observations
        With coordinates in the frame of the survey.
    sets : ndarray, shape (s,)
        Start azimuths of the zeros of the direction sets, rad.
    set_names : tuple
        (set-up, set or None) of each of the s sets; (): not named.
    instruments : tuple of Instrument
        With a scale or an offset.
    systems : tuple of System
        Further coordinate systems.
    correlated : tuple of tankcal.survey.observations.Block
        Correlated values of the observations, none of them exact; no value is in two blocks.
    kept : frozenset
        (file, row) of readings that data snooping must not reject.
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
        """{name of `observations.NUISANCES`: Shared} of the unknowns shared by observations."""
        tools, sets = self.instruments, len(self.sets)
        names = tuple(tool.name for tool in tools)

        def attribute_of_tools(field):
            return np.array([getattr(tool, field) for tool in tools], dtype=float)

        circles = tuple(f"direction set {i + 1}" for i in range(sets))
        return {
            "scale": Shared(names, attribute_of_tools("scale"), attribute_of_tools("scale_sd")),
            "offset_m": Shared(
                names, attribute_of_tools("offset_m"), attribute_of_tools("offset_sd_m")
            ),
            "orientation_rad": Shared(
                circles, np.array(self.sets, dtype=float), np.full(sets, np.nan)
            ),
        }

    @property
    def tables(self):
        """{source: Observations} of all observations, with sources as in Residuals."""
        observed = dict(enumerate(self.observations))
        return observed if self.image_points is None else observed | {IMAGES: self.image_points}

    def table(self, source):
        """The observations of a source as in Residuals; None if absent."""
        return self.tables.get(source)

    def by_form(self, images):
        """Pairs (Form, rows (k,)) of image coordinates (n,) of cameras with the same form."""
        forms = {}
        for number, camera in enumerate(self.cameras):
            forms.setdefault(camera.form, []).append(number)
        if len(forms) == 1:
            return [(form, np.arange(len(images))) for form in forms]
        camera = self.photos.camera[images.photo]
        return [
            (form, np.isin(camera, cameras_of_form).nonzero()[0])
            for form, cameras_of_form in forms.items()
        ]

    def values_of_points(self):
        """Number (points,) of values, including fixed coordinates, of each point."""
        count = np.zeros(len(self.points), dtype=int)
        for table in self.tables.values():
            for name in table.ties:
                count += table.rows * np.bincount(table.of_used(name), minlength=len(count))
        # A fixed coordinate counts like an observed one.
        return count if self.fixed is None else count + self.fixed.sum(axis=1)

    def without(self, sources):
        """The survey without some tables of observations (numbers) and correlations with them.

        The remaining tables are renumbered, also in `correlated`.
        """
        kept = [i for i in range(len(self.observations)) if i not in set(sources)]
        number = np.full(len(self.observations), -1)
        # Blocks refer to tables by number, so map old numbers to new ones; -1: removed.
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
        """The survey with the standard deviations of groups multiplied by {source: factor}."""
        observations = tuple(
            replace(item, sd=item.sd * factors.get(number, 1.0))
            for number, item in enumerate(self.observations)
        )
        images = self.image_points
        if images is not None:
            images = replace(images, sd=images.sd * factors.get(IMAGES, 1.0))
        blocks = tuple(
            # A covariance scales with the product of both factors.
            replace(item, covariance=item.covariance * np.outer(size, size))
            for item in self.correlated
            for size in [np.array([factors.get(i, 1.0) for i in item.source.tolist()])]
        )
        return replace(self, observations=observations, image_points=images, correlated=blocks)
