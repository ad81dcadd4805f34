"""Shell in service: volume of a warm shell relative to the table.

Source: API MPMS 12.1.1 (CTSh, shell temperature); 2.2A for the coefficient of mild steel.
"""

import numpy as np

MILD_STEEL_PER_K = 1.116e-5  # 6.20e-6 per degF
BASE_C = 15.0  # customary tables: 60 degF, that is (60 - 32) / 1.8 degC


def shell_temperature_c(liquid_c, ambient_c=None, *, insulated=False):
    """Return the temperature of the shell in service: (7 liquid + ambient) / 8.

    For an insulated shell, it is the temperature of the liquid.

    Parameters
    ----------
    liquid_c : float or ndarray
        Temperature of the liquid, degC.
    ambient_c : float or ndarray, optional
        Temperature of the ambient air, degC.
    insulated : bool, default False

    Returns
    -------
    float or ndarray
        degC.

    Raises
    ------
    ValueError
        For a shell that is not insulated, without ambient_c.

    References
    ----------
    API MPMS 12.1.1.

    Examples
    --------
    >>> shell_temperature_c(35.0, 27.0)
    34.0
    """
    if insulated:
        return liquid_c
    if ambient_c is None:
        raise ValueError("no ambient temperature; expected one for a shell that is not insulated")
    return (7 * liquid_c + ambient_c) / 8


def shell_factor(shell_c, base_c=BASE_C, expansion_per_k=MILD_STEEL_PER_K):
    """Return the factor on a volume read from the table for the temperature of the shell.

        CTSh = 1 + 2 a dT + a^2 dT^2,   dT = shell - base

    Parameters
    ----------
    shell_c : float or ndarray
        Temperature of the shell in service, degC (`shell_temperature_c`).
    base_c : float, default 15
        Reference temperature of the table, degC.
    expansion_per_k : float
        Coefficient a of linear expansion, 1/K; by default that of mild steel.

    Returns
    -------
    float or ndarray
        Dimensionless factor.

    References
    ----------
    API MPMS 12.1.1 (CTSh); 2.2A for the coefficient of mild steel.

    Examples
    --------
    >>> round(shell_factor(34.0), 6)
    1.000424
    """
    # Areas of the horizontal cut grow with the square of lengths, (1 + a dT)^2.
    stretch = expansion_per_k * (shell_c - base_c)
    return 1 + 2 * stretch + stretch**2


def solid_factor(body, levels_m, shell_c, base_c, expansion_per_k):
    """Return the factor on volumes of a tank that is a single solid, at fixed levels.

    The solid expands in all directions:

        V'(h) / V(h) = (1 + a dT)^3 V(h / (1 + a dT)) / V(h)

    For a sphere, the factor is 1 + a dT near the bottom and 1 + 3 a dT when full.

    Parameters
    ----------
    body : Body
        Object with volume_m3, lowest_m and highest_m, at the temperature base_c.
    levels_m : ndarray, shape (rows,)
        Levels in the frame of its parts, m.
    shell_c : float or ndarray
        Temperature of the shell, degC.
    base_c : float
        Temperature of the table, degC.
    expansion_per_k : float
        Coefficient a of linear expansion, 1/K.

    Returns
    -------
    ndarray, shape (rows,)
        Dimensionless factor; 1 for levels without volume.
    """
    stretch = 1 + expansion_per_k * (shell_c - base_c)
    cold_levels = np.clip(levels_m / stretch, body.lowest_m, body.highest_m)
    cold_volume = body.volume_m3(levels_m)
    ratio = stretch**3 * body.volume_m3(cold_levels) / np.where(cold_volume > 0, cold_volume, 1.0)
    return np.where(cold_volume > 0, ratio, 1.0)
