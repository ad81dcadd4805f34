"""Cameras of OpenCV and COLMAP.

Cameras of OpenCV: camera matrix and distortion coefficients.

With x, y the ray to the right and down, r2 = x2 + y2:

    x'' = x (1 + k1 r2 + k2 r4 + k3 r6)/(1 + k4 r2 + k5 r4 + k6 r6)
          + 2 p1 x y + p2 (r2 + 2 x2) + s1 r2 + s2 r4
    y'' = y (...) + p1 (r2 + 2 y2) + 2 p2 x y + s3 r2 + s4 r4

With tauX or tauY not 0, the image plane is tilted by these angles. The centre of the first pixel is
column 0, line 0. The order of the coefficients is k1, k2, p1, p2[, k3[, k4, k5, k6[, s1..s4[, tauX,
tauY]]]], with 4, 5, 8, 12 or 14 elements.

tankcal writes five coefficients. For a camera with more than five coefficients, the plain form is
fitted over the frame.

The text is YAML or XML of FileStorage, YAML of ROS, or JSON. A matrix is a node with rows, cols and
data, or a list of lists in JSON. The accepted names of the matrix, the coefficients and the image
size are those used by the samples of OpenCV and by other programs.

Source: OpenCV's documentation, module calib3d.

Cameras of COLMAP: models SIMPLE_PINHOLE to FULL_OPENCV, and cameras.txt.

    CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]

The models equal those of OpenCV, except for the origin: the corner of the first pixel is 0, 0, and
its centre 0.5, 0.5.

Source: COLMAP's documentation, camera models and output format.
"""

import json
import re
from dataclasses import dataclass

import numpy as np

from tankcal.camera.formats.brown import Brown, Terms, convert_from_brown, convert_to_brown
from tankcal.camera.formats.frame import (
    differences_px,
    fit,
    frame_points,
    make_framed_camera,
    pixels_to_mm,
    refuse_folds,
)
from tankcal.camera.formats.texts import (
    duplicate_message,
    exact_text,
    report_wrong_root,
    short_text,
    xml_root,
)
from tankcal.camera.model import Form
from tankcal.messages import message

COUNTS = (0, 4, 5, 8, 12, 14)
NEWTON_ROUNDS = 30
FITTED = ("c", "x0", "y0", "K1", "K2", "K3", "K4", "P1", "P2")
MATRIX = ("camera_matrix", "cameramatrix", "intrinsic_matrix", "k", "mtx", "camera_mtx")
COEFFICIENTS = ("distortion_coefficients", "distcoeffs", "dist_coeffs", "dist", "d")
WIDTH, HEIGHT = ("image_width", "width"), ("image_height", "height")
MODELS = ("plumb_bob", "rational_polynomial", "")
ENTRY = re.compile(r"( *)(?:-\s+)?\"?([A-Za-z_][\w .-]*?)\"?\s*:(?:\s+(.*))?$")
ITEM = re.compile(r"\s*-\s+([^:]*)$")
COMMENT = re.compile(r"\s#.*$")
XML_ROOT = "opencv_storage"


@dataclass(frozen=True)
class OpenCV:
    """Camera of OpenCV.

    Attributes
    ----------
    matrix : ndarray, shape (3, 3)
        Camera matrix, px, without skew.
    coefficients : ndarray, shape (n,)
        Distortion coefficients, n one of COUNTS.
    error_px : float
        Largest error of the conversion over the frame, px; only rounding if OpenCV has all terms.
    """

    matrix: np.ndarray
    coefficients: np.ndarray
    error_px: float = 0.0


def convert_from_opencv(camera, pixel_mm, size_px):
    """Convert to a FramedCamera in the plain Form().

    Parameters
    ----------
    camera : OpenCV
        The camera.
    pixel_mm : float
        Height of a pixel, mm. The width follows from fx and fy, which act after the distortion,
        like pixels that are not square.
    size_px : sequence of two int
        Columns and lines.

    Raises
    ------
    SolutionError
        If the distortion folds the image within the frame.
    """
    k = np.zeros(14)
    k[: len(camera.coefficients)] = np.ravel(camera.coefficients)
    (fx, _, cx), (_, fy, cy) = np.asarray(camera.matrix, dtype=float)[:2]
    # Up to five coefficients: the plain form is exact.
    if not np.any(k[5:]):
        brown = Brown(fx, fy, cx, cy, 0.0, (k[0], k[1], k[4], 0.0), (k[2], k[3], 0.0, 0.0))
        return convert_from_brown(brown, pixel_mm, size_px)
    points = frame_points(size_px)
    rays = _invert_distortion(k, (points - [cx, cy]) / [fx, fy], points, [fx, fy]) * [1, -1]
    pixel = np.array([pixel_mm * (fy / fx), pixel_mm])
    c = fy * pixel_mm
    start = np.zeros(13)
    start[:3] = c, *pixels_to_mm([[cx, cy]], pixel, size_px)[0]
    # First-order terms of the rational polynomial as start values.
    start[[3, 7, 8]] = (k[0] - k[5]) / c**2, k[3] / c, -k[2] / c
    used = FITTED + (("A", "B") if np.any(k[8:]) else ())
    image_mm = pixels_to_mm(points, pixel, size_px)
    interior = fit(rays, image_mm, pixel, Form(), start, used).interior
    framed = make_framed_camera(interior, Form(), pixel, size_px)
    error = differences_px(framed, rays, points).max()
    return make_framed_camera(interior, Form(), pixel, size_px, error)


def convert_to_opencv(camera):
    """Convert a FramedCamera, exactly in its plain form, else by a fit over the frame.

    Returns
    -------
    OpenCV
    """
    brown, error = convert_to_brown(camera, Terms(radial=3, decentring=2, skew=False))
    matrix = np.array([[brown.fx, 0, brown.cx], [0, brown.fy, brown.cy], [0, 0, 1]])
    k1, k2, k3, _ = brown.k
    return OpenCV(matrix, np.array([k1, k2, *brown.p[:2], k3]), error)


def distort_rays(x, y, k):
    """Distorted points x'', y'' of rays.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Rays, to the right and down.
    k : sequence of 14
        Coefficients.

    Returns
    -------
    x, y : ndarray, shape (n,)
    """
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y = k
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    radial = radial / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    x_image = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + r2 * s2)
    y_image = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + r2 * s4)
    if tau_x == 0 and tau_y == 0:
        return x_image, y_image
    cx, sx, cy, sy = np.cos(tau_x), np.sin(tau_x), np.cos(tau_y), np.sin(tau_y)
    # Tilt of the image plane: rotation, then central projection onto the plane.
    rotation = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    rotation = rotation @ np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    projection = np.array(
        [[rotation[2, 2], 0, -rotation[0, 2]], [0, rotation[2, 2], -rotation[1, 2]], [0, 0, 1]]
    )
    u, v, w = (projection @ rotation) @ np.stack([x_image, y_image, np.ones_like(x_image)])
    return u / w, v / w


def _invert_distortion(k, plane, points_px, focal_px):
    """Rays (n, 2), right and down, with distorted points plane (n, 2), by Newton's method."""
    x, y = plane.T
    step = 1e-30j
    with np.errstate(all="ignore"):
        for _ in range(NEWTON_ROUNDS):
            u, v = distort_rays(x, y, k)
            # Derivatives by complex step, for all forms of distortion.
            by_x, by_y = distort_rays(x + step, y + 0j, k), distort_rays(x + 0j, y + step, k)
            (a, c), (b, d) = (np.imag(by_x) / 1e-30, np.imag(by_y) / 1e-30)
            error_x, error_y = u - plane[:, 0], v - plane[:, 1]
            determinant = a * d - b * c
            x = x - (d * error_x - b * error_y) / determinant
            y = y - (a * error_y - c * error_x) / determinant
        errors = (np.column_stack(distort_rays(x, y, k)) - plane) * focal_px
    refuse_folds(points_px, np.hypot(*errors.T))
    return np.column_stack([x, y])


def parse(text, notes):
    """Read a camera from text; problems are added to `notes`.

    Parameters
    ----------
    text : str
        Content of the file.
    notes : Notes
        Receives the problems.

    Returns
    -------
    tuple or None
        OpenCV camera, and (columns, lines) or None.
    """
    # The first character distinguishes JSON, XML and YAML.
    parsers = {"{": _parse_json, "<": _parse_xml}
    nodes = parsers.get(text.lstrip()[:1], _parse_yaml)(text, notes)
    if nodes is None or notes.problems:
        return None
    if _is_fisheye(nodes):
        notes.add(
            message(
                "convert_fisheye", "a fisheye camera; only the perspective model of OpenCV is read"
            )
        )
        return None
    matrix = _read_array(nodes, MATRIX, notes)
    coefficients = _read_array(nodes, COEFFICIENTS, notes)
    size = _read_size(nodes, notes)
    if matrix is not None:
        _check_matrix(matrix, notes)
    # OpenCV defines these numbers of coefficients only.
    if coefficients is not None and coefficients.size not in COUNTS:
        expected = message(
            "convert_coefficients",
            "{count} numbers; expected 4, 5, 8, 12 or 14",
            count=coefficients.size,
        )
        notes.add(expected, key="distortion_coefficients")
    if notes.problems:
        return None
    return OpenCV(matrix.reshape(3, 3), coefficients.ravel()), size


def _check_matrix(matrix, notes):
    """Check a camera matrix; problems are added to `notes`."""
    if matrix.size != 9:
        notes.add(
            message("convert_matrix", "{count} numbers; expected 3 x 3", count=matrix.size),
            key="camera_matrix",
        )
        return
    (fx, skew, _), (low, fy, _), last = matrix.reshape(3, 3)
    if fx <= 0 or fy <= 0:
        notes.add(
            message(
                "convert_focal", "fx = {fx:g}, fy = {fy:g}; expected both above 0", fx=fx, fy=fy
            ),
            key="camera_matrix",
        )
    # The last row and the element below fx are fixed in a camera matrix.
    if low != 0 or tuple(last) != (0, 0, 1):
        notes.add(
            message("convert_matrix_rows", "expected the rows fx 0 cx, 0 fy cy, 0 0 1"),
            key="camera_matrix",
        )
    if skew != 0:
        expected = message(
            "convert_skew",
            "a skew of {skew:g} px, which OpenCV itself leaves out; expected 0",
            skew=skew,
        )
        notes.add(expected, key="camera_matrix")


def _is_fisheye(nodes):
    """Whether the nodes describe a fisheye camera."""
    model = str(nodes.get("distortion_model", "")).strip("\"' ").lower()
    return model not in MODELS or str(nodes.get("fisheye_model", "0")).strip() not in ("0", "False")


def _read_size(nodes, notes):
    """Columns and lines of the image, or None; problems are added to `notes`."""
    entries = [_find_first(nodes, names) for names in (WIDTH, HEIGHT)]
    if entries == [(None, None), (None, None)]:
        return None
    for (key, _), name in zip(entries, ("image_width", "image_height"), strict=True):
        if key is None:
            notes.add(
                message("convert_one_side", "missing; expected both sides of the image or none"),
                key=name,
            )
    return tuple(notes.count(value, key=key) if key else 2 for key, value in entries)


def _find_first(nodes, names):
    """Key and value of the first existing name, else (None, None)."""
    return next(((key, nodes[key]) for key in names if key in nodes), (None, None))


def _read_array(nodes, names, notes):
    """Numbers of a matrix or of a list, or None; problems are added to `notes`."""
    key, node = _find_first(nodes, names)
    if key is None:
        notes.add(
            message(
                "convert_under_name",
                "missing; expected it under a name such as {name}",
                name=names[0],
            ),
            key=names[0],
        )
        return None
    shape = None
    # A FileStorage matrix with rows, cols and data.
    if isinstance(node, dict):
        shape = [node.get("rows"), node.get("cols")]
        node = node.get("data")
    flat = _flatten(node)
    if flat is None or (not flat and key in MATRIX):
        notes.add(message("convert_no_matrix", "no numbers; expected a matrix"), key=key)
        return None
    problem_count = len(notes.problems)
    values = np.array([notes.number(text, key=key) for text in flat], dtype=float)
    if len(notes.problems) > problem_count:
        return None
    if shape is not None and None not in shape:
        rows, columns = (notes.number(text, key=key) for text in shape)
        # The number of elements must agree with the declared shape.
        if rows * columns != values.size:
            notes.add(
                message(
                    "convert_matrix_size",
                    "{count} numbers; expected {rows:g} x {columns:g}",
                    count=values.size,
                    rows=rows,
                    columns=columns,
                ),
                key=key,
            )
            return None
    return values


def _flatten(node):
    """Numbers of a list, or of a list of lists; None for any other content."""
    if not isinstance(node, list):
        return None
    if all(isinstance(item, list) for item in node):
        node = [item for row in node for item in row]
    return None if any(isinstance(item, (list, dict)) for item in node) else node


def _parse_json(text, notes):
    """Content of a JSON text, with lower-case keys; None for invalid JSON."""
    duplicates = []

    def unique_keys(pairs):
        """Dictionary of pairs with lower-case keys; repeated keys are collected."""
        keys = [key.lower() for key, _ in pairs]
        duplicates.extend(key for place, key in enumerate(keys) if key in keys[:place])
        return dict(zip(keys, (value for _, value in pairs), strict=True))

    try:
        content = json.loads(text, object_pairs_hook=unique_keys)
    except (ValueError, RecursionError) as error:
        notes.add(
            message(
                "convert_no_json", "not readable JSON ({error}); is the file complete?", error=error
            ),
            getattr(error, "lineno", None),
        )
        return None
    for key in duplicates:
        notes.add(duplicate_message(), key=short_text(key))
    return content


def _parse_xml(text, notes):
    """Nodes of a FileStorage XML: matrices, numbers and texts."""
    root = xml_root(text, notes)
    if root is None:
        return None
    if root.tag != XML_ROOT:
        expected = message("convert_opencv_root", "expected {root}, as OpenCV writes it",
                           root=XML_ROOT)  # fmt: skip
        report_wrong_root(root, expected, notes)
        return None
    nodes = {}
    for child in root:
        key = child.tag.lower()
        if key in nodes:
            notes.add(duplicate_message(), key=short_text(key))
        # A matrix has child elements; other nodes contain only text.
        if len(child):
            parts = {element.tag.lower(): (element.text or "").strip() for element in child}
            nodes[key] = parts | {"data": parts.get("data", "").split()}
        else:
            words = (child.text or "").split()
            nodes[key] = words if key in MATRIX + COEFFICIENTS else " ".join(words)
    return nodes


def _parse_yaml(text, notes):
    """Nodes of the subset of YAML used for cameras: keys, matrices, lists in brackets."""
    nodes, parent, row = {}, None, 0
    lines = text.splitlines()
    while row < len(lines):
        number, line = row + 1, lines[row].rstrip()
        row += 1
        if not line.strip() or line.lstrip().startswith(("%", "#", "---", "...")):
            continue
        entry = ENTRY.match(line)
        if not entry:
            continue  # lists of other content, over several lines
        indent, key, value = len(entry[1]), entry[2].lower(), (entry[3] or "").strip()
        value, row = _join_value(value, lines, row)
        if value.startswith("["):
            value = _parse_list(value, number, key, notes)
            if value is None:
                return None
        # An indented key belongs to the last node without indentation.
        mapping = nodes if indent == 0 or parent is None else parent
        if key in mapping:
            notes.add(duplicate_message(), number, short_text(key))
        # A key without a value starts a node; its indented keys follow.
        is_node = isinstance(value, str) and (value == "" or value.startswith("!!opencv-matrix"))
        mapping[key] = {} if is_node and indent == 0 else value
        if indent == 0:
            parent = mapping[key] if is_node else None
    return nodes


def _join_value(value, lines, row):
    """Value of a key including its continuation lines, and the number of the next line.

    A list in brackets may extend over several lines. The items of a list may also follow on
    separate lines, each after a dash.
    """
    value = COMMENT.sub("", f" {value}").strip()
    while value.startswith("[") and value.count("[") > value.count("]") and row < len(lines):
        value += " " + COMMENT.sub("", f" {lines[row]}").strip()
        row += 1
    items = []
    while value == "" and row < len(lines) and (item := ITEM.match(lines[row])):
        items.append(COMMENT.sub("", item[1]).strip())
        row += 1
    if items and any(re.match(r"[\[\d.+-]", item_text) for item_text in items):
        value = f"[{', '.join(items)}]"
    return value, row


def _parse_list(value, number, key, notes):
    """Numbers of a list in brackets, as texts; None after adding a problem to `notes`.

    Some programs omit all commas. In a list with commas, a blank between numbers indicates a
    missing comma or decimal commas.
    """
    if not value.endswith("]") or value.count("[") != value.count("]"):
        text = message("convert_endless_list", "a list without end; is the file complete?")
        notes.add(text, number, short_text(key))
        return None
    # Brackets of nested lists become separators.
    content = re.sub(r"\]\s*,?\s*\[", ", " if "," in value else " ", value[1:-1]).strip("[] ")
    if "," not in content:
        return content.split()
    items = [entry.strip() for entry in content.split(",") if entry.strip()]
    invalid = next((entry for entry in items if len(entry.split()) > 1), None)
    if invalid is not None and key in MATRIX + COEFFICIENTS + ("data",):
        text = message(
            "convert_no_comma",
            "{found} between commas; expected numbers with a decimal point and a comma after each",
            found=short_text(invalid),
        )
        notes.add(text, number, short_text(key))
        return None
    return items


def format_text(camera, size_px):
    """FileStorage YAML of an OpenCV camera.

    Parameters
    ----------
    camera : OpenCV
        The camera.
    size_px : sequence of two int
        Columns and lines.

    Returns
    -------
    str
    """
    lines = ["%YAML:1.0", "---", f"image_width: {size_px[0]}", f"image_height: {size_px[1]}"]
    k = np.ravel(camera.coefficients).reshape(-1, 1)
    for key, matrix in (("camera_matrix", camera.matrix), ("distortion_coefficients", k)):
        rows, columns = matrix.shape
        lines += [f"{key}: !!opencv-matrix", f"   rows: {rows}", f"   cols: {columns}", "   dt: d"]
        lines += [f"   data: [ {', '.join(map(exact_text, matrix.ravel()))} ]"]
    return "\n".join(lines) + "\n"


def format_json(camera, size_px):
    """JSON of an OpenCV camera with image_width, image_height, K (rows) and dist.

    Parameters
    ----------
    camera : OpenCV
        The camera.
    size_px : sequence of two int
        Columns and lines.

    Returns
    -------
    str
    """
    columns, lines = map(int, size_px)
    matrix = [[float(value) for value in row] for row in camera.matrix]
    content = {"image_width": columns, "image_height": lines, "K": matrix}
    content["dist"] = [float(value) for value in np.ravel(camera.coefficients)]
    return json.dumps(content, indent=2, allow_nan=False) + "\n"


COLMAP_MODELS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
}
ORDER = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
HALF = 0.5  # px, from the corner of a pixel to its centre
EXACT_PX = 1e-9  # error below which a conversion counts as exact


@dataclass(frozen=True)
class Colmap:
    """Camera of COLMAP.

    Attributes
    ----------
    model : str
        One of MODELS.
    size_px : tuple of int
        Columns and lines.
    params : tuple
        Parameters named in MODELS, px; distortion for rays.
    error_px : float
        Largest error of the conversion over the frame, px.
    """

    model: str
    size_px: tuple[int, int]
    params: tuple
    error_px: float = 0.0


def convert_from_colmap(camera, pixel_mm):
    """Convert to a FramedCamera in the plain Form().

    Parameters
    ----------
    camera : Colmap
        The camera.
    pixel_mm : float
        Height of a pixel, mm; the width follows from fx and fy.

    Raises
    ------
    SolutionError
        If the distortion folds the image within the frame.
    """
    values = dict(zip(COLMAP_MODELS[camera.model], camera.params, strict=True))
    fx, fy = values.get("fx", values.get("f")), values.get("fy", values.get("f"))
    # COLMAP counts from the corner of the first pixel, OpenCV from its centre.
    matrix = [[fx, 0, values["cx"] - HALF], [0, fy, values["cy"] - HALF], [0, 0, 1]]
    coefficients = np.array([values.get(name, 0.0) for name in ORDER])
    return convert_from_opencv(OpenCV(np.array(matrix), coefficients), pixel_mm, camera.size_px)


def convert_to_colmap(camera, model=None):
    """Convert a FramedCamera, exactly if the model has all terms, else by a fit.

    Parameters
    ----------
    camera : FramedCamera
        The camera.
    model : str, optional
        One of MODELS. None: the simplest exact model, else FULL_OPENCV.

    Returns
    -------
    Colmap
    """
    if model is not None:
        return _convert_to_model(camera, model)
    # MODELS are ordered by complexity.
    for name in COLMAP_MODELS:
        converted = _convert_to_model(camera, name)
        if converted.error_px < EXACT_PX:
            break
    return converted


def _convert_to_model(camera, model):
    """Convert a FramedCamera to a model of COLMAP."""
    names = COLMAP_MODELS[model]
    terms = Terms(
        radial=sum(name in names for name in ("k1", "k2", "k3")),
        decentring=2 if "p1" in names else 0,
        two_focals="fx" in names,
        skew=False,
    )
    brown, error = convert_to_brown(camera, terms)
    values = {
        "f": brown.fy,
        "fx": brown.fx,
        "fy": brown.fy,
        "cx": brown.cx + HALF,
        "cy": brown.cy + HALF,
    }
    # COLMAP has no p3, p4 and k4; the rational terms are zero.
    values |= dict(zip(ORDER, (*brown.k[:2], *brown.p[:2], brown.k[2], 0.0, 0.0, 0.0), strict=True))
    return Colmap(model, camera.size_px, tuple(values[name] for name in names), error)


def parse_colmap(text, notes):
    """Cameras [(name, Colmap)] of a cameras.txt; problems are added to `notes`."""
    cameras = []
    for row, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        camera = _parse_camera(words, row, notes)
        if camera is None:
            continue
        name = notes.name(words[0], row, "CAMERA_ID")
        # A repeated camera is reported, but kept, so that all problems are found.
        if name in [other for other, _ in cameras]:
            notes.add(
                message(
                    "convert_colmap_twice",
                    "camera {name} is given twice; expected each camera once",
                    name=short_text(name),
                ),
                row,
                "CAMERA_ID",
            )
        cameras.append((name, camera))
    if not cameras and not notes.problems:
        notes.add(
            message(
                "convert_colmap_none",
                "no camera; expected lines such as 1 OPENCV 4000 3000 and its parameters",
            )
        )
    return cameras


def _parse_camera(words, row, notes):
    """Colmap from the words of a line, or None; problems are added to `notes`."""
    if len(words) < 4:
        notes.add(
            message(
                "convert_colmap_cut",
                "incomplete line; expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS",
            ),
            row,
        )
        return None
    model = words[1]
    if model not in COLMAP_MODELS:
        expected = message(
            "convert_colmap_model",
            "camera model {model}; those read are {models}",
            model=short_text(model),
            models=", ".join(COLMAP_MODELS),
        )
        notes.add(expected, row, "MODEL")
        return None
    names, texts = COLMAP_MODELS[model], words[4:]
    if len(texts) != len(names):
        expected = message(
            "convert_colmap_parameters",
            "{count} parameters of {model}; expected {expected}: {names}",
            count=len(texts),
            model=model,
            expected=len(names),
            names=" ".join(names),
        )
        notes.add(expected, row, "PARAMS")
        return None
    size = (notes.count(words[2], row, "WIDTH"), notes.count(words[3], row, "HEIGHT"))
    params = tuple(
        notes.number(text, row, name, above=0 if name[0] == "f" else None)
        for name, text in zip(names, texts, strict=True)
    )
    return Colmap(model, size, params)


def format_colmap(cameras):
    """Text of a cameras.txt for [(name, Colmap)]; names that are no numbers become numbers."""
    # Cameras are numbered unless every name is a number.
    are_numbers = all(name.isdecimal() and name.isascii() for name, _ in cameras)
    lines = ["# Camera list with one line of data per camera:"]
    lines += [
        "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]",
        f"# Number of cameras: {len(cameras)}",
    ]
    for number, (name, camera) in enumerate(cameras, 1):
        head = (name if are_numbers else str(number), camera.model, *map(str, camera.size_px))
        lines.append(" ".join((*head, *map(exact_text, camera.params))))
    return "\n".join(lines) + "\n"
