"""Measurements of a survey as read, in SI, and horizontal distances by stadia.

Image coordinates and cameras stay in millimetres; angles are in radians. Rows keep the order of
their files, and repeated readings stay separate. Values are neither averaged, corrected nor
omitted. Names are texts; an absent table is None or ().

Stadia method: horizontal distance to a bar of known length from the angle between its ends.

    d = (b / 2) cot(beta / 2)            the bar is level and perpendicular to the sight
    dd / dbeta = -b / (4 sin^2(beta / 2))

Source: ISO 7507-3, clause 11 (the base of a triangulation).
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.camera.comparator import Transformation
from tankcal.camera.model import Lens
from tankcal.survey.network.survey import Camera


@dataclass(frozen=True)
class AdjustmentSettings:
    """Settings of [adjustment].

    Attributes
    ----------
    datum : str
        "control", "fixed_photo", "minimal" or "inner".
    datum_points : tuple of (str, str)
        (name, axes), axes such as "xyz", "xy", "z", that hold a datum "minimal" or "inner"; ():
        chosen by the program.
    fixed_photo : str or None
        Name of the photo for datum = "fixed_photo".
    image_sd_mm : float or None
        Standard deviation of image coordinates without one; None: not given.
    snooping : bool
        Whether to search for blunders and reject them.
    scale : str
        Scale of the reported covariances: "a_priori" or "a_posteriori".
    refraction : float or None
        Coefficient k (0.13) for zenith angles, vertical angles and slope distances; None: neither
        curvature nor refraction.
    explain : bool
        Whether to search for mistakes in the input when the survey does not fit. Comparisons of
        wrong assumptions disable the search.
    reading_limit_mm : float or None
        Standard deviation of one reading beyond which repeated readings are rejected; None: no
        limit.
    depth_of_field : bool
        Whether radial distortion depends on the depth of each point.
    image_weights : str
        "measured" or "ideal": image in which residuals are weighted (camera.Form).
    """

    datum: str = "control"
    datum_points: tuple[tuple[str, str], ...] = ()
    fixed_photo: str | None = None
    image_sd_mm: float | None = None
    snooping: bool = True
    scale: str = "a_priori"
    refraction: float | None = None
    explain: bool = True
    reading_limit_mm: float | None = None
    depth_of_field: bool = False
    image_weights: str = "measured"


@dataclass(frozen=True)
class CameraSetup:
    """A camera of cameras.toml with the settings of [adjustment.camera].

    Attributes
    ----------
    camera : network.Camera
        In millimetres.
    format_mm : ndarray, shape (2,)
        Width and height of the image.
    pixel_mm : ndarray, shape (2,), or None
        Size of a pixel; None: image coordinates are in mm.
    lens : Lens or None
        Radial distortion as a function of distance; `camera` has the distortion at the focus. None:
        one distortion for all distances.
    """

    camera: Camera
    format_mm: np.ndarray
    pixel_mm: np.ndarray | None = None
    lens: Lens | None = None

    @property
    def format_px(self):
        """Columns and lines of the image (2,) as integers; requires `pixel_mm`."""
        return np.round(self.format_mm / self.pixel_mm).astype(int)


@dataclass(frozen=True)
class Photo:
    """A photo.

    Attributes
    ----------
    name, camera : str
    values : ndarray, shape (6,)
        x, y, z (m), omega, phi, kappa (rad); nan: unknown.
    sd : ndarray, shape (6,)
        nan: the value is an approximation; 0: it is fixed; otherwise it is observed.
    row : int or None
    """

    name: str
    camera: str
    values: np.ndarray
    sd: np.ndarray
    row: int | None = None


@dataclass(frozen=True)
class ImageReadings:
    """Image coordinates, x to the right and y upwards from the centre of the format.

    Attributes
    ----------
    photo, point : tuple, length n
    xy_mm : ndarray, shape (n, 2)
    sd_mm : ndarray, shape (n, 2)
        nan: not given.
    check : ndarray of bool, shape (n,)
        True: compared, not adjusted.
    rows : tuple
    file : str
    shared_sd_mm : ndarray, shape (n, 2), or None
        Standard deviation of the comparator transformation, an error common to all readings of a
        point; None: no photo was read on a comparator.
    """

    photo: tuple
    point: tuple
    xy_mm: np.ndarray
    sd_mm: np.ndarray
    check: np.ndarray
    rows: tuple = ()
    file: str = "image_points.csv"
    shared_sd_mm: np.ndarray | None = None


@dataclass(frozen=True)
class RejectedReadings:
    """Repeated readings of a point or mark that scatter beyond the limit.

    Attributes
    ----------
    photo, name : str
    count : int
        Number of readings.
    sd_mm : ndarray, shape (2,)
        Sample standard deviation of one reading.
    row : int or None
        Row of the first reading.
    """

    photo: str
    name: str
    count: int
    sd_mm: np.ndarray
    row: int | None = None


@dataclass(frozen=True)
class FiducialFit:
    """Fit of the readings of a photo's fiducial marks to their calibrated coordinates.

    Attributes
    ----------
    photo, camera : str
    marks : tuple, length n
        Names of the marks.
    calibrated_mm : ndarray, shape (n, 2)
    count : ndarray of int, shape (n,)
        Number of readings.
    mean_mm : ndarray, shape (n, 2)
        Unweighted mean of the readings.
    sd_mm : ndarray, shape (n, 2)
        Sample standard deviation of one reading; nan for a single one.
    residual_mm : ndarray, shape (n, 2)
        Transformed mean of the readings minus calibrated.
    transformation : Transformation
    rejected : tuple of RejectedReadings
    growth : float
        Largest ratio of the standard deviation of an image coordinate with and without the
        uncertainty of the transformation; nan without image points.
    """

    photo: str
    camera: str
    marks: tuple
    calibrated_mm: np.ndarray
    count: np.ndarray
    mean_mm: np.ndarray
    sd_mm: np.ndarray
    residual_mm: np.ndarray
    transformation: Transformation
    rejected: tuple[RejectedReadings, ...] = ()
    growth: float = np.nan


@dataclass(frozen=True)
class KnownPoints:
    """Control or check points.

    Attributes
    ----------
    point : tuple, length n
    xyz_m : ndarray, shape (n, 3)
        nan: unknown.
    sd_m : ndarray, shape (n, 3)
        nan: approximation only; 0: fixed; otherwise observed.
    system : tuple, length n
        Name of the coordinate system; None: that of the survey.
    check : ndarray of bool, shape (n,)
        True: compared, not adjusted.
    rows : tuple
    file : str
    """

    point: tuple
    xyz_m: np.ndarray
    sd_m: np.ndarray
    system: tuple
    check: np.ndarray
    rows: tuple = ()
    file: str = "control.csv"


@dataclass(frozen=True)
class Targets:
    """Positions of targets on the nominal tank.

    Attributes
    ----------
    point, section, generatrix : tuple, length n
        Name of the target, its section and generatrix (or None).
    z_m : ndarray, shape (n,)
        In the frame of the survey; nan: not given.
    offset_m : ndarray, shape (n,)
        From the wall to the centre of the target, towards the observer.
    rows : tuple
    """

    point: tuple
    section: tuple
    generatrix: tuple
    z_m: np.ndarray
    offset_m: np.ndarray
    rows: tuple = ()


@dataclass(frozen=True)
class Instrument:
    """An instrument of instruments.toml.

    Attributes
    ----------
    name : str
    kind : str
        "tape", "edm", "total_station", "theodolite", "level" or "other".
    correction, correction_m : float
        True distance = (reading + correction_m) (1 + correction) at the certified temperature.
    certified_temperature_c : float or None
        None: readings are not corrected for temperature.
    expansion_per_k : float
        Thermal expansion of a tape.
    u_scale, u_offset_m : float
        Standard uncertainties; 0: exact; nan: free unknowns.
    details : dict
        Certificate, tension_n and other printed data.
    """

    name: str
    kind: str
    correction: float = 0.0
    correction_m: float = 0.0
    certified_temperature_c: float | None = None
    expansion_per_k: float = 0.0
    u_scale: float = 0.0
    u_offset_m: float = 0.0
    details: dict = field(default_factory=dict)


@dataclass(frozen=True)
class Setup:
    """An instrument set up on a station; height_m above the mark, `instrument` may be None."""

    name: str
    station: str
    instrument: str | None = None
    height_m: float = 0.0
    row: int | None = None


@dataclass(frozen=True)
class Readings:
    """One table of readings between points.

    Vectors have value and sd (n, 3), and correlation (n, 3) of x with y, x with z, y with z.

    Attributes
    ----------
    table : str
        "distances", "slope_distances", "directions", "zenith_angles", "azimuths",
        "horizontal_angles", "vertical_angles", "height_differences", "plumb_lines" or "vectors".
    value : ndarray, shape (n,)
        m or rad; zeros for plumb lines.
    sd : ndarray, shape (n,)
        m or rad; 0: fixed.
    start : tuple, length n
        Point, or None where the set-up determines it.
    end : tuple, length n
        Point.
    check : ndarray of bool, shape (n,)
        True: compared, not adjusted.
    origin : tuple
        Reference points of horizontal angles; otherwise ().
    setup : tuple
        Set-ups of the readings; otherwise ().
    set : tuple
        Names of the sets of directions within a set-up, or None; otherwise ().
    instrument : tuple
        Instruments of distances, or None; otherwise ().
    horizontal : ndarray of bool, shape (n,)
        True: a horizontal distance.
    temperature_c : ndarray, shape (n,)
        nan: not given.
    target_height_m : ndarray, shape (n,)
        0 where not given.
    rows : tuple
    sheet : str
        Name of the table in messages if it is in a workbook; otherwise "".
    correlation : ndarray, shape (n, 3), or None
    """

    table: str
    value: np.ndarray
    sd: np.ndarray
    start: tuple
    end: tuple
    check: np.ndarray
    origin: tuple = ()
    setup: tuple = ()
    set: tuple = ()
    instrument: tuple = ()
    horizontal: np.ndarray | None = None
    temperature_c: np.ndarray | None = None
    target_height_m: np.ndarray | None = None
    rows: tuple = ()
    sheet: str = ""
    correlation: np.ndarray | None = None

    @property
    def file(self):
        """Name of the file, or of the sheet in a workbook, for messages."""
        return self.sheet or f"{self.table}.csv"


@dataclass(frozen=True)
class CorrelatedReadings:
    """Pairs of correlated values, one per row of correlated_readings.csv.

    Attributes
    ----------
    tables : tuple, length n
        Pairs of table names, including "control".
    at : ndarray of int, shape (n, 2)
        Rows in these tables, as shown by an editor.
    axis : ndarray of int, shape (n, 2)
        0, 1, 2 for x, y, z; 0 for tables with one value per row.
    r : ndarray, shape (n,)
        Correlation coefficients.
    rows : tuple
    file : str
    """

    tables: tuple
    at: np.ndarray
    axis: np.ndarray
    r: np.ndarray
    rows: tuple = ()
    file: str = "correlated_readings.csv"


@dataclass(frozen=True)
class NominalTank:
    """Nominal tank for approximate values, and z of its bottom (None: unknown)."""

    radius_m: float
    height_m: float
    bottom_z_m: float | None = None


@dataclass(frozen=True)
class Measurements:
    """All measurements of one adjustment.

    Attributes
    ----------
    settings : AdjustmentSettings
    cameras, photos, instruments, setups : tuple
        In the order of their files.
    image_points : ImageReadings or None
    control, check : KnownPoints or None
        None: no control.csv or check.csv.
    targets : Targets or None
    readings : tuple of Readings
        One for each file with rows.
    nominal : NominalTank or None
        None: the job has no vertical tank.
    fiducials : tuple of FiducialFit
        One for each photo read on a comparator; `image_points` are transformed already.
    correlated : CorrelatedReadings or None
    kept : frozenset
        (file, row) of readings that data snooping must not reject.
    """

    settings: AdjustmentSettings = AdjustmentSettings()
    cameras: tuple[CameraSetup, ...] = ()
    photos: tuple[Photo, ...] = ()
    image_points: ImageReadings | None = None
    control: KnownPoints | None = None
    check: KnownPoints | None = None
    targets: Targets | None = None
    instruments: tuple[Instrument, ...] = ()
    setups: tuple[Setup, ...] = ()
    readings: tuple[Readings, ...] = ()
    nominal: NominalTank | None = None
    fiducials: tuple[FiducialFit, ...] = ()
    correlated: CorrelatedReadings | None = None
    kept: frozenset = frozenset()


def distance_of_angle_m(angle_rad, length_m):
    """Distance to a bar from the angle that it subtends.

    Parameters
    ----------
    angle_rad : array_like
        Angle between the ends of the bar, rad.
    length_m : array_like
        Length of the bar, m.

    Returns
    -------
    ndarray or float
        Horizontal distance to the middle of the bar, m.

    Examples
    --------
    >>> round(float(distance_of_angle_m(0.2, 2.0)), 4)
    9.9666
    """
    return np.asarray(length_m) / 2 / np.tan(np.asarray(angle_rad) / 2)


def angle_of_distance_rad(distance_m, length_m):
    """Angle subtended by a bar, rad; the inverse of `distance_of_angle_m`.

    Examples
    --------
    >>> round(float(angle_of_distance_rad(distance_of_angle_m(0.2, 2.0), 2.0)), 12)
    0.2
    """
    return 2 * np.arctan2(np.asarray(length_m) / 2, distance_m)


def distance_sd_m(angle_rad, length_m, angle_sd_rad):
    """Standard deviation of the distance caused by the angle.

    Parameters
    ----------
    angle_rad, length_m : array_like
        As in `distance_of_angle_m`.
    angle_sd_rad : array_like
        Standard deviation of the angle, rad.

    Returns
    -------
    ndarray or float
        Standard deviation, m.

    Examples
    --------
    >>> second = np.pi / 180 / 3600
    >>> round(float(1000 * distance_sd_m(0.2, 2.0, second)), 4)  # mm, 10 m away
    0.2432
    """
    return np.asarray(length_m) / (4 * np.sin(np.asarray(angle_rad) / 2) ** 2) * angle_sd_rad
