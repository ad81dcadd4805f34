"""The part of the record that says what was measured: wall, points, sections, courses."""

from dataclasses import replace

import numpy as np

from tankcal.geometry.outlines import FULL_TURN
from tankcal.tank.courses import FORM_GRID


def shell_of(result):
    """The wall as one body: axis, tilt, residuals; None for a tank without courses."""
    if result.wall is None:
        return None
    shell, sections = result.wall.shell, result.wall.sections
    residuals = np.concatenate([section.circle.residuals_m for section in sections])
    return {
        "x_m": shell.axis_m[0],
        "y_m": shell.axis_m[1],
        "z_m": shell.z_m,
        "slope_x": shell.slope[0],
        "slope_y": shell.slope[1],
        "tilt": shell.tilt,
        "tilt_sd": shell.tilt_sd,
        "tilt_azimuth_deg": np.degrees(shell.tilt_azimuth_rad),
        "residual_sd_m": np.sqrt(np.sum(residuals**2) / (len(residuals) - 3 * len(sections))),
        "points": len(shell.reason),
        "accepted": len(result.wall.accepted),
        "noise_sd_m": shell.noise_m,
        "noise_dof": shell.noise_dof,
        "height_m": result.body.shell.volume.height_m,
    }


def adjustment_in(result):
    """The `surveys.Adjustment` that the points come from; None where they were handed in."""
    return result.adjustment


def points_of(result):
    """Every surveyed point, used or not; of an adjusted survey every adjusted point."""
    adjustment = adjustment_in(result)
    rows = _points_of_tank(result)
    if adjustment is None:
        return rows
    of_tank = {row["point"]: row for row in rows}
    adjusted = points_of_adjustment(adjustment)
    names = {row["point"] for row in adjusted}
    own = ("x_m", "y_m", "z_m", "cov_m2")  # of the target itself, not of the wall behind it
    return [
        {**row, **of_tank.get(row["point"], {}), **{key: row[key] for key in own}}
        for row in adjusted
    ] + [row for row in rows if row["point"] not in names]


def points_of_adjustment(adjustment):
    """Every adjusted point with its covariance, in their order; nothing of a tank."""
    return [
        {
            "point": name,
            **_coordinates(xyz),
            "cov_m2": covariance,
            "course": None,
            "section": None,
            "generatrix": None,
            "residual_m": None,
            "used": False,
        }
        for name, xyz, covariance in zip(
            adjustment.names,
            np.asarray(adjustment.xyz_m).tolist(),
            np.asarray(adjustment.covariance_m2).tolist(),
            strict=True,
        )
    ]


def _points_of_tank(result):
    if result.wall is None:
        return _points_of_scan(result) if result.scan is not None else []
    job, shell = result.job, result.wall.shell
    place = {}
    for section in result.wall.sections:
        for member, residual in zip(section.group.members, section.circle.residuals_m, strict=True):
            place[result.wall.accepted[member]] = (section.group, residual, member)
    rows = []
    for index, name in enumerate(job.points.names):
        group, residual, member = place.get(index, (None, None, None))
        rows.append(
            {
                "point": name,
                **_coordinates(job.points.xyz_m[index]),
                "cov_m2": None if group is None else _covariance_of(result, member),
                "course": job.courses[group.course].name if group else None,
                "section": group.name if group else None,
                "generatrix": job.points.generatrix[index],
                "residual_m": residual,
                "used": shell.reason[index] == "",
            }
        )
    return rows


def _points_of_scan(result):
    points, scan = result.job.points, result.scan
    used = set(scan.accepted.tolist())
    return [
        {
            "point": name,
            **_coordinates(points.xyz_m[index]),
            "cov_m2": None,
            "course": None,
            "section": None,
            "generatrix": points.generatrix[index],
            "residual_m": scan.residuals_m[index] if index in used else None,
            "used": index in used,
        }
        for index, name in enumerate(points.names)
    ]


def _rejected_of_scan(result):
    points, scan = result.job.points, result.scan
    return [
        {
            "point": points.names[i],
            **_coordinates(points.xyz_m[i]),
            "residual_m": scan.residuals_m[i],
            "w": scan.residuals_m[i] / scan.noise_m,
            "reason": "far_off",
            "row": points.rows[i],
        }
        for i in np.setdiff1d(np.arange(len(points.names)), scan.accepted)
    ]


def _covariance_of(result, member):
    block = result.wall.covariance_m2[3 * member : 3 * member + 3][:, 3 * member : 3 * member + 3]
    return block if isinstance(block, np.ndarray) else block.toarray()


def _coordinates(xyz):
    return dict(zip(("x_m", "y_m", "z_m"), xyz, strict=True))


def rejected_of(result):
    """Every point that is not on the wall, with the reason."""
    if result.wall is None:
        return _rejected_of_scan(result) if result.scan is not None else []
    job, shell = result.job, result.wall.shell
    return [
        {
            "point": job.points.names[i],
            **_coordinates(job.points.xyz_m[i]),
            "residual_m": shell.residual_m[i],
            "w": shell.w[i],
            "reason": shell.reason[i],
            "row": job.points.rows[i],
        }
        for i in np.flatnonzero(shell.reason != "")
    ]


def sections_of(result):
    """Circle and outline of each section, as surveyed, from the bottom up."""
    if result.wall is None:
        return []
    return [_section_of(result, section) for section in result.wall.sections]


def _section_of(result, section):
    circle, outline, group = section.circle, section.outline, section.group
    sd = np.sqrt(np.diag(circle.cofactor_m2))
    xyz = result.job.points.xyz_m[result.wall.accepted[group.members]]
    height = xyz[:, 2] - result.job.datum.bottom_z_m - group.height_m
    offset = xyz[:, :2] - np.outer(height, result.wall.shell.slope) - (circle.x_m, circle.y_m)
    modes = outline.modes_m()
    return {
        "section": group.name,
        "course": result.job.courses[group.course].name,
        "height_m": group.height_m,
        "n": len(group.members),
        "x_m": circle.x_m,
        "y_m": circle.y_m,
        "x_sd_m": sd[0],
        "y_sd_m": sd[1],
        "radius_m": circle.radius_m,
        "radius_sd_m": sd[2],
        "variance_factor": circle.variance_factor,
        "shape": outline.kind,
        "points": [result.job.points.names[i] for i in result.wall.accepted[group.members]],
        "azimuth_deg": np.degrees(np.arctan2(offset[:, 0], offset[:, 1])) % 360,
        "residual_m": circle.residuals_m,
        "area_m2": outline.area_m2(),
        "area_sd_m2": _area_sd(result, section),
        "outline": {
            "azimuth_deg": np.arange(360.0),
            "radius_m": outline.radius_m(np.radians(np.arange(360.0))),
        },
        "modes": [
            {
                "k": k,
                "amplitude_m": np.hypot(*modes[k]),
                "azimuth_deg": np.degrees(np.arctan2(modes[k, 1], modes[k, 0])) / k % (360 / k),
            }
            for k in range(2, len(modes))
        ],
    }


def _area_sd(result, section):
    azimuth, weight = section.outline.nodes()
    gradient = (section.outline.radius_m(azimuth) * weight) @ section.outline.basis(azimuth)
    by_points = gradient @ section.parameters_by_points
    index = (3 * section.group.members[:, None] + np.arange(3)).ravel()
    even = np.arange(FORM_GRID) * FULL_TURN / FORM_GRID
    form = section.outline.radius_m(even) @ section.outline.unseen_form_m(even)
    form = form * FULL_TURN / FORM_GRID
    return np.sqrt(
        by_points @ (result.wall.covariance_m2[index][:, index] @ by_points) + form @ form
    )


def courses_of(result):
    """Each course: plates, radii, and the volume of its shell, without head or parts inside."""
    if result.wall is None:
        return []
    job, rows = result.job, []
    rejected = np.flatnonzero(np.isin(result.wall.shell.reason, ("consensus", "snooping")))
    bottom = job.datum.bottom_z_m
    for index, (course, shape) in enumerate(
        zip(job.courses, result.body.shell.volume.courses, strict=True)
    ):
        own = [section for section in result.wall.sections if section.group.course == index]
        is_last = index == len(job.courses) - 1
        top_m = result.zero_m + result.table.height_m[-1] if is_last else shape.top_m
        height = top_m - shape.bottom_m
        volume, u = _partial(result, shape.bottom_m, top_m)
        in_course = [
            bottom + shape.bottom_m <= job.points.xyz_m[i, 2] < bottom + shape.top_m
            for i in rejected
        ]
        rows.append(
            {
                "course": course.name,
                "bottom_m": shape.bottom_m,
                "top_m": top_m,
                "height_m": course.height_m,
                "thickness_m": course.thickness_m,
                "paint_m": course.paint_m,
                "sections": [section.group.name for section in own],
                "points": sum(len(section.group.members) for section in own),
                "rejected": sum(in_course),
                "radius_m": np.mean([section.circle.radius_m for section in own]),
                "radius_sd_m": _radius_sd(result, shape),
                "inside_radius_m": np.sqrt(volume / height / np.pi),
                "area_m2": volume / height,
                "area_sd_m2": u / height,
                "volume_m3": volume,
                "u_m3": u,
            }
        )
    return rows


def _radius_sd(result, shape):
    """Of the mean radius of a course, from points and form: their part of sd(V) / (2 pi r h)."""
    sources = result.body.shell.sources([shape.bottom_m, shape.top_m])
    variance = sum(np.sum(np.diff(source.columns_m3, axis=0) ** 2) for source in sources)
    return (
        np.sqrt(variance)
        / np.diff(result.body.shell.volume.inset_m2([shape.bottom_m, shape.top_m]))[0]
    )


def _partial(result, low_m, high_m):
    """Volume between two heights above the bottom and its standard uncertainty, exactly."""
    shell = replace(result.body, parts=(result.body.shell,))
    volume = shell.volume_m3([low_m, high_m])
    sources = shell.sources([low_m, high_m])
    of_shell = [source for source in sources if source.kind != "datum"]  # joints know no zero
    variance = sum(np.sum(np.diff(source.columns_m3, axis=0) ** 2) for source in of_shell)
    return volume[1] - volume[0], np.sqrt(variance)
