"""Data of a record for the three-dimensional view of the tank in the web page.

A shell of courses is drawn from the outlines of its sections. A horizontal cylinder or a sphere is
drawn from its dimensions. The record of a mesh has no faces, so that the page states the reason for
the missing view.
"""

from math import sqrt

import numpy as np

from tankcal.report.blocks import Block
from tankcal.report.plots.style import round_factor
from tankcal.report.web import pack_numbers
from tankcal.report.web.wall_map import limit_rejected

MOST_POINTS = 4000  # largest number of drawn points
TENTH_MM = 1e4  # tenths of a millimetre per metre, the unit of outlines
_LARGEST = 0.1  # initial size of the largest deviation, relative to the radius
_STEPS = 48  # intervals along a curved end


def tank_view(paper):
    """Block of the view: shell with deviations, nominal form, or reason of a missing view."""
    record = paper.record
    kind = record["job"]["tank"]["kind"]
    shape = {"shell": None, "solid": None, "reason": ""}
    if record["sections"]:
        shape["shell"] = shell_of(record)
    elif kind in _PROFILES and record["solid"] and not _is_oblique(record["solid"]):
        shape["solid"] = _PROFILES[kind]({size["code"]: size["value"] for size in record["solid"]})
    else:
        drawing = "no_view_of_drawing" if kind == "vertical" else "no_view"
        code = "no_view_of_straps" if record.get("strapping") else drawing
        code = "no_view_of_guppy" if kind == "horizontal" else code
        shape["reason"] = paper.word(f"web.{code}")
    return Block({"kind": "tank_view", "text": paper.word("web.view_here"), **shape})


def _is_oblique(solid):
    """Return whether an end is no solid of revolution, which the view cannot draw."""
    return any(size["code"] in ("end_a", "end_b") and size["value"] == "guppy" for size in solid)


def shell_of(record):
    """Return the data of a shell: outlines, rings of the wall, points, initial enlargement."""
    sections, shell = record["sections"], record["shell"]
    bottom_z_m = record["job"]["datum"]["bottom_z_m"]
    form_m = [np.array(s["outline"]["radius_m"]) - s["radius_m"] for s in sections]
    largest = max(float(np.max(np.abs(outline))) for outline in form_m)
    radius_m = float(np.mean([s["radius_m"] for s in sections]))
    exaggeration = round_factor(_LARGEST * radius_m / largest) if largest else 1
    return {
        "radius_m": radius_m,
        "zero_m": record["capacity"]["zero_m"],
        "steps": len(form_m[0]),
        "form": pack_numbers(np.round(TENTH_MM * np.array(form_m)), "<i2"),
        "rings": _rings(record["courses"], sections, shell, bottom_z_m, radius_m),
        "exaggeration": exaggeration,
        "points": _points(record, bottom_z_m),
        "rejected": limit_rejected(record, largest),
    }


def _rings(courses, sections, shell, bottom_z_m, radius_m):
    """Return for each course the rings [height, section, dx, dy, dr] of its wall.

    dx, dy and dr are the differences in position and radius from an upright cylinder, m. The wall
    is straight between the sections. Below and above the sections it follows the inclined axis.
    """
    rings = []
    for course in courses:
        course_sections = [
            (i, s) for i, s in enumerate(sections) if s["course"] == course["course"]
        ]
        course_sections.sort(key=lambda pair: pair[1]["height_m"])
        if not course_sections:
            continue
        ends = [
            (course["bottom_m"], *course_sections[0]),
            *((s["height_m"], i, s) for i, s in course_sections),
        ]
        ends.append((course["top_m"], *course_sections[-1]))
        rings.append([_ring(height, i, s, shell, radius_m) for height, i, s in ends])
    return rings


def _ring(height_m, number, section, shell, radius_m):
    """Return a ring at a height, by shifting a section along the inclined axis."""
    above = height_m - section["height_m"]
    x = section["x_m"] + shell["slope_x"] * above - shell["x_m"]
    y = section["y_m"] + shell["slope_y"] * above - shell["y_m"]
    return [
        height_m,
        number,
        *(round(shift, 6) for shift in (x, y, section["radius_m"] - radius_m)),
    ]


def _points(record, bottom_z_m):
    """Return names, azimuths (degrees), heights and residuals (m) of at most MOST_POINTS points."""
    z_m = {point["point"]: point["z_m"] for point in record["points"]}
    rows = [
        (str(name), azimuth, z_m[name] - bottom_z_m, residual, number)
        for number, s in enumerate(record["sections"])
        for name, azimuth, residual in zip(
            s["points"], s["azimuth_deg"], s["residual_m"], strict=True
        )
    ]
    rows = rows[:: -(-len(rows) // MOST_POINTS) or 1]
    names, azimuth, height, residual, section = zip(*rows, strict=True) if rows else ((),) * 5
    return {
        "names": list(names),
        "azimuth_deg": pack_numbers(azimuth, "<f4"),
        "height_m": pack_numbers(height, "<f4"),
        "residual_m": pack_numbers(residual, "<f4"),
        "section": pack_numbers(section, "<u2"),
    }


def _sphere(dimensions):
    turn = np.linspace(0, np.pi, 2 * _STEPS + 1)
    radius = dimensions["diameter"] / 2
    return {
        "upright": True,
        "profile": _profile(-radius * np.cos(turn), radius * np.sin(turn)),
        "flat": [1.0, 1.0],
        "tilt": 0.0,
    }


def _lying(dimensions):
    """Return a horizontal cylinder as a profile of revolution from end a to end b."""
    length = dimensions["cylinder_length"]
    width, height = dimensions["section_width"], dimensions["section_height"]
    depth_a, r_a = _end(dimensions, "a", height / 2)
    depth_b, r_b = _end(dimensions, "b", height / 2)
    along = np.concatenate([-length / 2 - depth_a[::-1], length / 2 + depth_b])
    radius = np.concatenate([r_a[::-1], r_b])
    return {
        "upright": False,
        "profile": _profile(along, radius),
        "flat": [width / height, 1.0],
        "tilt": dimensions["axis_tilt"],
    }


def _end(dimensions, name, radius):
    """Return (distances along the axis, radii) of an end, from the cylinder to its centre."""
    kind, depth = dimensions[f"end_{name}"], dimensions.get(f"end_{name}_depth", 0.0)
    r = radius * np.cos(np.linspace(0, np.pi / 2, _STEPS + 1))
    r[-1] = 0.0
    if kind == "conical":
        return depth * (1 - r / radius), r
    if kind == "spherical" and depth:
        # Radius of a sphere through the edge and the centre of the end.
        dish = (radius**2 + depth**2) / (2 * depth)
        return np.sqrt(dish**2 - r**2) - (dish - depth), r
    if kind == "torispherical":
        return _torispherical(r, radius, dimensions, name), r
    return depth * np.sqrt(1 - (r / radius) ** 2), r  # ellipsoidal; a flat end has depth 0


def _torispherical(r, radius, dimensions, name):
    """Return the distance along the axis of a torispherical end at the radii r."""
    dish = dimensions[f"end_{name}_dish_radius"]
    knuckle = dimensions[f"end_{name}_knuckle_radius"]
    middle = radius - knuckle
    centre = -sqrt((dish - knuckle) ** 2 - middle**2)
    # The dish and the knuckle have a common tangent at the radius `meet`.
    meet = dish * middle / (dish - knuckle)
    on_knuckle = np.sqrt(np.maximum(knuckle**2 - (r - middle) ** 2, 0.0))
    return np.where(r > meet, on_knuckle, centre + np.sqrt(dish**2 - np.minimum(r, dish) ** 2))


def _profile(along, radius):
    return [[round(float(a), 5), round(float(r), 5)] for a, r in zip(along, radius, strict=True)]


_PROFILES = {"sphere": _sphere, "horizontal": _lying}
