"""In service: what a warm shell holds more than the table says.

Source: API MPMS 12.1.1 (CTSh, shell temperature); 2.2A for the coefficient of mild steel.
"""

import numpy as np

MILD_STEEL_PER_K = 1.116e-5  # 6.20e-6 per degF
BASE_C = 15.0  # customary tables: 60 degF, that is (60 - 32) / 1.8 degC


def shell_temperature_c(liquid_c, ambient_c=None, *, insulated=False):
    """Temperature of the shell in service: (7 liquid + ambient) / 8; insulated: the liquid's.

    Parameters
    ----------
    liquid_c : float or ndarray
        Temperature of the liquid, degC.
    ambient_c : float or ndarray, optional
        Of the air about the shell, degC.
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
    """Factor of a volume read from the table, for a shell that is warmer than the table supposes.

        CTSh = 1 + 2 a dT + a^2 dT^2,   dT = shell - base

    Parameters
    ----------
    shell_c : float or ndarray
        Temperature of the shell in service, degC (`shell_temperature_c`).
    base_c : float, default 15
        Reference temperature of the table, degC.
    expansion_per_k : float
        a, linear expansion, 1/K; that of mild steel by default.

    Returns
    -------
    float or ndarray
        Without unit.

    References
    ----------
    API MPMS 12.1.1 (CTSh); 2.2A for the coefficient of mild steel.

    Examples
    --------
    >>> round(shell_factor(34.0), 6)
    1.000424
    """
    stretch = expansion_per_k * (shell_c - base_c)
    return 1 + 2 * stretch + stretch**2


def solid_factor(body, levels_m, shell_c, base_c, expansion_per_k):
    """Factor of volumes of a tank that is one solid, which grows all over, at fixed levels.

        V'(h) / V(h) = (1 + a dT)^3 V(h / (1 + a dT)) / V(h)

    Of a sphere 1 + a dT next to the bottom and 1 + 3 a dT when it is full.

    Parameters
    ----------
    body : Body
        With volume_m3, lowest_m and highest_m, at the temperature base_c.
    levels_m : ndarray, shape (rows,)
        Levels in the frame of its parts, m.
    shell_c : float or ndarray
        Temperature of the shell, degC.
    base_c, expansion_per_k : float
        Temperature of the table, degC; a, 1/K.

    Returns
    -------
    ndarray, shape (rows,)
        Without unit; 1 where nothing is below the level.
    """
    grown = 1 + expansion_per_k * (shell_c - base_c)
    shrunk = np.clip(levels_m / grown, body.lowest_m, body.highest_m)
    before = body.volume_m3(levels_m)
    ratio = grown**3 * body.volume_m3(shrunk) / np.where(before > 0, before, 1.0)
    return np.where(before > 0, ratio, 1.0)
