"""Wall hits of a total station without targets or names, as read and as points of the wall.

Angles are in radians, lengths in metres; readings are neither corrected nor omitted. From a set-up
S whose circle has its zero at azimuth w, with distance d after the certificate,

    d' = (d - offset - q g(inc)) / (1 + scale),     g(inc) = 1 / cos(inc) - 1,
    hit = S + d' (sin zen sin(w + dir), sin zen cos(w + dir), cos zen),

where inc is the angle between the sight and the normal of the wall, and q the ranging bias at 60
degrees. The hits of a set-up share its position and circle zero; all hits of an instrument share
scale, offset and q. Each of these unknowns is a column of the covariance of the hits.

Source: ISO 7507-4; API MPMS 2.2D (method).
"""

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg
import scipy.sparse

from tankcal.covariance import PointCovariance
from tankcal.geometry.circles import taubin_circle
from tankcal.messages import message
from tankcal.survey.points import Points
from tankcal.survey.results import Cause

MOST_HITS = 25_000  # largest number that was verified, see docs/studies/sizes.md
FEWEST_HITS = 5  # smallest number of hits of a section of the wall


def too_many_hits(count):
    """Message about more hits than can be used."""
    return message(
        "too_many_hits",
        "{count} hits; expected at most {most}, the largest number that was verified: take every"
        " second one or hand them in as points.csv",
        count=count,
        most=MOST_HITS,
    )


@dataclass(frozen=True)
class RangingInstrument:
    """A total station that ranges without a reflector.

    Attributes
    ----------
    name : str
    correction : float
        True distance = (reading + correction_m) (1 + correction).
    correction_m : float
    u_scale : float
        Relative standard uncertainty of the scale.
    u_offset_m : float
        Standard uncertainty of the offset, m; nan: unknown, to be estimated from the wall.
    u_incidence_m : float
        Standard uncertainty of the bias at 60 degrees of incidence, m.
    certificate : str
    """

    name: str
    correction: float = 0.0
    correction_m: float = 0.0
    u_scale: float = 0.0
    u_offset_m: float = np.nan
    u_incidence_m: float = 0.0
    certificate: str = ""


@dataclass(frozen=True)
class ControlReading:
    """A reading of a control target from a set-up; nan: not read.

    Attributes
    ----------
    setup, target : str
    direction_rad, zenith_rad, distance_m : float
    time_s : float
        Time since a common origin, s.
    row : int or None
    """

    setup: str
    target: str
    direction_rad: float
    zenith_rad: float
    distance_m: float
    time_s: float
    row: int | None = None


@dataclass(frozen=True)
class WallHits:
    """n hits of a wall, in the order of their file, with their instruments.

    Attributes
    ----------
    setup : tuple of str, length n
    set : tuple of str or None, length n
        Set of directions within the set-up, with its own circle zero.
    course : tuple of str or None, length n
        Course recorded in the field.
    direction_rad, zenith_rad, distance_m : ndarray, shape (n,)
        As read.
    sd_m, sd_rad : ndarray, shape (n,)
        Standard deviations of the distance, and of each angle.
    surface : tuple of str, length n
        "paint", "rust", "tape" or "".
    check : ndarray of bool, shape (n,)
        True: compared only.
    setups : dict
        {name: measurements.Setup}, each with its instrument.
    instruments : dict
        {name: RangingInstrument}.
    stations : dict
        {station: (3,) coordinates from control.csv, m; nan: unknown}.
    control : tuple of ControlReading
    rows : tuple of int
    file : str
    """

    setup: tuple
    set: tuple
    course: tuple
    direction_rad: np.ndarray
    zenith_rad: np.ndarray
    distance_m: np.ndarray
    sd_m: np.ndarray
    sd_rad: np.ndarray
    surface: tuple
    check: np.ndarray
    setups: dict
    instruments: dict
    stations: dict = field(default_factory=dict)
    control: tuple[ControlReading, ...] = ()
    rows: tuple = ()
    file: str = "wall_hits.csv"

    def __len__(self):
        return len(self.setup)

    @property
    def instrument(self):
        """Names (n,) of the instruments of the hits."""
        return tuple(self.setups[name].instrument for name in self.setup)


NETWORK, FRAME, WALL = "network", "frame", "wall"  # tie of a set-up
STEEPEST = np.cos(np.radians(85))  # largest incidence: beyond it 1 / cos has no meaning


@dataclass(frozen=True)
class Poses:
    """Positions and circle zeros of instruments; p poses, k instruments.

    Attributes
    ----------
    keys : tuple of (str, str or None)
        (set-up, set) of each pose.
    xyz_m : ndarray, shape (p, 3)
        Intersections of the instrument axes.
    orientation_rad : ndarray, shape (p,)
        Azimuth of the circle zero.
    instruments : tuple of str
    scale, offset_m : ndarray, shape (k,)
        Estimates: reading = (1 + scale) true + offset.
    covariance : ndarray, shape (4 p + 2 k, 4 p + 2 k)
        Of x, y, z, orientation of each pose, then of scale and offset of each instrument. It is 0
        for an offset without estimate, and for poses tied by the wall only.
    ties : tuple of str
        Tie of each pose: NETWORK, FRAME (it defines the frame) or WALL (the wall alone).
    """

    keys: tuple
    xyz_m: np.ndarray
    orientation_rad: np.ndarray
    instruments: tuple
    scale: np.ndarray
    offset_m: np.ndarray
    covariance: np.ndarray
    ties: tuple

    def place_of(self, hits):
        """Index (n,) of the pose of each hit."""
        place = {key: i for i, key in enumerate(self.keys)}
        return np.array([place[key] for key in zip(hits.setup, hits.set, strict=True)])


@dataclass(frozen=True)
class Beside:
    """Targets on the wall, in addition to hits without names.

    Attributes
    ----------
    points : Points
        k targets on the wall, from the network.
    with_poses : ndarray, shape (u, 3 k)
        Covariance of the unknowns of `Poses.covariance` with the coordinates of the targets, m2.
    """

    points: Points
    with_poses: np.ndarray

    def after(self, sights, by_poses):
        """Append the targets to n sights, with a joint covariance and each cause once.

        Parameters
        ----------
        sights : Points
        by_poses : ndarray, shape (3 n, u)
            Derivative of the sights by the unknowns of `Poses.covariance`.

        Returns
        -------
        Points
        """
        targets, count = self.points, len(sights.names)
        first, second = sights.covariance_m2, targets.covariance_m2
        more, unknowns = 3 * len(targets.names), len(self.with_poses)
        # The sights follow the poses, which have the covariance `with_poses` with the targets: the
        # columns of each, and a pair that joins them.
        columns = scipy.sparse.block_diag([first.columns, second.columns], format="csr")
        joined = scipy.linalg.block_diag(by_poses, self.with_poses.T)
        covariance = PointCovariance(
            np.concatenate([first.independent, second.independent]),
            columns,
            scipy.linalg.block_diag(first.cofactor, second.cofactor),
        ).add_columns(joined, np.kron([[0, 1], [1, 0]], np.eye(unknowns)))

        def longer(column):
            return np.pad(column, (0, more))

        causes = {(item.name, item.what): replace(item, column_m=longer(item.column_m))
                  for item in sights.causes}  # fmt: skip
        for item in targets.causes:
            key, column = (item.name, item.what), np.pad(item.column_m, (3 * count, 0))
            shared_cause = causes.get(key)
            # A shared cause moves sights and targets together, so its columns are added.
            joint_column = column if shared_cause is None else shared_cause.column_m + column
            causes[key] = replace(shared_cause or item, column_m=joint_column)
        return replace(
            sights,
            names=sights.names + targets.names,
            xyz_m=np.vstack([sights.xyz_m, targets.xyz_m]),
            covariance_m2=covariance,
            section=sights.section + targets.section,
            generatrix=sights.generatrix + targets.generatrix,
            rows=sights.rows + (None,) * len(targets.names),
            causes=tuple(causes.values()),
            unbound=tuple(replace(item, column_m=longer(item.column_m)) for item in sights.unbound),
            by_inputs={name: longer(item) for name, item in sights.by_inputs.items()},
        )


@dataclass(frozen=True)
class Sighting:
    """Hits as points of the wall, with the data of their reduction.

    Attributes
    ----------
    points : Points
        All n hits, including those compared only.
    poses : Poses
    pose : ndarray of int, shape (n,)
        Index of the pose of each hit.
    incidence_rad : ndarray, shape (n,)
        Angle between the sight and the normal of the wall: the circle through all hits in plan, or
        another solid.
    is_inside : ndarray of bool, shape (n,)
        Whether the set-up is within that wall.
    normal : ndarray, shape (n, 3)
        Outward normal of that wall.
    estimated_m : dict
        {instrument: offset estimated from the wall and already subtracted, m}.
    estimates : tuple of EstimatedCause
        Offsets and scales estimated from the wall; (): not estimated yet.
    by_poses : ndarray, shape (3 n, u)
        Derivative of the points by the unknowns of `Poses.covariance`.
    beside : Beside or None
        Targets on the wall from the same network.
    """

    points: Points
    poses: Poses
    pose: np.ndarray
    incidence_rad: np.ndarray
    is_inside: np.ndarray
    normal: np.ndarray
    estimated_m: dict = field(default_factory=dict)
    estimates: tuple = ()
    by_poses: np.ndarray | None = None
    beside: "Beside | None" = None


def sight(hits, poses, estimated_m=None, incidence=None):
    """Compute the points of hits from known poses.

    Parameters
    ----------
    hits : WallHits
    poses : Poses
    estimated_m : dict, optional
        {instrument: offset estimated from the wall, m}.
    incidence : callable, optional
        Function with the parameters and results of `incidence_in_plan`, for a wall that is not an
        upright cylinder; None: `incidence_in_plan`.

    Returns
    -------
    Sighting
        Its points have their full covariance. Offsets without estimate and poses tied by the wall
        only are excluded from it and listed in `unbound` of the points.
    """
    estimated_m = estimated_m or {}
    offsets_m = np.array([estimated_m.get(name, 0.0) for name in poses.instruments])
    poses = replace(poses, offset_m=poses.offset_m + offsets_m)
    pose = poses.place_of(hits)
    tool = np.array([poses.instruments.index(name) for name in hits.instrument])
    distance = (certified_m(hits) - poses.offset_m[tool]) / (1 + poses.scale[tool])
    azimuth = poses.orientation_rad[pose] + hits.direction_rad
    ray, by_azimuth, by_zenith = rays(azimuth, hits.zenith_rad)
    xyz = poses.xyz_m[pose] + distance[:, None] * ray
    incidence = incidence or incidence_in_plan
    cosine, inside, normal = incidence(xyz, poses.xyz_m[pose], ray)
    # Derivatives by x, y, z, orientation of each pose, then by scale and offset of each instrument.
    n, p, k = len(hits), len(poses.keys), len(poses.instruments)
    jacobian = np.zeros((n, 3, 4 * p + 2 * k))
    indices = np.arange(n)
    for axis in range(3):
        jacobian[indices, axis, 4 * pose + axis] = 1.0
    along = distance[:, None] * by_azimuth
    jacobian[indices, :, 4 * pose + 3] = along
    stretch = 1 + poses.scale[tool]
    jacobian[indices, :, 4 * p + 2 * tool] = -(distance / stretch)[:, None] * ray
    jacobian[indices, :, 4 * p + 2 * tool + 1] = -ray / stretch[:, None]
    jacobian = jacobian.reshape(3 * n, -1)
    # Independent errors: along the ray (distance), in zenith angle, and in direction.
    own_error = np.stack(
        [
            hits.sd_m[:, None] * ray,
            hits.sd_rad[:, None] * distance[:, None] * by_zenith,
            hits.sd_rad[:, None] * along,
        ],
        axis=2,
    )
    causes, unbound = _causes(hits, poses, jacobian, tool, ray, cosine)
    unbound += _causes_of_untied(poses, jacobian)
    biases = [cause.column_m for cause in causes if cause.what == "incidence"]
    covariance = PointCovariance(
        own_error @ own_error.transpose(0, 2, 1),
        np.column_stack([jacobian, *biases]),
        scipy.linalg.block_diag(poses.covariance, np.eye(len(biases))),
    )
    points = Points(
        names=tuple(
            f"{name} {row}" for name, row in zip(hits.setup, _file_rows(hits), strict=True)
        ),
        xyz_m=xyz,
        sd_m=None,
        covariance_m2=covariance,
        section=(None,) * n,
        generatrix=(None,) * n,
        rows=tuple(_file_rows(hits)),
        causes=tuple(causes),
        from_adjustment=True,
        unbound=tuple(unbound),
        file=hits.file,
    )
    return Sighting(
        points, poses, pose, np.arccos(cosine), inside, normal, estimated_m, by_poses=jacobian
    )


def _file_rows(hits):
    return hits.rows or range(1, len(hits) + 1)


def certified_distance_m(reading_m, tool):
    """Distance after an instrument's certificate: (reading + correction_m) (1 + correction), m."""
    return (np.asarray(reading_m) + tool.correction_m) * (1.0 + tool.correction)


def certified_m(hits):
    """Distances (n,) of hits after the certificates of their instruments, m."""
    read = zip(hits.distance_m, hits.instrument, strict=True)
    return np.array(
        [certified_distance_m(distance, hits.instruments[name]) for distance, name in read]
    )


def rays(azimuth_rad, zenith_rad):
    """Unit vectors (n, 3) of sights, and their derivatives by azimuth and zenith angle."""
    sin, cos = np.sin(azimuth_rad), np.cos(azimuth_rad)
    down, up = np.sin(zenith_rad), np.cos(zenith_rad)
    ray = np.column_stack([down * sin, down * cos, up])
    # Derivatives of (sin z sin a, sin z cos a, cos z) by a and z.
    by_azimuth = np.column_stack([down * cos, -down * sin, np.zeros_like(up)])
    return ray, by_azimuth, np.column_stack([up * sin, up * cos, -down])


def bias_by_incidence(cosine):
    """Bias function g = 1 / cos(incidence) - 1, shape (n,): 1 at 60 degrees, constant above 85
    degrees."""
    # The clipped cosine keeps the bias finite at grazing incidence.
    return 1 / np.maximum(cosine, STEEPEST) - 1


def incidence_in_plan(xyz, station, ray):
    """Incidence of sights on the circle through all hits in plan.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Hits, m.
    station : ndarray, shape (n, 3)
        Position of the instrument of each hit, m.
    ray : ndarray, shape (n, 3)
        Unit vectors of the sights.

    Returns
    -------
    cosine : ndarray, shape (n,)
    inside : ndarray of bool, shape (n,)
        Whether the station is within the circle.
    normal : ndarray, shape (n, 3)
        Outward horizontal unit normals.
    """
    # Centring on the median limits rounding in the squares of the circle fit.
    middle = np.median(xyz[:, :2], axis=0)
    x, y, radius = taubin_circle(xyz[:, :2] - middle)
    centre = middle + [x, y]
    normal = xyz[:, :2] - centre
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    cosine = np.abs(np.sum(ray[:, :2] * normal, axis=1))
    inside = np.linalg.norm(station[:, :2] - centre, axis=1) < radius
    return np.clip(cosine, 0, 1), inside, np.pad(normal, ((0, 0), (0, 1)))


def _causes(hits, poses, jacobian, tool, ray, cosine):
    """Return the causes contained in the covariance of hits, and the unbound causes."""
    causes, unbound, p = [], [], len(poses.keys)
    for i, name in enumerate(poses.instruments):
        known = hits.instruments[name]
        for what, at, u, factor, unit in (
            ("instrument_scale", 4 * p + 2 * i, known.u_scale, 1e6, "ppm"),
            ("instrument_offset", 4 * p + 2 * i + 1, known.u_offset_m, 1e3, "mm"),
        ):
            if np.isnan(u):
                if poses.covariance[at, at] == 0:
                    unbound.append(Cause(name, what, np.inf, unit, jacobian[:, at]))
            elif u > 0:
                # Effect of one a priori standard uncertainty after the adjustment: J Q e / u.
                column = jacobian @ poses.covariance[:, at] / u
                causes.append(Cause(name, what, factor * u, unit, column))
        if known.u_incidence_m:
            causes += _incidence_causes(hits, known, tool == i, ray, cosine)
    return causes, unbound


def _causes_of_untied(poses, jacobian):
    """Causes of x, y and orientation of poses tied by the wall only: unknowns of the wall."""
    return [
        Cause(name, "pose", np.inf, unit, jacobian[:, 4 * i + k])
        for i, ((name, _), tie) in enumerate(zip(poses.keys, poses.ties, strict=True))
        if tie == WALL
        for k, unit in ((0, "m"), (1, "m"), (3, "rad"))
    ]


def _incidence_causes(hits, tool, is_of_tool, ray, cosine):
    """One incidence cause for each surface measured by an instrument."""
    bias = tool.u_incidence_m * bias_by_incidence(cosine)
    surface, causes = np.array([name_of_surface or "" for name_of_surface in hits.surface]), []
    for name_of_surface in dict.fromkeys(surface[is_of_tool].tolist()):
        column = (
            np.where(is_of_tool & (surface == name_of_surface), -bias, 0.0)[:, None] * ray
        ).ravel()
        if np.any(column):
            name = f"{tool.name} {name_of_surface}".strip()
            causes.append(Cause(name, "incidence", 1e3 * tool.u_incidence_m, "mm", column))
    return causes
