"""Cameras of Agisoft Metashape and of Pix4D.

With x, y the ray to the right and down, r2 = x2 + y2:

    x' = x (1 + K1 r2 + K2 r4 + K3 r6 + K4 r8) + (P1 (r2 + 2 x2) + 2 P2 x y) (1 + P3 r2 + P4 r4)
    y' = y (1 + K1 r2 + K2 r4 + K3 r6 + K4 r8) + (P2 (r2 + 2 y2) + 2 P1 x y) (1 + P3 r2 + P4 r4)
    u = width/2 + cx + x' f + x' B1 + y' B2        v = height/2 + cy + y' f

P1 and P2 are exchanged relative to OpenCV. u and v count from the corner of the first pixel, cx and
cy from the middle of the image. The conversion is exact except for B2. The width of a pixel is f/(f
+ B1) times its height.

Source: Metashape user manual, appendix "Camera models"; (1 + P3 r2 + P4 r4) occurs in the manuals
of PhotoScan 1.2 to 1.4.

Cameras of Pix4D: perspective lenses, and the camera file of a project.

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
from tankcal.camera.formats.texts import (
    duplicate_message,
    exact_text,
    report_wrong_root,
    short_text,
    xml_root,
)
from tankcal.messages import message

TERMS = ("cx", "cy", "b1", "b2", "k1", "k2", "k3", "k4", "p1", "p2", "p3", "p4")
OTHERS = ("projection", "date", "width", "height", "f")
OLD = ("fx", "fy", "skew")


@dataclass(frozen=True)
class Metashape:
    """Frame camera of Metashape.

    Attributes
    ----------
    size_px : tuple of int
        Columns and lines.
    f, cx, cy, b1, b2 : float
        Focal length, principal point and affinity, px.
    k, p : tuple of four
        k1..k4 and p1..p4.
    error_px : float
        Largest error of the conversion over the frame, px.
    """

    size_px: tuple[int, int]
    f: float
    cx: float = 0.0
    cy: float = 0.0
    b1: float = 0.0
    b2: float = 0.0
    k: tuple = (0.0, 0.0, 0.0, 0.0)
    p: tuple = (0.0, 0.0, 0.0, 0.0)
    error_px: float = 0.0


def convert_from_metashape(camera, pixel_mm):
    """Convert to a FramedCamera in the plain Form(), exactly except for B2.

    Parameters
    ----------
    camera : Metashape
        The camera.
    pixel_mm : float
        Height of a pixel, mm; the width follows from f and B1.

    Raises
    ------
    SolutionError
        If the distortion folds the image within the frame.

    Notes
    -----
    B2 is approximated by A and B.
    """
    columns, lines = camera.size_px
    p1, p2, p3, p4 = camera.p
    # P1 and P2 are exchanged relative to OpenCV.
    brown = Brown(
        camera.f + camera.b1,
        camera.f,
        (columns - 1) / 2 + camera.cx,
        (lines - 1) / 2 + camera.cy,
        camera.b2,
        tuple(camera.k),
        (p2, p1, p3, p4),
    )
    return convert_from_brown(brown, pixel_mm, camera.size_px)


def convert_to_metashape(camera):
    """Convert a FramedCamera, exactly in its plain form without affinity, else by a fit.

    Returns
    -------
    Metashape
    """
    brown, error = convert_to_brown(camera)
    columns, lines = camera.size_px
    p1, p2, p3, p4 = brown.p
    # cx and cy count from the middle of the image.
    return Metashape(
        camera.size_px,
        brown.fy,
        brown.cx - (columns - 1) / 2,
        brown.cy - (lines - 1) / 2,
        brown.fx - brown.fy,
        brown.skew,
        brown.k,
        (p2, p1, p3, p4),
        error,
    )


def parse(text, notes):
    """Metashape camera from the text of a calibration, or None; problems are added to `notes`."""
    root = _calibration_root(text, notes)
    if root is None:
        return None
    texts = {}
    for child in root:
        if child.tag in texts:
            notes.add(duplicate_message(), key=short_text(child.tag))
        elif child.tag not in (*TERMS, *OTHERS, *OLD):
            notes.add(
                message(
                    "convert_metashape_unknown", "unknown; expected the keys of a frame camera"
                ),
                key=short_text(child.tag),
            )
        texts[child.tag] = (child.text or "").strip()
    kind = texts.get("projection", "frame")
    if kind != "frame":
        notes.add(
            message(
                "convert_metashape_kind",
                "{kind}; only frame cameras are read",
                kind=short_text(kind),
            ),
            key="projection",
        )
        return None
    # PhotoScan before 1.2 wrote fx, fy and skew.
    if any(key in texts for key in OLD):
        expected = message(
            "convert_metashape_old",
            "a form of PhotoScan before 1.2; open it in Metashape and save it again",
        )
        notes.add(expected, key=next(key for key in OLD if key in texts))
        return None
    # Values that are missing or wrong are replaced, so that one run reports all problems.
    size = tuple(_read_required(texts, key, notes.count, notes) for key in ("width", "height"))
    f = _read_required(
        texts, "f", lambda text_of_f, key: notes.number(text_of_f, key=key, above=0), notes
    )
    terms = [notes.number(texts[key], key=key) if key in texts else 0.0 for key in TERMS]
    camera = Metashape(size, f, *terms[:4], tuple(terms[4:8]), tuple(terms[8:]))
    # f + B1 is the focal length in x, which must be positive.
    if f + terms[2] <= 0:
        notes.add(
            message(
                "convert_metashape_shear",
                "{found:g} beside f = {f:g}; expected less in magnitude",
                found=terms[2],
                f=f,
            ),
            key="b1",
        )
    return camera


def _calibration_root(text, notes):
    """Root element of a calibration, or None; problems are added to `notes`."""
    root = xml_root(text, notes)
    if root is not None and root.tag != "calibration":
        expected = message(
            "convert_metashape_root",
            "expected calibration: save it in Tools, Camera Calibration, as Agisoft XML",
        )
        report_wrong_root(root, expected, notes)
        return None
    return root


def _read_required(texts, key, read, notes):
    """Value of a required key, read by `read`; 2 for a missing value, with a problem."""
    if texts.get(key, "") == "":
        notes.add(message("convert_metashape_missing", "missing; expected a number"), key=key)
        return 2
    return read(texts[key], key=key)


def format_text(camera):
    """XML of a Metashape camera; k4, p3 and p4 are omitted if zero."""
    values = dict(zip(TERMS, (camera.cx, camera.cy, camera.b1, camera.b2), strict=False))
    values |= dict(zip(TERMS[4:], (*camera.k, *camera.p), strict=True))
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', "<calibration>"]
    lines += ["  <projection>frame</projection>"]
    lines += [f"  <width>{camera.size_px[0]}</width>", f"  <height>{camera.size_px[1]}</height>"]
    lines += [f"  <f>{exact_text(camera.f)}</f>"]
    # k4, p3 and p4 are optional.
    for key, value in values.items():
        if value or key not in ("k4", "p3", "p4"):
            lines.append(f"  <{key}>{exact_text(value)}</{key}>")
    return "\n".join([*lines, "</calibration>"]) + "\n"


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


def parse_pix4d(text, notes):
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


def format_pix4d(cameras):
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
