"""What the standard deviations of two calibrations alone would make of a figure of stability.

The ideal point xi of a measured one moves by d xi = -(d m / d xi)^-1 (d m / d q) dq with the
interior parameters q, where m(xi, q) is the measured point. With J those derivatives over the grid,
in pixels, and P the projection that takes out what the fit of the method takes out,

    expected = sqrt(trace(P (J1 C1 J1' + J2 C2 J2') P) / divisor)

to first order. Source: JCGM 100; imaging formulas as in tankcal.camera.imaging.
"""

import numpy as np

from tankcal.camera.imaging import image_point_derivatives


def ideal_derivatives(ideal_mm, interior, form):
    """(n, 2, 13) derivatives of ideal image points at fixed measured ones, by PARAMETERS.

    ideal_mm  (n, 2) from the principal point        interior  (13,)
    Of c they are zero: the point is counted in mm, not as a direction.
    """
    of_ideal = form.convention == "distortion_of_ideal"
    q = tuple(np.asarray(interior, dtype=float))
    rays = (*(ideal_mm.T / q[0]), -np.ones(len(ideal_mm)))
    rows = image_point_derivatives(rays, np.eye(3).ravel(), q, form.numbers, of_ideal)[2:]
    by_all = np.stack([np.column_stack(np.broadcast_arrays(*row)) for row in rows], axis=1)
    slope, measured = by_all[:, :, :2] / q[0], by_all[:, :, 6:]
    measured[:, :, 0] = 0.0
    return -np.linalg.solve(slope, measured)


def covariance_of(camera, known=None, needs_c=True):
    """(13, 13) covariance of a camera's parameters; None where it is not known.

    known    (13, 13) or None: from the sds, uncorrelated. A parameter that is 0 and has no sd is no
             part of the model
    needs_c  False: c does not bear on the figure, and may lack an sd
    """
    if known is not None:
        return np.asarray(known, dtype=float)
    sd = np.where(np.isnan(camera.sd) & (np.asarray(camera.values) == 0), 0.0, camera.sd)
    if not needs_c:
        sd[0] = 0.0
    return None if np.any(np.isnan(sd)) or not np.any(sd) else np.diag(sd**2)


def expected_px(parts, design_px, divisor):
    """The figure (see above), px.

    parts      ((2n, 13) derivatives, (13, 13) covariance) of each set
    design_px  (2n, u) what the fit takes out, or None
    """
    total = 0.0
    basis = None if design_px is None else np.linalg.qr(design_px / _lengths(design_px))[0]
    for derivatives, covariance in parts:
        left = derivatives if basis is None else derivatives - basis @ (basis.T @ derivatives)
        total += float(np.sum((left @ covariance) * left))
    return float(np.sqrt(max(total, 0.0) / divisor))


def _lengths(design):
    return np.linalg.norm(design, axis=0)
