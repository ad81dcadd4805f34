"""Cameras of Pix4D: perspective lenses, and the camera file of a project.

The file is PROJECT_pix4d_calibrated_internal_camera_parameters.cam.

With x, y the ray to the right and down, r2 = x2 + y2:

    x' = x (1 + R1 r2 + R2 r4 + R3 r6) + 2 T1 x y + T2 (r2 + 2 x2)
    y' = y (1 + R1 r2 + R2 r4 + R3 r6) + 2 T2 x y + T1 (r2 + 2 y2)
    x mm = Px + F x'        y mm = Py + F y'

Coordinates count from the upper left corner of the sensor. T1 and T2 are p1 and p2 of OpenCV. The
file names R1, R2, R3 as K1, K2, K3, and states the size of the sensor in a remark.

Source: Pix4D support, "How are the internal and external camera parameters defined?". A caption in
this source places the origin at the lower left corner. The calibration printed by Pessoa 2017
(quadro 1) agrees with tables 6 to 9 only for the definition above. With y upwards, no signs of T1
and T2 agree.
"""

import re
from dataclasses import dataclass

from tankcal.camera.formats.brown import Brown, Terms, convert_from_brown, convert_to_brown
from tankcal.camera.formats.texts import exact_text, short_text
from tankcal.messages import message

KEYS = ("F", "Px", "Py", "K1", "K2", "K3", "T1", "T2")
HEAD = re.compile(r"pix4d camera calibration file\s*(.*)", re.IGNORECASE)
INPHO = re.compile(r"\s*camera_calibration_file", re.IGNORECASE)
SENSOR = re.compile(r"sensor width of\s+([\d.eE+-]+)\s*x\s*([\d.eE+-]+)", re.IGNORECASE)
SAME_SHAPE = 0.01  # relative; the remark states the size of the sensor with few digits


@dataclass(frozen=True)
class Pix4D:
    """Perspective camera of Pix4D.

    Attributes
    ----------
    sensor_mm : tuple of float
        Width and height of the sensor, mm.
    f_mm, px_mm, py_mm : float
        Focal length and principal point, mm.
    r : tuple of three
        R1, R2, R3.
    t : tuple of two
        T1, T2.
    error_px : float
        Largest error of the conversion over the frame, px.
    """

    sensor_mm: tuple[float, float]
    f_mm: float
    px_mm: float
    py_mm: float
    r: tuple = (0.0, 0.0, 0.0)
    t: tuple = (0.0, 0.0)
    error_px: float = 0.0


def convert_from_pix4d(camera, size_px):
    """Convert to a FramedCamera in the plain Form(), exactly.

    Parameters
    ----------
    camera : Pix4D
        The camera.
    size_px : sequence of two int
        Columns and lines. The pixels are square, with a side of the sensor's height divided by the
        lines.

    Raises
    ------
    SolutionError
        If the distortion folds the image within the frame.
    """
    pixel = camera.sensor_mm[1] / size_px[1]
    f = camera.f_mm / pixel
    k1, k2, k3 = camera.r
    # Pix4D counts from the corner of the sensor, tankcal from the centre of the first pixel.
    middle = (camera.px_mm / pixel - 0.5, camera.py_mm / pixel - 0.5)
    # The printed width may differ slightly from the width of the pixels; the middle is kept.
    shift = (size_px[0] - camera.sensor_mm[0] / pixel) / 2
    brown = Brown(f, f, middle[0] + shift, middle[1], 0.0, (k1, k2, k3, 0.0), (*camera.t, 0.0, 0.0))
    return convert_from_brown(brown, pixel, size_px)


def convert_to_pix4d(camera):
    """Convert a FramedCamera, exactly in its plain form with square pixels, else by a fit.

    Returns
    -------
    Pix4D
    """
    brown, error = convert_to_brown(
        camera, Terms(radial=3, decentring=2, two_focals=False, skew=False)
    )
    pixel = float(camera.pixel_mm[1])
    # Square pixels with the height of the camera's pixels.
    sensor = (camera.size_px[0] * pixel, camera.size_px[1] * pixel)
    return Pix4D(
        sensor,
        brown.fy * pixel,
        (brown.cx + 0.5) * pixel,
        (brown.cy + 0.5) * pixel,
        brown.k[:3],
        brown.p[:2],
        error,
    )


def parse(text, notes):
    """Cameras [(name, Pix4D)] of a .cam file; problems are added to `notes`."""
    parts = []
    for row, line in enumerate(text.splitlines(), 1):
        head = HEAD.match(line.strip())
        if INPHO.match(line):
            expected = message(
                "convert_inpho",
                "the form for Inpho; expected "
                "PROJECT_pix4d_calibrated_internal_camera_parameters.cam, beside it",
            )
            notes.add(expected, row)
            return []
        if head:
            name = notes.name(head[1], row) if head[1] else str(len(parts))
            parts.append((name, row, []))
        # Lines after a heading belong to its camera.
        elif parts:
            parts[-1][2].append((row, line.strip()))
        elif line.strip():
            notes.add(
                message(
                    "convert_pix4d_first",
                    "{found}; expected Pix4D camera calibration file 0",
                    found=short_text(line.strip()),
                ),
                row,
            )
            return []
    if not parts:
        notes.add(
            message(
                "convert_pix4d_none", "no camera; expected a line Pix4D camera calibration file 0"
            )
        )
    return [(name, _parse_camera(row, lines, notes)) for name, row, lines in parts]


def _parse_camera(head_row, lines, notes):
    """Pix4D camera from numbered lines; problems are added to `notes`."""
    values, sensor = {}, None
    for row, line in lines:
        size = SENSOR.search(line)
        if line.startswith("#"):
            if size:
                sides = size.groups()
                sensor = tuple(notes.number(side, row, "sensor width", above=0) for side in sides)
            continue
        key, _, value = line.partition(" ")
        if not line:
            continue
        if key not in KEYS:
            notes.add(
                message(
                    "convert_pix4d_unknown", "unknown; expected {known}", known=", ".join(KEYS)
                ),
                row,
                short_text(key),
            )
        elif key in values:
            notes.add(
                message("convert_pix4d_twice", "given twice; expected once for each camera"),
                row,
                key,
            )
        else:
            values[key] = notes.number(value.strip(), row, key, above=0 if key == "F" else None)
    for key in KEYS:
        if key not in values:
            notes.add(
                message("convert_pix4d_missing", "missing; is the file complete?"), head_row, key
            )
            # A substitute value lets the remaining keys be checked.
            values[key] = 0.0
    if sensor is None:
        expected = message(
            "convert_sensor_width",
            "missing; expected a remark such as #Focal Length mm assuming a sensor width of "
            "6.17x4.63mm",
        )
        notes.add(expected, head_row, "sensor width")
        sensor = (1.0, 1.0)
    f, px, py, *k, t1, t2 = (values[key] for key in KEYS)
    return Pix4D(sensor, f, px, py, tuple(k), (t1, t2))


def frame_fits_sensor(camera, size_px):
    """Whether a frame of size_px (columns, lines) has the proportions of the sensor."""
    # Equal proportions mean square pixels.
    width, height = camera.sensor_mm
    return abs(width * size_px[1] / (height * size_px[0]) - 1) <= SAME_SHAPE


def format_text(cameras):
    """Text of a .cam file for [(name, Pix4D)]."""
    lines = []
    for name, camera in cameras:
        width, height = map(exact_text, camera.sensor_mm)
        f, px, py = map(exact_text, (camera.f_mm, camera.px_mm, camera.py_mm))
        lines += [f"Pix4D camera calibration file {name}"]
        lines += [f"#Focal Length mm assuming a sensor width of {width}x{height}mm", f"F {f}"]
        lines += ["#Principal Point mm", f"Px {px}", f"Py {py}"]
        lines += ["#Symmetrical Lens Distortion Coeffs"]
        lines += [f"K{i} {exact_text(k)}" for i, k in enumerate(camera.r, 1)]
        lines += ["#Tangential Lens Distortion Coeffs"]
        lines += [f"T{i} {exact_text(t)}" for i, t in enumerate(camera.t, 1)] + [""]
    return "\n".join(lines)
