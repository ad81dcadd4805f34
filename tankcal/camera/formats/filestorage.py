"""Text of OpenCV cameras: YAML and XML of FileStorage, YAML of ROS, and JSON.

A matrix is a node with rows, cols and data, or a list of lists in JSON. The accepted names of the
matrix, the coefficients and the image size are those used by the samples of OpenCV and by other
programs.
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
        notes.tell(
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
        notes.tell(expected, key="distortion_coefficients")
    if notes.problems:
        return None
    return OpenCV(matrix.reshape(3, 3), coefficients.ravel()), size


def _check_matrix(matrix, notes):
    """Check a camera matrix; problems are added to `notes`."""
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
    # The last row and the element below fx are fixed in a camera matrix.
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
            notes.tell(
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
    # A FileStorage matrix with rows, cols and data.
    if isinstance(node, dict):
        shape = [node.get("rows"), node.get("cols")]
        node = node.get("data")
    flat = _flatten(node)
    if flat is None or (not flat and key in MATRIX):
        notes.tell(message("convert_no_matrix", "no numbers; expected a matrix"), key=key)
        return None
    problem_count = len(notes.problems)
    values = np.array([notes.number(text, key=key) for text in flat], dtype=float)
    if len(notes.problems) > problem_count:
        return None
    if shape is not None and None not in shape:
        rows, columns = (notes.number(text, key=key) for text in shape)
        # The number of elements must agree with the declared shape.
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
        notes.tell(
            message(
                "convert_no_json", "not readable JSON ({error}); is the file complete?", error=error
            ),
            getattr(error, "lineno", None),
        )
        return None
    for key in duplicates:
        notes.tell(given_twice(), key=short_text(key))
    return content


def _parse_xml(text, notes):
    """Nodes of a FileStorage XML: matrices, numbers and texts."""
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
            notes.tell(given_twice(), number, short_text(key))
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
        notes.tell(text, number, short_text(key))
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
        notes.tell(text, number, short_text(key))
        return None
    return items


def text_of(camera, size_px):
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


def json_of(camera, size_px):
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
