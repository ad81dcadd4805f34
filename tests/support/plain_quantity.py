"""The chain from a dip to the quantity once more: scalars, written from the equations alone."""

import math

K = {
    "crude": [(1163.5, 341.0957, 0.0, 0.0)],
    "products": [
        (770.3520, 192.4571, 0.2438, 0.0),
        (787.5195, 1489.0670, 0.0, -0.00186840),
        (838.3127, 330.3010, 0.0, 0.0),
        (1163.5, 103.8720, 0.2701, 0.0),
    ],
    "lubricants": [(1163.5, 0.0, 0.34878, 0.0)],
}
A = [-0.148759, -0.267408, 1.080760, 1.269056, -4.089591, -1.871251, 7.438081, -3.536296]
DELTA = 0.01374979547


def ctl_to_60f(group, rho60, t_f):
    """CTL of the 2004 procedure, steps 1 to 4."""
    _, k0, k1, k2 = next(row for row in K[group] if rho60 <= row[0])
    t_c = (t_f - 32) / 1.8
    tau = t_c / 630
    t_star = 1.8 * (t_c - sum(a * tau ** (i + 1) for i, a in enumerate(A))) + 32
    a = DELTA / 2 * ((k0 / rho60 + k1) / rho60 + k2)
    b = (2 * k0 + k1 * rho60) / (k0 + (k1 + k2 * rho60) * rho60)
    rho = rho60 * (1 + (math.exp(a * (1 + 0.8 * a)) - 1) / (1 + a * (1 + 1.6 * a) * b))
    alpha = (k0 / rho + k1) / rho + k2
    step = t_star - 60.0068749
    return math.exp(-alpha * step * (1 + 0.8 * alpha * (step + DELTA)))


def rho60_of(group, rho, t_f):
    """Density at 60 degF by bisection of rho60 CTL(rho60, t) = rho."""
    low, high = 500.0, 1163.5
    for _ in range(55):
        middle = (low + high) / 2
        if middle * ctl_to_60f(group, middle, t_f) < rho:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def vcf(group, base_c, rho_base, t_c):
    """VCF of 2004 to a base in degC."""
    rho60 = rho60_of(group, rho_base, 1.8 * base_c + 32)
    return ctl_to_60f(group, rho60, 1.8 * t_c + 32) / ctl_to_60f(group, rho60, 1.8 * base_c + 32)


def net_standard_volume(volume_at, level, water, t, ambient, rho_base, sw, *, group, base_c,
                        expansion, table_c, roof=None, vcf_error=0.0):  # fmt: skip
    """NSV of one gauging, m3; roof: (mass kg, density of the table)."""
    factor = vcf(group, base_c, rho_base, t) * (1 + vcf_error)
    shell = (7 * t + ambient) / 8
    ctsh = 1 + 2 * expansion * (shell - table_c) + expansion**2 * (shell - table_c) ** 2
    fra = 0.0
    if roof is not None:
        mass, reference = roof
        fra = -mass * (1 / (rho_base * factor) - 1 / reference)
    gov = (volume_at(level) - (0.0 if water is None else volume_at(water))) * ctsh + fra
    return gov * factor * (1 - sw)
