"""Text of OpenCV cameras: YAML and XML of FileStorage, YAML of ROS, and JSON.

A matrix is a node with rows, cols and data, or in JSON a list of lists. Read are the names of the
matrix, of the coefficients and of the image's size that the samples of OpenCV and others use.
"""

import json
import re

import numpy as np

from tankcal.camera.formats.opencv import COUNTS, OpenCV
from tankcal.camera.formats.texts import (
    exact_text,
    given_twice,
    short_text,
    tell_outermost,
    xml_root,
)
from tankcal.messages import message

MATRIX = ("camera_matrix", "cameramatrix", "intrinsic_matrix", "k", "mtx", "camera_mtx")
COEFFICIENTS = ("distortion_coefficients", "distcoeffs", "dist_coeffs", "dist", "d")
WIDTH, HEIGHT = ("image_width", "width"), ("image_height", "height")
MODELS = ("plumb_bob", "rational_polynomial", "")
ENTRY = re.compile(r"( *)(?:-\s+)?\"?([A-Za-z_][\w .-]*?)\"?\s*:(?:\s+(.*))?$")
ITEM = re.compile(r"\s*-\s+([^:]*)$")
COMMENT = re.compile(r"\s#.*$")
XML_ROOT = "opencv_storage"


def parse(text, notes):
    """(OpenCV, (columns, lines) or None), or None; problems go to notes."""
    parsers = {"{": _json, "<": _xml}
    nodes = parsers.get(text.lstrip()[:1], _yaml)(text, notes)
    if nodes is None or notes.problems:
        return None
    if _is_fisheye(nodes):
        notes.tell(
            message(
                "convert_fisheye", "a fisheye camera; only the perspective model of OpenCV is read"
            )
        )
        return None
    matrix = _array(nodes, MATRIX, notes)
    coefficients = _array(nodes, COEFFICIENTS, notes)
    size = _size(nodes, notes)
    if matrix is not None:
        _check_matrix(matrix, notes)
    if coefficients is not None and coefficients.size not in COUNTS:
        expected = message(
            "convert_coefficients",
            "{count} numbers; expected 4, 5, 8, 12 or 14",
            count=coefficients.size,
        )
        notes.tell(expected, key="distortion_coefficients")
    if notes.problems:
        return None
    return OpenCV(matrix.reshape(3, 3), coefficients.ravel()), size


def _check_matrix(matrix, notes):
    if matrix.size != 9:
        notes.tell(
            message("convert_matrix", "{count} numbers; expected 3 x 3", count=matrix.size),
            key="camera_matrix",
        )
        return
    (fx, skew, _), (low, fy, _), last = matrix.reshape(3, 3)
    if fx <= 0 or fy <= 0:
        notes.tell(
            message(
                "convert_focal", "fx = {fx:g}, fy = {fy:g}; expected both above 0", fx=fx, fy=fy
            ),
            key="camera_matrix",
        )
    if low != 0 or tuple(last) != (0, 0, 1):
        notes.tell(
            message("convert_matrix_rows", "expected the rows fx 0 cx, 0 fy cy, 0 0 1"),
            key="camera_matrix",
        )
    if skew != 0:
        expected = message(
            "convert_skew",
            "a skew of {skew:g} px, which OpenCV itself leaves out; expected 0",
            skew=skew,
        )
        notes.tell(expected, key="camera_matrix")


def _is_fisheye(nodes):
    model = str(nodes.get("distortion_model", "")).strip("\"' ").lower()
    return model not in MODELS or str(nodes.get("fisheye_model", "0")).strip() not in ("0", "False")


def _size(nodes, notes):
    found = [_first(nodes, names) for names in (WIDTH, HEIGHT)]
    if found == [(None, None), (None, None)]:
        return None
    for (key, _), name in zip(found, ("image_width", "image_height"), strict=True):
        if key is None:
            notes.tell(
                message("convert_one_side", "missing; expected both sides of the image or none"),
                key=name,
            )
    return tuple(notes.count(value, key=key) if key else 2 for key, value in found)


def _first(nodes, names):
    """(key, value) of the first of the names that is there, else (None, None)."""
    return next(((key, nodes[key]) for key in names if key in nodes), (None, None))


def _array(nodes, names, notes):
    key, node = _first(nodes, names)
    if key is None:
        notes.tell(
            message(
                "convert_under_name",
                "missing; expected it under a name such as {name}",
                name=names[0],
            ),
            key=names[0],
        )
        return None
    shape = None
    if isinstance(node, dict):
        shape = [node.get("rows"), node.get("cols")]
        node = node.get("data")
    flat = _flat(node)
    if flat is None or (not flat and key in MATRIX):
        notes.tell(message("convert_no_matrix", "no numbers; expected a matrix"), key=key)
        return None
    before = len(notes.problems)
    values = np.array([notes.number(one, key=key) for one in flat], dtype=float)
    if len(notes.problems) > before:
        return None
    if shape is not None and None not in shape:
        rows, columns = (notes.number(one, key=key) for one in shape)
        if rows * columns != values.size:
            notes.tell(
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


def _flat(node):
    """Numbers of a list of numbers or of lists of them, or None."""
    if not isinstance(node, list):
        return None
    if all(isinstance(one, list) for one in node):
        node = [one for inner in node for one in inner]
    return None if any(isinstance(one, (list, dict)) for one in node) else node


def _json(text, notes):
    twice = []

    def unique(pairs):
        keys = [key.lower() for key, _ in pairs]
        twice.extend(key for place, key in enumerate(keys) if key in keys[:place])
        return dict(zip(keys, (value for _, value in pairs), strict=True))

    try:
        found = json.loads(text, object_pairs_hook=unique)
    except (ValueError, RecursionError) as error:
        notes.tell(
            message(
                "convert_no_json", "not readable JSON ({error}); is the file complete?", error=error
            ),
            getattr(error, "lineno", None),
        )
        return None
    for key in twice:
        notes.tell(given_twice(), key=short_text(key))
    return found


def _xml(text, notes):
    """Nodes of the XML of FileStorage: matrices, numbers and texts."""
    root = xml_root(text, notes)
    if root is None:
        return None
    if root.tag != XML_ROOT:
        expected = message("convert_opencv_root", "expected {root}, as OpenCV writes it",
                           root=XML_ROOT)  # fmt: skip
        tell_outermost(root, expected, notes)
        return None
    nodes = {}
    for child in root:
        key = child.tag.lower()
        if key in nodes:
            notes.tell(given_twice(), key=short_text(key))
        if len(child):
            parts = {one.tag.lower(): (one.text or "").strip() for one in child}
            nodes[key] = parts | {"data": parts.get("data", "").split()}
        else:
            words = (child.text or "").split()
            nodes[key] = words if key in MATRIX + COEFFICIENTS else " ".join(words)
    return nodes


def _yaml(text, notes):
    """Nodes of what cameras have of YAML: keys, matrices, lists in brackets."""
    nodes, inside, row = {}, None, 0
    lines = text.splitlines()
    while row < len(lines):
        number, line = row + 1, lines[row].rstrip()
        row += 1
        if not line.strip() or line.lstrip().startswith(("%", "#", "---", "...")):
            continue
        entry = ENTRY.match(line)
        if not entry:
            continue  # a list of other things, over several lines
        indent, key, value = len(entry[1]), entry[2].lower(), (entry[3] or "").strip()
        value, row = _whole_value(value, lines, row)
        if value.startswith("["):
            value = _list(value, number, key, notes)
            if value is None:
                return None
        home = nodes if indent == 0 or inside is None else inside
        if key in home:
            notes.tell(given_twice(), number, short_text(key))
        is_node = isinstance(value, str) and (value == "" or value.startswith("!!opencv-matrix"))
        home[key] = {} if is_node and indent == 0 else value
        if indent == 0:
            inside = home[key] if is_node else None
    return nodes


def _whole_value(value, lines, row):
    """(value of a key with its lines below, number of the next line).

    A list in brackets may go over lines; its items may also stand below, each after a dash.
    """
    value = COMMENT.sub("", f" {value}").strip()
    while value.startswith("[") and value.count("[") > value.count("]") and row < len(lines):
        value += " " + COMMENT.sub("", f" {lines[row]}").strip()
        row += 1
    items = []
    while value == "" and row < len(lines) and (item := ITEM.match(lines[row])):
        items.append(COMMENT.sub("", item[1]).strip())
        row += 1
    if items and any(re.match(r"[\[\d.+-]", one) for one in items):
        value = f"[{', '.join(items)}]"
    return value, row


def _list(value, number, key, notes):
    """Numbers of a list in brackets as texts, or None after telling what is wrong.

    Some programs leave out all commas; between commas, a blank is a comma that was forgotten, or
    the list has decimal commas.
    """
    if not value.endswith("]") or value.count("[") != value.count("]"):
        text = message("convert_endless_list", "a list without end; is the file complete?")
        notes.tell(text, number, short_text(key))
        return None
    inside = re.sub(r"\]\s*,?\s*\[", ", " if "," in value else " ", value[1:-1]).strip("[] ")
    if "," not in inside:
        return inside.split()
    items = [one.strip() for one in inside.split(",") if one.strip()]
    bad = next((one for one in items if len(one.split()) > 1), None)
    if bad is not None and key in MATRIX + COEFFICIENTS + ("data",):
        text = message(
            "convert_no_comma",
            "{found} between commas; expected numbers with a decimal point and a comma after each",
            found=short_text(bad),
        )
        notes.tell(text, number, short_text(key))
        return None
    return items


def text_of(camera, size_px):
    """FileStorage YAML of an OpenCV camera."""
    lines = ["%YAML:1.0", "---", f"image_width: {size_px[0]}", f"image_height: {size_px[1]}"]
    k = np.ravel(camera.coefficients).reshape(-1, 1)
    for key, matrix in (("camera_matrix", camera.matrix), ("distortion_coefficients", k)):
        rows, columns = matrix.shape
        lines += [f"{key}: !!opencv-matrix", f"   rows: {rows}", f"   cols: {columns}", "   dt: d"]
        lines += [f"   data: [ {', '.join(map(exact_text, matrix.ravel()))} ]"]
    return "\n".join(lines) + "\n"


def json_of(camera, size_px):
    """JSON of an OpenCV camera: image_width, image_height, K (rows), dist."""
    columns, lines = map(int, size_px)
    matrix = [[float(one) for one in row] for row in camera.matrix]
    content = {"image_width": columns, "image_height": lines, "K": matrix}
    content["dist"] = [float(one) for one in np.ravel(camera.coefficients)]
    return json.dumps(content, indent=2, allow_nan=False) + "\n"
