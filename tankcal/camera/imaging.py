"""Image of a point and its derivatives: formulas for arrays and for compiled loops.

The functions accept numbers or arrays. `image_rows` evaluates them for many image points, over
whole arrays, or for single image points if loops can be compiled. Symbols, forms of distortion and
conventions are defined in tankcal.camera.model.
"""

import sys

import numpy as np

from tankcal.solver.compiled import compile_functions, is_worth_compiling

LANES = 64  # image points of a photo computed together, for vector instructions


def apply_first_affinity(x, y, q, form):
    """Apply the affinity before the distortion to a point relative to the principal point.

    Parameters
    ----------
    x, y : float or ndarray, shape (n,)
        Point, mm.
    q : sequence of 13
        Interior parameters in the order of PARAMETERS, numbers or arrays (n,).
    form : sequence of 8
        See Form.numbers.

    Returns
    -------
    x, y : float or ndarray, shape (n,)
        (1 + A) x + B y and y, mm; x and y for a form without this affinity.
    """
    return (1.0 + form[6] * q[11]) * x + form[6] * q[12] * y, y


def distort(x, y, q, form):
    """Distortion of points relative to the principal point, and its derivatives by x and y.

    Parameters
    ----------
    x, y : float or ndarray, shape (n,)
        Point, mm.
    q : sequence of 13
        Interior parameters in the order of PARAMETERS, numbers or arrays (n,).
    form : sequence of 8
        See Form.numbers.

    Returns
    -------
    tuple of six
        dx, dy (mm), d dx/dx, d dx/dy, d dy/dx, d dy/dy.
    """
    k1, k2, k3, k4, p1, p2, p3, p4, a, b = q[3:13]
    _, ax, ay, bxy, byx, by, _, e = form
    r2 = x * x + y * y
    # Radial factor minus its value at R0, both by Horner's scheme; e = R0^2.
    radial = r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4))) - e * (k1 + e * (k2 + e * (k3 + e * k4)))
    # Derivative of the radial factor by r2, times 2: d radial/dx = x slope.
    slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3 + r2 * 4.0 * k4)))
    # Decentring without its factor m = 1 + P3 r2 + P4 r4; dm is the derivative like slope.
    tx = p1 * (r2 + 2.0 * x * x) + 2.0 * p2 * x * y
    ty = p2 * (r2 + 2.0 * y * y) + 2.0 * p1 * x * y
    m, dm = 1.0 + r2 * (p3 + r2 * p4), 2.0 * (p3 + 2.0 * r2 * p4)
    # Common part of d dx/dy and d dy/dx.
    cross = x * y * slope + 2.0 * (p1 * y + p2 * x) * m
    return (
        x * radial + tx * m + a * (ax * x + ay * y) + b * bxy * y,
        y * radial + ty * m + b * (byx * x + by * y),
        radial + x * x * slope + (6.0 * p1 * x + 2.0 * p2 * y) * m + tx * x * dm + a * ax,
        cross + tx * y * dm + a * ay + b * bxy,
        cross + ty * x * dm + b * byx,
        radial + y * y * slope + (6.0 * p2 * y + 2.0 * p1 * x) * m + ty * y * dm + b * by,
    )


def distortion_derivatives(x, y, q, form):
    """Derivatives of the distortion by K1..K4, P1..P4, A, B.

    Parameters
    ----------
    x, y, q, form
        As for `distort`.

    Returns
    -------
    tuple of two tuples of ten
        Derivatives of dx, and of dy.
    """
    p1, p2, p3, p4 = q[7:11]
    _, ax, ay, bxy, byx, by, _, e = form
    r2 = x * x + y * y
    k1, k2, k3, k4 = r2 - e, r2 * r2 - e * e, r2**3 - e**3, r2**4 - e**4
    m = 1.0 + r2 * (p3 + r2 * p4)
    xx, xy, yy = r2 + 2.0 * x * x, 2.0 * x * y, r2 + 2.0 * y * y
    tx, ty = (p1 * xx + p2 * xy) * r2, (p2 * yy + p1 * xy) * r2
    zero = 0.0 * r2
    return (
        (x * k1, x * k2, x * k3, x * k4, xx * m, xy * m, tx, tx * r2, ax * x + ay * y, bxy * y),
        (y * k1, y * k2, y * k3, y * k4, xy * m, yy * m, ty, ty * r2, zero, byx * x + by * y),
    )


def invert_correction(x, y, q, form):
    """Point whose correction gives an ideal point, by Newton's method.

    Parameters
    ----------
    x, y : float or ndarray, shape (n,)
        Ideal point, mm.
    q, form
        As for `distort`.

    Returns
    -------
    x, y : float or ndarray, shape (n,)
        Measured point relative to the principal point, mm.
    """
    # Six quadratic steps solve a distortion of 30 % of the radius to the last digit. The steps are
    # written one by one, because the compiler does not vectorise a loop for each point.
    px, py = _newton_step(x, y, x, y, q, form)
    px, py = _newton_step(px, py, x, y, q, form)
    px, py = _newton_step(px, py, x, y, q, form)
    px, py = _newton_step(px, py, x, y, q, form)
    px, py = _newton_step(px, py, x, y, q, form)
    return _newton_step(px, py, x, y, q, form)


def _newton_step(px, py, x, y, q, form):
    """One Newton step for p + side d(p) = (x, y), from p = (px, py)."""
    side = form[0]
    dx, dy, dxx, dxy, dyx, dyy = distort(px, py, q, form)
    # Jacobian [a b; c d] of the left side, and the residual (ex, ey).
    a, b, c, d = 1.0 + side * dxx, side * dxy, side * dyx, 1.0 + side * dyy
    ex, ey = px + side * dx - x, py + side * dy - y
    determinant = a * d - b * c
    return px - (d * ex - b * ey) / determinant, py - (a * ey - c * ex) / determinant


def image_point(x, y, q, form, of_ideal):
    """Measured coordinates of an ideal point, and their derivatives.

    Parameters
    ----------
    x, y : float or ndarray, shape (n,)
        Ideal point relative to the principal point, mm.
    q, form
        As for `distort`.
    of_ideal : bool
        True for "distortion_of_ideal".

    Returns
    -------
    tuple of twelve
        Measured x and y in the frame of the image; x and y of the point of evaluation of the
        distortion; d x/d xi, d x/d eta, d y/d xi, d y/d eta; d x/d dx, d x/d dy, d y/d dx, d y/d dy
        by the distortion at this point.
    """
    if of_ideal:
        dx, dy, dxx, dxy, dyx, dyy = distort(x, y, q, form)
        px, py, mx, my = x, y, q[1] + x + dx, q[2] + y + dy
        a, b, c, d = 1.0 + dxx, dxy, dyx, 1.0 + dyy
        e, f, g, h = 1.0, 0.0, 0.0, 1.0
    else:
        side = form[0]
        px, py = invert_correction(x, y, q, form)
        _, _, dxx, dxy, dyx, dyy = distort(px, py, q, form)
        a, b, c, d = 1.0 + side * dxx, side * dxy, side * dyx, 1.0 + side * dyy
        # Implicit differentiation of p + side d(p) = ideal: dp = J^-1 (d ideal - side d_K).
        t = 1.0 / (a * d - b * c)
        mx, my = q[1] + px, q[2] + py
        a, b, c, d = d * t, -b * t, -c * t, a * t
        e, f, g, h = -side * a, -side * b, -side * c, -side * d
    # Without an affinity before the distortion.
    if form[6] == 0.0:
        return mx, my, px, py, a, b, c, d, e, f, g, h
    # Inverse of apply_first_affinity: x = s (x' - B y), s = 1/(1 + A).
    s, k = 1.0 / (1.0 + q[11]), q[12]
    mx = q[1] + s * (mx - q[1] - k * (my - q[2]))
    a, b, e, f = s * (a - k * c), s * (b - k * d), s * (e - k * g), s * (f - k * h)
    return mx, my, px, py, a, b, c, d, e, f, g, h


def ideal_point(u, v, w, r, c):
    """Ideal point of (u, v, w) = R (X - S), and its derivatives.

    Parameters
    ----------
    u, v, w : float or ndarray, shape (n,)
        Coordinates in the camera system, m.
    r : sequence of nine
        Elements of R, row by row, numbers or arrays (n,).
    c : float or ndarray, shape (n,)
        Principal distance, mm.

    Returns
    -------
    tuple
        xi, eta (mm) and a tuple of derivatives for each: by X (3), rotation (3) and c. The
        derivatives by S have the opposite sign of those by X.
    """
    # xi = c x, eta = c y; d xi/dX = -c/w (row 1 of R + x row 3 of R).
    x, y, f = -u / w, -v / w, c / w
    xy = c * x * y
    return (
        c * x,
        c * y,
        (
            -f * (r[0] + x * r[6]),
            -f * (r[1] + x * r[7]),
            -f * (r[2] + x * r[8]),
            xy,
            -c * (1.0 + x * x),
            -c * y,
            x,
        ),
        (
            -f * (r[3] + y * r[6]),
            -f * (r[4] + y * r[7]),
            -f * (r[5] + y * r[8]),
            c * (1.0 + y * y),
            -xy,
            c * x,
            y,
        ),
    )


def image_point_derivatives(p, r, q, form, of_ideal):
    """Measured coordinates of a point and all derivatives.

    Parameters
    ----------
    p : sequence of three
        X - S, numbers or arrays (n,), m.
    r : sequence of nine
        Elements of R, row by row.
    q : sequence of 13
        Interior parameters.
    form, of_ideal
        As for `image_point`.

    Returns
    -------
    tuple
        x, y (mm) and 3 + 3 + 13 derivatives for each: by X, rotation and interior parameters.
    """
    # (u, v, w) = R (X - S).
    u = r[0] * p[0] + r[1] * p[1] + r[2] * p[2]
    v = r[3] * p[0] + r[4] * p[1] + r[5] * p[2]
    w = r[6] * p[0] + r[7] * p[1] + r[8] * p[2]
    xi, eta, dxi, deta = ideal_point(u, v, w, r, q[0])
    x, y, px, py, a, b, c, d, e, f, g, h = image_point(xi, eta, q, form, of_ideal)
    kx, ky = distortion_derivatives(px, py, q, form)
    # Chain rule: coordinate by distortion, distortion by its parameters.
    by_kx = combine_ten(e, f, kx, ky)
    # The affinity before the distortion: derivatives of x = s (x' - B y) by A and B.
    affinity_factor = form[6] / (1.0 + form[6] * q[11])
    by_a, by_b = by_kx[8] - affinity_factor * (x - q[1]), by_kx[9] - affinity_factor * (y - q[2])
    unit, zero = 1.0 + 0.0 * x, 0.0 * x
    return (
        x,
        y,
        combine_seven(a, b, dxi, deta) + (unit, zero) + by_kx[:8] + (by_a, by_b),
        combine_seven(c, d, dxi, deta) + (zero, unit) + combine_ten(g, h, kx, ky),
    )


def ideal_point_derivatives(p, r, q, measured, form, of_ideal):
    """Misclosure in the ideal image and all derivatives.

    The misclosure is the ideal point of the object point minus the corrected measured point, which
    also depends on the interior parameters.

    Parameters
    ----------
    p, r, q
        As for image_point_derivatives.
    measured : sequence of two
        Measured x and y, numbers or arrays (n,), mm.
    form, of_ideal
        As for `image_point`.

    Returns
    -------
    tuple
        Misclosures in x and y (mm), and 3 + 3 + 13 derivatives for each.

    Notes
    -----
    y is the measured coordinate relative to the principal point, after the affinity before the
    distortion, if any. A correction gives p = y + side d(y), so that dp = -(1 + side d') d(x0, y0)
    + side d_K. A distortion of the ideal point satisfies p + d(p) = y, so that dp = (1 + d')^-1
    (-d(x0, y0) - d_K).
    """
    u = r[0] * p[0] + r[1] * p[1] + r[2] * p[2]
    v = r[3] * p[0] + r[4] * p[1] + r[5] * p[2]
    w = r[6] * p[0] + r[7] * p[1] + r[8] * p[2]
    xi, eta, dxi, deta = ideal_point(u, v, w, r, q[0])
    from_x, from_y = measured[0] - q[1], measured[1] - q[2]
    x, y = apply_first_affinity(from_x, from_y, q, form)
    zero = 0.0 * x
    if of_ideal:
        x, y = invert_correction(
            x, y, q, (1.0, form[1], form[2], form[3], form[4], form[5], form[6], form[7])
        )
        _, _, dxx, dxy, dyx, dyy = distort(x, y, q, form)
        a, b, c, d = 1.0 + dxx, dxy, dyx, 1.0 + dyy
        t = 1.0 / (a * d - b * c)
        a, b, c, d = d * t, -b * t, -c * t, a * t  # derivatives of p by y
        corrected_x, corrected_y = x, y
        e, f, g, h = a, b, c, d
    else:
        side = form[0]
        dx, dy, dxx, dxy, dyx, dyy = distort(x, y, q, form)
        a, b, c, d = 1.0 + side * dxx, side * dxy, side * dyx, 1.0 + side * dyy
        corrected_x, corrected_y = x + side * dx, y + side * dy
        e, f, g, h = zero - side, zero, zero, zero - side
    kx, ky = distortion_derivatives(x, y, q, form)
    by_kx, by_ky = combine_ten(e, f, kx, ky), combine_ten(g, h, kx, ky)
    # Derivatives of the affinity before the distortion; x0 and y0 act through it.
    scale, skew = 1.0 + form[6] * q[11], form[6] * q[12]
    by_a, by_b = form[6] * from_x, form[6] * from_y
    return (
        xi - corrected_x,
        eta - corrected_y,
        dxi + (a * scale, a * skew + b) + by_kx[:8] + (by_kx[8] - a * by_a, by_kx[9] - a * by_b),
        deta + (c * scale, c * skew + d) + by_ky[:8] + (by_ky[8] - c * by_a, by_ky[9] - c * by_b),
    )


def combine_seven(a, b, p, q):
    """Linear combination a p + b q of seven elements, numbers or arrays."""
    return (
        a * p[0] + b * q[0],
        a * p[1] + b * q[1],
        a * p[2] + b * q[2],
        a * p[3] + b * q[3],
        a * p[4] + b * q[4],
        a * p[5] + b * q[5],
        a * p[6] + b * q[6],
    )


def combine_ten(a, b, p, q):
    """Linear combination a p + b q of ten elements, numbers or arrays."""
    return combine_seven(a, b, p[:7], q[:7]) + (
        a * p[7] + b * q[7],
        a * p[8] + b * q[8],
        a * p[9] + b * q[9],
    )


def _store_results(lane, l, x, y, dx, dy):
    """Store the results for image point l.

    The elements are stored one by one, because the compiler can vectorise assignments to constant
    places.
    """
    lane[3, l], lane[4, l] = x, y
    lane[5, l], lane[24, l] = dx[0], dy[0]
    lane[6, l], lane[25, l] = dx[1], dy[1]
    lane[7, l], lane[26, l] = dx[2], dy[2]
    lane[8, l], lane[27, l] = dx[3], dy[3]
    lane[9, l], lane[28, l] = dx[4], dy[4]
    lane[10, l], lane[29, l] = dx[5], dy[5]
    lane[11, l], lane[30, l] = dx[6], dy[6]
    lane[12, l], lane[31, l] = dx[7], dy[7]
    lane[13, l], lane[32, l] = dx[8], dy[8]
    lane[14, l], lane[33, l] = dx[9], dy[9]
    lane[15, l], lane[34, l] = dx[10], dy[10]
    lane[16, l], lane[35, l] = dx[11], dy[11]
    lane[17, l], lane[36, l] = dx[12], dy[12]
    lane[18, l], lane[37, l] = dx[13], dy[13]
    lane[19, l], lane[38, l] = dx[14], dy[14]
    lane[20, l], lane[39, l] = dx[15], dy[15]
    lane[21, l], lane[40, l] = dx[16], dy[16]
    lane[22, l], lane[41, l] = dx[17], dy[17]
    lane[23, l], lane[42, l] = dx[18], dy[18]


def _compute_rows_in_loops(
    xyz, photo_xyz, rotation, interior, form, of_ideal, point, photo, xy, weight, active, w, jac,
    in_ideal,
):  # fmt: skip
    """Compute `image_rows` for up to LANES neighbouring image points of a photo at a time.

    Rows of lane: X - S (3), measured point and later its misclosure (2), derivatives of x (19) and
    of y (19). Elements are named one by one, because slices of arrays cost more than numbers.
    """
    lane = np.empty((43, LANES))
    end, n = 0, len(point)
    while end < n:
        begin, f = end, photo[end]
        # Collect neighbouring image points of the same photo.
        while end < n and end - begin < LANES and photo[end] == f:
            end += 1
        turn = (
            rotation[f, 0, 0], rotation[f, 0, 1], rotation[f, 0, 2],
            rotation[f, 1, 0], rotation[f, 1, 1], rotation[f, 1, 2],
            rotation[f, 2, 0], rotation[f, 2, 1], rotation[f, 2, 2],
        )  # fmt: skip
        parameters = (
            interior[f, 0], interior[f, 1], interior[f, 2], interior[f, 3], interior[f, 4],
            interior[f, 5], interior[f, 6], interior[f, 7], interior[f, 8], interior[f, 9],
            interior[f, 10], interior[f, 11], interior[f, 12],
        )  # fmt: skip
        for l in range(end - begin):
            j = point[begin + l]
            lane[0, l] = xyz[j, 0] - photo_xyz[f, 0]
            lane[1, l] = xyz[j, 1] - photo_xyz[f, 1]
            lane[2, l] = xyz[j, 2] - photo_xyz[f, 2]
            lane[3, l], lane[4, l] = xy[begin + l, 0], xy[begin + l, 1]
        _compute_lane(lane, end - begin, turn, parameters, form, of_ideal, in_ideal)
        for l in range(end - begin):
            i = begin + l
            wx, wy = weight[i, 0], weight[i, 1]
            w[i, 0], w[i, 1] = lane[3, l] * wx, lane[4, l] * wy
            if len(jac) == 0:
                continue
            # Weights turn derivatives into whitened derivatives; position S has the opposite sign
            # of X.
            for k in range(3):
                gx, gy = lane[5 + k, l] * wx, lane[24 + k, l] * wy
                jac[i, 0, k], jac[i, 1, k] = gx, gy
                jac[i, 0, 3 + k], jac[i, 1, 3 + k] = -gx, -gy
                jac[i, 0, 6 + k], jac[i, 1, 6 + k] = lane[8 + k, l] * wx, lane[27 + k, l] * wy
            for k in range(len(active)):
                jac[i, 0, 9 + k] = lane[11 + active[k], l] * wx
                jac[i, 1, 9 + k] = lane[30 + active[k], l] * wy


def _compute_lane(lane, n, turn, parameters, form, of_ideal, in_ideal):
    """Misclosures and derivatives of n image points of a photo, in the rows of lane."""
    # The case is chosen outside the loops.
    if in_ideal:
        for l in range(n):
            x, y, dx, dy = ideal_point_derivatives(
                (lane[0, l], lane[1, l], lane[2, l]), turn, parameters, (lane[3, l], lane[4, l]),
                form, of_ideal,
            )  # fmt: skip
            _store_results(lane, l, x, y, dx, dy)
    elif of_ideal:
        for l in range(n):
            x, y, dx, dy = image_point_derivatives(
                (lane[0, l], lane[1, l], lane[2, l]), turn, parameters, form, True
            )
            _store_results(lane, l, x - lane[3, l], y - lane[4, l], dx, dy)
    else:
        for l in range(n):
            x, y, dx, dy = image_point_derivatives(
                (lane[0, l], lane[1, l], lane[2, l]), turn, parameters, form, False
            )
            _store_results(lane, l, x - lane[3, l], y - lane[4, l], dx, dy)


_COMPILED = (
    "apply_first_affinity",
    "distort",
    "distortion_derivatives",
    "_newton_step",
    "invert_correction",
    "image_point",
    "ideal_point",
    "combine_seven",
    "combine_ten",
    "image_point_derivatives",
    "ideal_point_derivatives",
    "_store_results",
    "_compute_lane",
    "_compute_rows_in_loops",
)


def _compute_rows_in_arrays(
    xyz, photo_xyz, rotation, interior, form, of_ideal, point, photo, xy, weight, active, w, jac,
    in_ideal,
):  # fmt: skip
    """Compute `image_rows` over whole arrays."""
    p = (xyz[point] - photo_xyz[photo]).T
    r = rotation.reshape(-1, 9)[photo].T
    p, r, q = tuple(p), tuple(r), tuple(interior[photo].T)
    if in_ideal:
        x, y, dx, dy = ideal_point_derivatives(p, r, q, tuple(xy.T), form, of_ideal)
        w[:] = np.column_stack([x, y]) * weight
    else:
        x, y, dx, dy = image_point_derivatives(p, r, q, form, of_ideal)
        w[:] = (np.column_stack([x, y]) - xy) * weight
    if len(jac) == 0:
        return
    for row, derivatives in ((0, dx), (1, dy)):
        d = np.stack(derivatives, axis=1) * weight[:, row, None]
        jac[:, row, :3] = d[:, :3]
        jac[:, row, 3:6] = -d[:, :3]
        jac[:, row, 6:9] = d[:, 3:6]
        jac[:, row, 9:] = d[:, 6 + active]


def image_rows(*arguments, in_ideal=False):
    """Whitened misclosures of image coordinates, computed minus measured, and derivatives.

    Parameters
    ----------
    xyz : ndarray, shape (points, 3)
        Object points, m.
    photo_xyz : ndarray, shape (photos, 3)
        Projection centres, m.
    rotation : ndarray, shape (photos, 3, 3)
        Rotation matrices.
    interior : ndarray, shape (photos, 13)
        Interior parameters, mm.
    form : tuple of 8
        See Form.numbers.
    of_ideal : bool
        True for "distortion_of_ideal".
    point, photo : ndarray of int, shape (n,)
        Point and photo of each image point.
    xy : ndarray, shape (n, 2)
        Measured image points, mm.
    weight : ndarray, shape (n, 2)
        Inverse standard deviations, 1/mm.
    active : ndarray of int, shape (k,)
        Indices of the required interior parameters.
    w : ndarray, shape (n, 2)
        Output: misclosures.
    jac : ndarray, shape (n, 2, 9 + k)
        Output: derivatives by point (3), photo (position 3, rotation 3) and interior parameters
        (k). Not computed for length 0.
    in_ideal : bool, optional
        If True, misclosures refer to the ideal image (`ideal_point_derivatives`).
    """
    if is_worth_compiling(len(arguments[6])):
        loops = compile_functions(sys.modules[__name__], _COMPILED)
        state = (np.ascontiguousarray(array) for array in arguments[:4])  # compiled for these alone
        loops._compute_rows_in_loops(*state, *arguments[4:], in_ideal)
    else:
        _compute_rows_in_arrays(*arguments, in_ideal)
