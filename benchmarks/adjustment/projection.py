"""The image of a point by the camera of sim_tank.py, with its derivatives: numbers or arrays.

The peers that are called from Python need them; tankcal has its own. Interior unknowns are
multiples of UNIT: raw K1 to K3 are so small that solvers call the problem singular.
"""

UNIT = (1, 1, 1, 1e-8, 1e-12, 1e-16, 1e-7, 1e-7, 1e-4, 1e-4)


def image(io, eo, point, sin, cos):
    """((x, y), derivatives of x, those of y) of one point or of arrays of them.

    io (10,), eo (6,): X, Y, Z, azimuth, tilt, roll; point (3,); sin, cos of math or of numpy.
    Derivatives are 19, in the order of io, eo and point.
    """
    c, x0, y0, k1, k2, k3, p1, p2, a, b = (
        value * unit for value, unit in zip(io, UNIT, strict=True)
    )
    px, py, pz = (point[i] - eo[i] for i in range(3))
    sa, ca, sv, cv, sk, ck = (f(angle) for angle in eo[3:6] for f in (sin, cos))
    ahead = (sa * cv, ca * cv, sv)
    level, above = (ca, -sa, 0.0), (-sa * sv, -ca * sv, cv)
    right = tuple(r * ck + u * sk for r, u in zip(level, above, strict=True))
    up = tuple(u * ck - r * sk for r, u in zip(level, above, strict=True))
    away, r, u = (v[0] * px + v[1] * py + v[2] * pz for v in (ahead, right, up))
    xn, yn, scale = r / away, u / away, c / away
    # of r, u, away by azimuth, tilt and roll
    turned = (px * ca - py * sa, -px * sa - py * ca)  # along and across, of a turn about z
    by_azimuth = (
        turned[1] * ck - sv * turned[0] * sk,
        -turned[1] * sk - sv * turned[0] * ck,
        cv * turned[0],
    )
    by_tilt = (-away * sk, -away * ck, above[0] * px + above[1] * py + above[2] * pz)
    by_roll = (u, -r, 0.0)
    xb, yb = c * xn, c * yn
    ideal_x = [scale * (d[0] - xn * d[2]) for d in (by_azimuth, by_tilt, by_roll)]
    ideal_y = [scale * (d[1] - yn * d[2]) for d in (by_azimuth, by_tilt, by_roll)]
    of_x = [scale * (right[i] - xn * ahead[i]) for i in range(3)]
    of_y = [scale * (up[i] - yn * ahead[i]) for i in range(3)]
    q = xb * xb + yb * yb
    radial, slope = 1 + q * (k1 + q * (k2 + q * k3)), 2 * (k1 + q * (2 * k2 + 3 * q * k3))
    x = x0 + xb * radial + p1 * (q + 2 * xb * xb) + 2 * p2 * xb * yb + a * xb + b * yb
    y = y0 + yb * radial + 2 * p1 * xb * yb + p2 * (q + 2 * yb * yb)
    # of x and y by the ideal coordinates
    xx = radial + slope * xb * xb + 6 * p1 * xb + 2 * p2 * yb + a
    xy = slope * xb * yb + 2 * p1 * yb + 2 * p2 * xb + b
    yx = slope * xb * yb + 2 * p1 * yb + 2 * p2 * xb
    yy = radial + slope * yb * yb + 2 * p1 * xb + 6 * p2 * yb
    powers, one, none = (q, q * q, q * q * q), 1.0 + 0.0 * xb, 0.0 * xb
    io_x = [xx * xn + xy * yn, one, none, *(xb * p for p in powers)]
    io_y = [yx * xn + yy * yn, none, one, *(yb * p for p in powers)]
    io_x += [q + 2 * xb * xb, 2 * xb * yb, xb, yb]
    io_y += [2 * xb * yb, q + 2 * yb * yb, none, none]
    outer = [
        ([-(m * s + n * t) for s, t in zip(of_x, of_y, strict=True)]
         + [m * s + n * t for s, t in zip(ideal_x, ideal_y, strict=True)]
         + [m * s + n * t for s, t in zip(of_x, of_y, strict=True)])
        for m, n in ((xx, xy), (yx, yy))
    ]  # fmt: skip
    by_x = [d * unit for d, unit in zip(io_x, UNIT, strict=True)] + outer[0]
    by_y = [d * unit for d, unit in zip(io_y, UNIT, strict=True)] + outer[1]
    return (x, y), by_x, by_y
