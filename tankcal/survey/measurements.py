"""What was measured on site, as it was read: the checked tables of a survey, in SI.

Image coordinates and cameras stay in millimetres, angles are radians. Rows stand in the order of
their files, repeated readings one by one; nothing has been averaged, corrected or left out. Names
are texts; a table that is not there is None or ().
"""

from dataclasses import dataclass, field

import numpy as np

from tankcal.camera.comparator import Transformation
from tankcal.camera.focus import Lens
from tankcal.survey.network.survey import Camera


@dataclass(frozen=True)
class AdjustmentSettings:
    """[adjustment]: what the user decides.

    datum         "control", "fixed_photo", "minimal" or "inner"
    datum_points  (name, axes) with axes such as "xyz", "xy", "z": those that carry a datum
                  "minimal" or "inner"; (): the program chooses
    fixed_photo   name, for datum = "fixed_photo"
    image_sd_mm   of image coordinates that carry none; None: not given
    snooping      whether blunders are searched and set aside
    scale         of the covariances that go on: "a_priori" or "a_posteriori"
    refraction    coefficient k (0.13) for zenith angles, vertical angles and slope distances; None:
                  neither curvature nor refraction
    explain       whether a survey that does not fit is tried again as if it had been misread; what
                  compares wrong suppositions on purpose leaves it out
    reading_limit_mm  sd of one of repeated readings beyond which they are rejected; None: never
    depth_of_field    whether radial distortion follows the depth of each point
    image_weights     "measured" or "ideal": the image in which residuals are weighed (camera.Form)
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
    """A camera of cameras.toml with what [adjustment.camera] says of its parameters.

    camera     network.Camera, mm
    format_mm  (2,) width and height of the image
    pixel_mm   (2,) size of a pixel, or None: image coordinates come in mm
    lens       radial distortion by distance, which `camera` has at the focus; None: one for all
    """

    camera: Camera
    format_mm: np.ndarray
    pixel_mm: np.ndarray | None = None
    lens: Lens | None = None

    @property
    def format_px(self):
        """(2,) columns and lines of the image, whole; needs `pixel_mm`."""
        return np.round(self.format_mm / self.pixel_mm).astype(int)


@dataclass(frozen=True)
class Photo:
    """A photo: values (6,) x, y, z (m), omega, phi, kappa (rad), nan where not known.

    sd  (6,) nan: the value is an approximation; 0: it is fixed; else it is an observation
    """

    name: str
    camera: str
    values: np.ndarray
    sd: np.ndarray
    row: int | None = None


@dataclass(frozen=True)
class ImageReadings:
    """Image coordinates (n, 2), mm, x to the right and y up from the middle of the format.

    sd_mm  (n, 2), nan where not given        check  (n,) True: compared, not adjusted
    shared_sd_mm  (n, 2) of the transformation from the comparator, the same error for all readings
                  of a point; None: no photo was read on a comparator
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

    count  of the readings    sd_mm  (2,) of one of them, from the sample    row  of the first
    """

    photo: str
    name: str
    count: int
    sd_mm: np.ndarray
    row: int | None = None


@dataclass(frozen=True)
class FiducialFit:
    """How the readings of a photo's marks fit their calibrated coordinates.

    marks        (n,) names            calibrated_mm  (n, 2)
    count        (n,) readings         mean_mm        (n, 2) of the readings, without weights
    sd_mm        (n, 2) of one reading, from the sample; nan for a single one
    residual_mm  (n, 2) mean of the readings, transformed, minus calibrated
    rejected     tuple of RejectedReadings
    growth       largest sd of an image coordinate over what it would be without that of the
                 transformation; nan without image points
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
    """Control or check points: coordinates (n, 3), nan where not known.

    sd_m    (n, 3) nan: an approximation only; 0: fixed; else an observation
    system  (n,) name of the coordinate system, None: that of the survey
    check   (n,) True: compared, not adjusted
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
    """Where targets sit on the nominal tank: names of section and generatrix (or None) of each.

    z_m       (n,) in the frame of the survey, nan where not given
    offset_m  (n,) from the wall to the centre of the target, towards the observer
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

    kind                     "tape", "edm", "total_station", "theodolite", "level" or "other"
    correction               true distance = (reading + correction_m) (1 + correction), at the
    correction_m             certified temperature
    certified_temperature_c  None: readings are not corrected for temperature
    expansion_per_k          of a tape
    u_scale, u_offset_m      standard uncertainties; 0: exact; nan: free unknowns
    details                  certificate, tension_n and other things that are printed
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
    """An instrument over a station. `instrument` may be None; height_m above the station's mark."""

    name: str
    station: str
    instrument: str | None = None
    height_m: float = 0.0
    row: int | None = None


@dataclass(frozen=True)
class Readings:
    """One table of readings between points.

    table     "distances", "slope_distances", "directions", "zenith_angles", "azimuths",
              "horizontal_angles", "vertical_angles", "height_differences", "plumb_lines",
              "vectors"
    value     (n,) m or rad; zeros for plumb lines      sd  (n,) m or rad; 0: fixed
    start     (n,) point, or None where a setup says it      end    (n,) point
    origin    (n,) of horizontal angles: where they count from; else ()
    setup     (n,) of those that are taken from a set-up; else ()
    set       (n,) name of the set of directions within a set-up, or None; else ()
    instrument     (n,) of distances, or None; else ()
    horizontal     (n,) True: a horizontal distance
    temperature_c  (n,) nan where not given              target_height_m  (n,) 0 where not given
    check     (n,) True: compared, not adjusted
    sheet     what messages call the table when it stands in a workbook; else ""

    Of vectors value and sd are (n, 3), and correlation (n, 3): of x with y, x with z, y with z.
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
        """Name of its file, or of its sheet in a workbook, for messages."""
        return self.sheet or f"{self.table}.csv"


@dataclass(frozen=True)
class CorrelatedReadings:
    """Pairs of values that are correlated, one in a row of correlated_readings.csv.

    tables  (n, 2) names of their tables, "control" among them       r  (n,)
    at      (n, 2) their rows there, counted as the file's editor counts
    axis    (n, 2) 0 1 2 for x y z, of tables with one value a row: 0
    """

    tables: tuple
    at: np.ndarray
    axis: np.ndarray
    r: np.ndarray
    rows: tuple = ()
    file: str = "correlated_readings.csv"


@dataclass(frozen=True)
class NominalTank:
    """What helps with approximate values: nominal tank, and the z of its bottom (None: unknown)."""

    radius_m: float
    height_m: float
    bottom_z_m: float | None = None


@dataclass(frozen=True)
class Measurements:
    """Everything that was measured on site and goes into one adjustment.

    cameras, instruments, photos, setups  in the order of their files
    control   None: no control.csv             check    None: no check.csv
    readings  a table for each file that has rows
    nominal   None where the job has no vertical tank
    fiducials a FiducialFit for each photo that was read on a comparator: `image_points` are
              transformed by them already
    kept      (file, row) of readings that no search for blunders may set aside
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
