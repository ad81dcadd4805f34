"""What happens to the survey and to the volume when parameters of a camera are dropped: done again.

The survey is adjusted again with the parameters off (held at zero), from the same readings: what
the search for blunders rejected stays rejected, and nothing else goes. So the figures differ by the
parameters alone, and a bad model shows in sigma0 rather than in readings that are rejected. For
the same reason the wall is fitted through the same points each time, without a search for others.

Not adjusted by `surveys.adjust_survey`: a camera without a parameter that it needs looks like a
mistake in the readings, which that would search for.
"""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.calibration.capacity_at_top import TopOfTank, TopVolume
from tankcal.camera.model import PARAMETERS
from tankcal.errors import SolutionError, TankcalError
from tankcal.messages import message
from tankcal.survey import Adjustment
from tankcal.survey.causes import causes_of
from tankcal.survey.datum import make_frame
from tankcal.survey.network import adjust
from tankcal.survey.network.snooping import start_from_adjusted
from tankcal.survey.network_of_survey import gather


@dataclass(frozen=True)
class Moved:
    """How far adjusted points moved; fixed coordinates count as not moving, lengths in m.

    count              points compared
    rms_m, largest_m   of the distance moved; the point that moved most
    axis_rms_m         (3,) x, y, z            axis_largest_m  (3,) magnitudes
    rms_sds            root mean square of each coordinate's change over its own sd
    largest_sds        largest of these; its point
    """

    count: int
    rms_m: float
    largest_m: float
    largest_point: str
    axis_rms_m: np.ndarray
    axis_largest_m: np.ndarray
    rms_sds: float
    largest_sds: float
    largest_sds_point: str


@dataclass(frozen=True)
class Outcome:
    """The survey without some parameters.

    camera, names  which                     failed  why it cannot be adjusted, or None
    adjustment     survey.Adjustment: points, covariances and statistics, no readings; None: failed
    moved          Moved, against the survey with them; None: failed
    volume         TopVolume, or None: no tank, or no capacity
    """

    camera: str
    names: tuple
    failed: str | None = None
    adjustment: Adjustment | None = None
    moved: Moved | None = None
    volume: TopVolume | None = None


class Dropping:
    """A survey that is adjusted again and again, each time without some parameters.

    job         job.Job with measurements     adjustment  survey.Adjustment of them
    volume      TopVolume with all parameters; None: no tank, or none can be computed
    no_volume   why there is none, or None
    """

    def __init__(self, job, adjustment):
        self.job, self.adjustment = job, adjustment
        gathered = gather(job.measurements)
        survey = start_from_adjusted(adjustment.adjusted.survey, adjustment.adjusted)
        self._options = make_frame(survey, gathered, job.measurements.settings).options
        self._survey = replace(survey, cameras=_started_cameras(adjustment.adjusted))
        self.volume, self.no_volume, self._top = None, None, TopOfTank(job)
        if job.tank is not None:
            try:
                self.volume = self._top.of(adjustment)
            except TankcalError as error:
                self.no_volume = str(error)

    def without(self, camera, names):
        """The Outcome of dropping parameters (names) of a camera (its name).

        One value for the block is dropped from all cameras that have it. c cannot be dropped.
        """
        try:
            found = self.adjusted(_dropped(self._survey.cameras, camera, names))
            moved = movement(self.adjustment, found)
        except SolutionError as error:
            return Outcome(camera, tuple(names), str(error))
        if self.volume is None:
            return Outcome(camera, tuple(names), None, found, moved)
        try:
            volume = self._top.of(found)
        except TankcalError as error:
            return Outcome(camera, tuple(names), str(error), found, moved)
        return Outcome(camera, tuple(names), None, found, moved, volume)

    def adjusted(self, cameras):
        """The survey.Adjustment with other cameras (network.Camera), in the order of the survey.

        It holds points, covariances and statistics; readings, groups and warnings are empty.
        """
        done = adjust(replace(self._survey, cameras=cameras), **self._options)
        base = self.adjustment
        scale = 1.0 if base.cov_scale == 1 else done.scale("a_posteriori")
        there = np.flatnonzero(np.isfinite(done.xyz_m).all(axis=1))
        return replace(
            base,
            adjusted=done,
            there=there,
            readings=(),
            removed=(),
            groups=(),
            check_points=None,
            causes=causes_of(done, there, scale),
            cov_scale=scale,
            rounds=1,
            warnings=(),
            doubts=(),
        )


def movement(before, after):
    """The Moved of the points that two Adjustments have in common, in sds of the first."""
    places = {name: i for i, name in enumerate(after.names)}
    both = [(i, places[name]) for i, name in enumerate(before.names) if name in places]
    if not both:
        raise SolutionError(message("camera_no_point_left", "no point is left to compare"))
    here, there = np.array(both).T
    change = after.xyz_m[there] - before.xyz_m[here]
    sd = np.sqrt(np.maximum(np.einsum("nii->ni", before.covariance_m2[here]), 0.0))
    known = sd > 0
    change = np.where(np.asarray(before.fixed)[here], 0.0, change)
    relative = np.abs(np.divide(change, sd, out=np.zeros_like(change), where=known))
    size = np.linalg.norm(change, axis=1)
    far, worst = int(np.argmax(size)), int(np.argmax(relative.max(axis=1)))
    return Moved(
        count=len(both),
        rms_m=float(np.sqrt(np.mean(size**2))),
        largest_m=float(size[far]),
        largest_point=before.names[here[far]],
        axis_rms_m=np.sqrt(np.mean(change**2, axis=0)),
        axis_largest_m=np.abs(change).max(axis=0),
        rms_sds=float(np.sqrt(np.mean(relative[known] ** 2))) if known.any() else 0.0,
        largest_sds=float(relative.max()),
        largest_sds_point=before.names[here[worst]],
    )


def interior_after(outcome, interior):
    """Values (k,) and cofactors (k, k) of the parameters of a set that an Outcome keeps.

    interior  interiors.Interior of the survey with all parameters. Cofactors are of sigma0 = 1.
    """
    adjusted = outcome.adjustment.adjusted
    names = [one.name for one in adjusted.survey.cameras]
    photos = adjusted.survey.photos
    if interior.photos is not None:
        photo = photos.names.index(interior.photos[0])
    else:
        photo = int(np.flatnonzero(photos.camera == names.index(interior.camera))[0])
    values, free, cofactors = adjusted.camera(photo)
    return np.array([values[name] for name in free]), tuple(free), np.asarray(cofactors)


def _started_cameras(adjusted):
    """The cameras, with adjusted values to start from where the whole camera has one and free."""
    survey, found = adjusted.survey, []
    for number, camera in enumerate(survey.cameras):
        values, _, _ = adjusted.camera(int(np.flatnonzero(survey.photos.camera == number)[0]))
        start = [
            values[name] if scope in ("camera", "block") and state == "free" else given
            for name, scope, state, given in zip(
                PARAMETERS, camera.scope, camera.state, camera.values.tolist(), strict=True
            )
        ]
        found.append(replace(camera, values=np.array(start)))
    return tuple(found)


def _dropped(cameras, name, parameters):
    """The cameras with parameters of one of them off, and of all where they share the value."""
    if "c" in parameters:
        raise ValueError("c cannot be dropped: a camera has a principal distance")
    own = next(one for one in cameras if one.name == name)
    gone = [PARAMETERS.index(one) for one in parameters]
    found = []
    for camera in cameras:
        off = {k for k in gone if camera is own or own.scope[k] == camera.scope[k] == "block"}
        found.append(
            replace(
                camera,
                values=np.where([k in off for k in range(13)], 0.0, camera.values),
                scope=tuple("off" if k in off else s for k, s in enumerate(camera.scope)),
            )
        )
    return tuple(found)
