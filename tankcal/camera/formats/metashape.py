"""Cameras of Agisoft Metashape: frame camera, and its calibration as XML.

With x, y the ray to the right and down, r2 = x2 + y2:

    x' = x (1 + K1 r2 + K2 r4 + K3 r6 + K4 r8) + (P1 (r2 + 2 x2) + 2 P2 x y) (1 + P3 r2 + P4 r4)
    y' = y (1 + K1 r2 + K2 r4 + K3 r6 + K4 r8) + (P2 (r2 + 2 y2) + 2 P1 x y) (1 + P3 r2 + P4 r4)
    u = width/2 + cx + x' f + x' B1 + y' B2        v = height/2 + cy + y' f

P1 and P2 are exchanged relative to OpenCV. u and v count from the corner of the first pixel, cx and
cy from the middle of the image. The conversion is exact except for B2. The width of a pixel is f/(f
+ B1) times its height.

Source: Metashape user manual, appendix "Camera models"; (1 + P3 r2 + P4 r4) occurs in the manuals
of PhotoScan 1.2 to 1.4.
"""

from dataclasses import dataclass

from tankcal.camera.formats.brown import Brown, convert_from_brown, convert_to_brown
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
