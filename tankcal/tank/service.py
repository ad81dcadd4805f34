"""In service: what a warm shell holds more than the table says.

Source: API MPMS 12.1.1 (CTSh, shell temperature); 2.2A for the coefficient of mild steel.
"""

MILD_STEEL_PER_K = 1.116e-5  # 6.20e-6 per degF
BASE_C = 15.0  # customary tables: 60 degF, that is (60 - 32) / 1.8 degC


def shell_temperature_c(liquid_c, ambient_c=None, *, insulated=False):
    """Temperature of the shell in service: (7 liquid + ambient) / 8; insulated: the liquid's.

    Temperatures in degC, numbers or arrays. Raises ValueError for a bare shell without ambient_c.
    """
    if insulated:
        return liquid_c
    if ambient_c is None:
        raise ValueError("no ambient temperature; expected one for a shell that is not insulated")
    return (7 * liquid_c + ambient_c) / 8


def shell_factor(shell_c, base_c=BASE_C, expansion_per_k=MILD_STEEL_PER_K):
    """CTSh = 1 + 2 a dT + a^2 dT^2, the factor of a volume read from the table; dT = shell - base.

    shell_c  temperature of the shell in service, degC (`shell_temperature_c`)
    base_c   reference temperature of the table, degC
    """
    stretch = expansion_per_k * (shell_c - base_c)
    return 1 + 2 * stretch + stretch**2
