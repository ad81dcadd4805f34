"""The part of the record that lists what was adjusted: points, photos, cameras, instruments."""

import numpy as np
from scipy.special import fdtri, gammaincinv

from tankcal.calibration.edges import Frame, own_shift
from tankcal.calibration.interiors import interiors_of
from tankcal.camera.model import PARAMETERS, UNITS
from tankcal.geometry.rotations import angle_derivatives, angles_of
from tankcal.record.plain_data import plain, rows_of
from tankcal.survey.network import correlations
from tankcal.survey.network.quality import ellipsoid_factor, ellipsoids, precision

ELLIPSE = 0.95  # probability of the ellipses and ellipsoids that are drawn and listed
PROBABILITIES = (0.20, 0.90, 0.95, 0.99)
_AXES, _ANGLES = ("x", "y", "z"), ("omega", "phi", "kappa")


def adjusted_points_of(adjustment, measurements=None):
    """Each adjusted point: what it is, rays, sds, error ellipsoid and ellipse in plan at 95 %."""
    covariance, dof = np.asarray(adjustment.covariance_m2), adjustment.dof
    sd = np.sqrt(np.maximum(np.einsum("nii->ni", covariance), 0.0))
    axes, directions = ellipsoids(covariance, ELLIPSE, dof)
    azimuth, elevation = _direction(directions[:, :, 0])
    plan, plan_azimuth = _ellipses(covariance[:, :2, :2], dof)
    rays = _rays(adjustment)
    columns = {
        "point": adjustment.names,
        "kind": _kinds(adjustment, measurements),
        "rays": [rays.get(name, 0) for name in adjustment.names],
        "fixed": adjustment.fixed,
        "spherical_sd_m": sd.mean(axis=1),
        "quadratic_sd_m": np.sqrt(np.sum(sd**2, axis=1)),
        "ellipsoid_m": axes,
        "ellipsoid_azimuth_deg": azimuth,
        "ellipsoid_elevation_deg": elevation,
        "ellipse_m": plan,
        "ellipse_azimuth_deg": plan_azimuth,
    }
    return rows_of(plain(columns))


def _direction(vectors):
    """Azimuth in [0, 360) and elevation in [0, 90] of the upper end of vectors (n, 3)."""
    up = vectors * np.where(vectors[:, 2:] < 0, -1.0, 1.0)
    azimuth = np.degrees(np.arctan2(up[:, 0], up[:, 1])) % 360
    return azimuth, np.degrees(np.arcsin(np.clip(up[:, 2], 0, 1)))


def _ellipses(covariance_m2, dof):
    """Semi-axes (n, 2), largest first, and azimuth of the first, of ellipses in plan."""
    if np.isinf(dof):
        factor = np.sqrt(2 * gammaincinv(1.0, ELLIPSE))
    else:
        factor = np.sqrt(2 * fdtri(2, dof, ELLIPSE))
    values, vectors = np.linalg.eigh(covariance_m2)
    axes = factor * np.sqrt(np.maximum(values[:, ::-1], 0.0))
    return axes, np.degrees(np.arctan2(vectors[:, 0, 1], vectors[:, 1, 1])) % 180


def _rays(adjustment):
    """{point: photos that it was measured in and kept}."""
    survey = adjustment.adjusted.survey
    images = survey.image_points
    if images is None:
        return {}
    kept = images.point if images.use is None else images.point[np.asarray(images.use) > 0]
    counts = np.bincount(kept, minlength=len(survey.points)).tolist()
    return dict(zip(survey.points, counts, strict=True))


def _kinds(adjustment, measurements):
    """What each adjusted point is: "station", "control", "check" or "point"."""
    roles = {}
    for role, table in (("check", "check"), ("control", "control")):
        known = getattr(measurements, table, None)
        roles |= dict.fromkeys(known.point if known is not None else (), role)
    roles |= dict.fromkeys((one.station for one in getattr(measurements, "setups", ())), "station")
    return [roles.get(name, "point") for name in adjustment.names]


def precision_of(adjustment):
    """Precision of all points that are not fixed, m; None when every point is."""
    free = ~np.asarray(adjustment.fixed).all(axis=1)
    if not free.any():
        return None
    xyz, dof = np.asarray(adjustment.xyz_m)[free], adjustment.dof
    found = precision(xyz, np.asarray(adjustment.covariance_m2)[free])
    sd = np.sqrt(np.einsum("nii->ni", np.asarray(adjustment.covariance_m2)[free]))
    return {
        "points": int(free.sum()),
        "mean_sd_m": found.mean_sd_m,
        "axis_sd_m": found.axis_sd_m,
        "smallest_sd_m": sd.min(axis=0),
        "largest_sd_m": sd.max(axis=0),
        "range_m": found.range_m,
        "spherical_sd_m": found.spherical_sd_m.mean(),
        "quadratic_sd_m": found.quadratic_sd_m.mean(),
        "extent_m": float(np.linalg.norm(np.ptp(xyz, axis=0))),
        "proportional": found.proportional,
        "ellipsoid_factors": [
            {
                "probability": p,
                "factor": 1.0 if p == PROBABILITIES[0] else ellipsoid_factor(p, dof),
            }
            for p in PROBABILITIES
        ],
        "ellipse_probability": ELLIPSE,
    }


def photos_of(adjustment):
    """Each photo: where it was taken, its angles, their sds, and how well its points fit."""
    survey = adjustment.adjusted.survey
    if survey.photos is None or not len(survey.photos.names):
        return []
    xyz, angles, covariance = adjustment.adjusted.photos
    sd = np.sqrt(adjustment.cov_scale * np.maximum(np.einsum("nii->ni", covariance), 0.0))
    fit = _fit_of_photos(adjustment)
    rows = []
    for i, name in enumerate(survey.photos.names):
        points, rms = fit.get(name, (0, None))
        rows.append(
            {
                "photo": name,
                "camera": survey.cameras[survey.photos.camera[i]].name,
                **{f"{axis}_m": xyz[i, k] for k, axis in enumerate(_AXES)},
                **{f"{a}_deg": np.degrees(angles[i, k]) for k, a in enumerate(_ANGLES)},
                **{f"s{axis}_m": sd[i, k] for k, axis in enumerate(_AXES)},
                **{f"s_{a}_deg": np.degrees(sd[i, 3 + k]) for k, a in enumerate(_ANGLES)},
                "points": points,
                "rms_mm": rms,
            }
        )
    return rows


def _fit_of_photos(adjustment):
    """{photo: (points used, root mean square residual of a coordinate, mm)}."""
    sums = {}
    for one in adjustment.readings:
        if one.kind == "image coordinate" and not one.removed and not one.check:
            count, square = sums.get(one.ids[0], (0, 0.0))
            sums[one.ids[0]] = count + 1, square + one.residual**2
    return {name: (count // 2, np.sqrt(square / count)) for name, (count, square) in sums.items()}


def cameras_of(adjustment, measurements=None):
    """Each set of interior parameters: values, sds, correlations, effect at the edge of the frame.

    Photos with the same parameters share a set; "photos" names those of a set that is not of the
    whole camera.
    """
    return [_camera(one) for one in interiors_of(adjustment, measurements)]


def _camera(interior):
    values = dict(zip(PARAMETERS, interior.values.tolist(), strict=True))
    sds = dict(
        zip(interior.free, np.sqrt(np.maximum(np.diag(interior.covariance), 0.0)), strict=True)
    )
    scope = dict(zip(PARAMETERS, interior.scope, strict=True))
    state = dict(zip(PARAMETERS, interior.state, strict=True))
    names = [name for name in PARAMETERS if scope[name] != "off"]
    return {
        "camera": interior.camera,
        "photos": interior.photos,
        "convention": interior.form.convention,
        "affinity": interior.form.affinity,
        "radial_balance_mm": interior.form.radial_balance_mm,
        "format_mm": interior.format_mm,
        "pixel_mm": interior.frame.pixel_mm,
        "edge_mm": interior.frame.half_mm,
        "edge_known": interior.frame_known,
        "reach_mm": interior.frame.reach_mm,
        "parameters": names,
        "units": [UNITS[name] for name in names],
        "values": [values[name] for name in names],
        "sds": [sds.get(name, 0.0) for name in names],
        "scopes": [scope[name] for name in names],
        "states": [state[name] for name in names],
        "edge_um": [
            _edge_effect(name, values, interior.form, interior.frame.half_mm) for name in names
        ],
        "free": list(interior.free),
        "covariance": interior.covariance,
        "correlation": correlations(interior.covariance),
    }


def _edge_effect(name, values, form, corner_mm):
    """Largest shift (um) that a parameter makes in a corner of the image; None for c."""
    q = np.array([values[one] for one in PARAMETERS])
    shift = own_shift(name, q, form, Frame(np.asarray(corner_mm, dtype=float)))
    return None if shift is None else shift.corner_um


def instruments_of(adjustment, measurements=None):
    """Scale and offset of each instrument: as declared, and as adjusted."""
    adjusted = adjustment.adjusted
    state, layout = adjusted.solution.state, adjusted.problem.layout
    declared = {one.name: one for one in getattr(measurements, "instruments", ())}
    rows = []
    for i, tool in enumerate(adjusted.survey.instruments):
        source = declared.get(tool.name)
        details = getattr(source, "details", {})
        rows.append(
            {
                "instrument": tool.name,
                "kind": getattr(source, "kind", None),
                "details": {key: str(value) for key, value in details.items()},
                **_tool("scale", "ppm", 1e6, tool.scale, tool.scale_sd, state.scale[i],
                        _sd_of(adjustment, layout.scale[i])),
                **_tool("offset", "mm", 1e3, tool.offset_m, tool.offset_sd_m, state.offset_m[i],
                        _sd_of(adjustment, layout.offset[i])),
            }
        )  # fmt: skip
    return rows


def _tool(what, unit, factor, declared, declared_sd, value, sd):
    """What the readings say of an instrument: reading = true (1 + scale) + offset."""
    return {
        f"{what}_{unit}": factor * value,
        f"{what}_sd_{unit}": factor * sd,
        f"declared_{what}_{unit}": factor * declared,
        f"declared_{what}_sd_{unit}": factor * declared_sd,
    }


def _sd_of(adjustment, column):
    if column < 0:
        return 0.0
    q = adjustment.adjusted.solution.cofactors(np.array([column]))[0, 0]
    return float(np.sqrt(adjustment.cov_scale * max(q, 0.0)))


def systems_of(adjustment):
    """Transformation X_system = (1 + scale) R X + shift of each further system of control."""
    adjusted = adjustment.adjusted
    state, problem = adjusted.solution.state, adjusted.problem
    rows = []
    for i, system in enumerate(adjusted.survey.systems):
        rotation, scale = state.system[i], float(state.system_scale[i])
        shift = state.system_shift_m[i] - (1 + scale) * (rotation @ problem.centre_m)
        angles = np.degrees(angles_of(rotation))
        turn = angle_derivatives(rotation[None])[0]
        q = adjusted.solution.cofactors(problem.layout.system[i, :3])
        sd = np.degrees(np.sqrt(adjustment.cov_scale * np.diag(turn @ q @ turn.T)))
        rows.append(
            {
                "system": system.name,
                **{f"{axis}_m": shift[k] for k, axis in enumerate(_AXES)},
                **{f"{a}_deg": angles[k] for k, a in enumerate(_ANGLES)},
                **{f"s_{a}_deg": sd[k] for k, a in enumerate(_ANGLES)},
                "scale_ppm": 1e6 * scale,
                "scale_sd_ppm": 1e6 * _sd_of(adjustment, problem.layout.system[i, 6]),
            }
        )
    return rows
