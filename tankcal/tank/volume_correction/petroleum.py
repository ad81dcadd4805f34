"""Volume correction of petroleum: ranges of inputs, ASTM tables, liquefied gases, Brazil.

Volume correction of crude oil, petroleum products and lubricating oils (ASTM D1250).

The factor VCF = rho(t) / rho(base) converts a volume at the temperature t to the base temperature.
Two editions are in use. They differ by 0.00001, in the transition zone of products by 0.00006:

- 1980: tables 5, 6, 23, 24, 53, 54 (base 60 degF or 15 degC) and 59, 60 (20 degC);
- 2004: one procedure for all bases, with the pressure (API MPMS 11.1-2004 with the addendum of
  2007).

The texts of the standards were not read. Equations and constants are those of independent public
implementations; the tests compare them with published values of the tables.

Volume correction of liquefied petroleum gas to 60 degF by GPA TP-27 (API MPMS 11.2.4).

The corrected liquid lies between two of twelve reference fluids by its relative density; the law of
corresponding states interpolates between them. Equations and constants are those of a public
implementation; the text of the standard was not read and no published value was at hand. The vapour
above the liquid is not part of the correction.

Volume correction of Brazil to 20 degC: the tables of Resolução CNP 6/70.

The resolution prints tables. A fit to them is in use in several public programs, whose coefficients
agree; the tests compare it with the printed factors that were at hand. The tables themselves were
not read as a whole.
"""

import math
from dataclasses import dataclass

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message

DEGREES = message("unit_degc", "degC")
FAHRENHEIT = message("unit_degf", "degF")
RELATIVE = message("unit_relative_density", "relative density at 60 degF")
SIGNIFICANT = 6  # digits of printed limits
_BINARY = 1e-12  # relative error of a decimal limit in binary, and of a conversion
MOST_ROUNDS = 200  # of the fixed-point iteration for a density at the base
ROUNDS_OF_GROUPS = 30  # later rounds keep the group or class, so that it cannot alternate
CONVERGED = 1e-13  # relative change of the density


class OutsideRangeError(InputError):
    """A value outside the range of a volume correction.

    Attributes
    ----------
    quantity : str
        Name of the input, such as "temperature_c".
    is_outside : ndarray of bool
        Values outside the range.
    expected_at : callable
        Text for a place of `is_outside`.
    """

    def __init__(self, quantity, is_outside, expected_at):
        first = np.argwhere(is_outside)[0]
        super().__init__(Problem(quantity, expected_at(tuple(first))))
        self.quantity, self.is_outside, self.expected_at = quantity, is_outside, expected_at

    def __reduce__(self):  # the text of each place is a function, which cannot be pickled
        return InputError, (self.problems,)


def inside(low, high, decimals=None):
    """Round the limits of a range for print; the printed range is never wider than the range.

    Parameters
    ----------
    low, high : float
    decimals : int, optional
        None: six significant digits.

    Returns
    -------
    tuple of float
    """
    return _round(low, math.ceil, decimals), _round(high, math.floor, decimals)


def _round(limit, whole, decimals):
    """Limit rounded by `whole`, `math.ceil` or `math.floor`."""
    if decimals is None:
        decimals = (
            SIGNIFICANT if limit == 0 else SIGNIFICANT - 1 - math.floor(math.log10(abs(limit)))
        )
    nearest = round(limit, decimals)
    if math.isclose(nearest, limit, rel_tol=_BINARY):
        return nearest
    return whole(limit * 10.0**decimals) / 10.0**decimals


def refuse_outside(quantity, value, low, high, unit, source, original=None):
    """Raise OutsideRangeError if a value is outside the range of a volume correction.

    Parameters
    ----------
    quantity : str
        Name of the input, such as "temperature_c".
    value : float or ndarray
        Real, or complex in a derivative.
    low, high : float or ndarray
        Limits, both allowed.
    unit : str
    source : str
        Volume correction with this range.
    original : tuple, optional
        (low, high, unit) of the source, if its range is in another unit.

    Raises
    ------
    OutsideRangeError
        For a value that is not finite or outside the range. A value is never moved to a limit.
    """
    values, lows, highs = np.broadcast_arrays(np.real(value), low, high)
    is_outside = ~((values >= lows) & (values <= highs))
    if not np.any(is_outside):
        return

    def expected_at(place):
        # Converted limits have many digits: the range of the source is printed beside them.
        is_converted = original is not None and unit == "degC"
        low_shown, high_shown = inside(lows[place], highs[place], 2 if is_converted else None)
        shown = {
            "value": float(values[place]),
            "low": low_shown,
            "high": high_shown,
            "unit": DEGREES if unit == "degC" else unit,
            "source": source,
        }
        if original is None:
            return message(
                "outside_volume_correction",
                "found {value:g}; expected {low:g} to {high:g} {unit}, the range of {source}",
                **shown,
            )
        least, most = inside(*(float(np.broadcast_to(limit, values.shape)[place])
                               for limit in original[:2]))  # fmt: skip
        return message(
            "outside_volume_correction_of",
            "found {value:g}; expected {low:g} to {high:g} {unit} ({least:g} to {most:g} "
            "{source_unit}), the range of {source}",
            least=least, most=most, source_unit=original[2], **shown,
        )  # fmt: skip

    raise OutsideRangeError(quantity, is_outside, expected_at)


def iterate_density(density, next_density, source):
    """Density at the base by fixed-point iteration from an observed density.

    The density at the base changes the correction slowly, so each round gains one digit or more.

    Parameters
    ----------
    density : float or ndarray
        Start value, real, or complex in a derivative.
    next_density : callable
        next_density(base, bound) returns the density at the base by the correction at the density
        `base`. `bound` is the density that decides the group of products; None: `base`.
    source : str
        Volume correction.

    Returns
    -------
    float or ndarray

    Raises
    ------
    OutsideRangeError
        If the iteration does not converge.
    """
    base, bound = density, None
    for rounds in range(MOST_ROUNDS):
        before = base
        with np.errstate(all="ignore"):  # far outside the range; the caller refuses the result
            base = next_density(before, bound)
            is_converged = np.abs(base - before) <= CONVERGED * np.abs(base)
        if rounds == ROUNDS_OF_GROUPS:
            bound = np.real(base)
        if np.all(is_converged):
            break
    refuse_not_converged(is_converged, source)
    return base


def refuse_not_converged(is_converged, source):
    """Raise OutsideRangeError if no density at the base was determined for an observed density.

    Parameters
    ----------
    is_converged : ndarray of bool
    source : str
        Volume correction.

    Raises
    ------
    OutsideRangeError
    """
    if np.all(is_converged):
        return

    def expected_at(_):
        return message(
            "no_density_at_base",
            "{source} gives no density at the base temperature for this observed density; expected "
            "another density or temperature of the sample",
            source=source,
        )

    raise OutsideRangeError("density_kg_m3", ~is_converged, expected_at)


EDITIONS, GROUPS = (1980, 2004), ("crude", "products", "lubricants")
BASES_C = {"15C": 15.0, "20C": 20.0, "60F": (60.0 - 32.0) / 1.8}
BASE_NAMES = {"15C": "15 °C", "20C": "20 °C", "60F": "60 °F"}  # for readers
WATER_1980, WATER_2004 = 999.012, 999.016  # kg/m3 at 60 degF, of the API gravity
KPA_PER_PSI = 6.894757
# Linear and quadratic coefficient of the reading of a glass hydrometer, per degree of its scale.
GLASS_EXPANSION = {"15C": (23e-6, 2e-8), "20C": (23e-6, 2e-8), "60F": (12.78e-6, 6.2e-9)}


def density_of_gravity(api, water=WATER_1980):
    """Density at 60 degF, kg/m3, of an API gravity: 141.5 W / (131.5 + API).

    Parameters
    ----------
    api : float or ndarray
        Gravity, degrees API.
    water : float, optional
        Density W of water at 60 degF, kg/m3: `WATER_1980` or `WATER_2004`.

    Returns
    -------
    float or ndarray

    Examples
    --------
    >>> round(density_of_gravity(35.0), 3)
    849.01
    """
    return 141.5 * water / (131.5 + api)


# Ranges of the density at the base, kg/m3, and coefficients K0, K1, K2 of the expansion
# a = K0 / rho^2 + K1 / rho + K2, per degree of the base. A product between two groups belongs to
# the group whose bound is nearer; the bounds of 1980 are half a step of the tables, 0.25 kg/m3.
GROUPS_15C = {
    "crude": (610.5, (1075.0, 613.9723, 0.0, 0.0)),
    "products": (
        653.0,
        (770.25, 346.4228, 0.4388, 0.0),  # gasolines
        (787.75, 2680.3206, 0.0, -0.00336312),  # transition
        (838.75, 594.5418, 0.0, 0.0),  # jet fuels, kerosenes, solvents
        (1075.0, 186.9696, 0.4862, 0.0),  # diesel, heating and fuel oils
    ),
    "lubricants": (800.0, (1164.0, 0.0, 0.6278, 0.0)),
}
GROUPS_60F = {
    "crude": (density_of_gravity(100.0), (density_of_gravity(0.0), 341.0957, 0.0, 0.0)),
    "products": (
        density_of_gravity(85.0),
        (density_of_gravity(52.0), 192.4571, 0.2438, 0.0),
        (density_of_gravity(48.0), 1489.0670, 0.0, -0.00186840),
        (density_of_gravity(37.0), 330.3010, 0.0, 0.0),
        (density_of_gravity(0.0), 103.8720, 0.2701, 0.0),
    ),
    "lubricants": (800.0, (1164.0, 0.0, 0.34878, 0.0)),
}
GROUPS_2004 = {
    "crude": (610.6, (1163.5, 341.0957, 0.0, 0.0)),
    "products": (
        610.6,
        (770.3520, 192.4571, 0.2438, 0.0),
        (787.5195, 1489.0670, 0.0, -0.00186840),
        (838.3127, 330.3010, 0.0, 0.0),
        (1163.5, 103.8720, 0.2701, 0.0),
    ),
    "lubricants": (800.9, (1163.5, 0.0, 0.34878, 0.0)),
}
_GROUP_NAMES = {
    "crude": message("group_crude", "crude"),
    "products": message("group_products", "products"),
    "lubricants": message("group_lubricants", "lubricants"),
}
ALPHA_1980_PER_F, ALPHA_2004_PER_F = (270e-6, 930e-6), (230e-6, 930e-6)

# Temperatures of the 1980 tables: lowest, and highest for light, middle and heavy products, degF,
# with the gravities between them. From memory, not read in the tables.
LOWEST_F, HIGHEST_F = 0.0, (200.0, 250.0, 300.0)
LIGHT_KG_M3, MIDDLE_KG_M3 = density_of_gravity(50.0), density_of_gravity(40.0)
LIMITS_2004_C, _MOST_PSI = (-50.0, 150.0), 1500.0

# 2004: polynomial of the difference between the scales ITS-90 and IPTS-68, and the temperature
# 60 degF (ITS-90) in IPTS-68.
SCALES = (-0.148759, -0.267408, 1.080760, 1.269056, -4.089591, -1.871251, 7.438081, -3.536296)
DELTA_60, ZERO_68_F = 0.01374979547, 60.0068749


@dataclass(frozen=True)
class Petroleum:
    """Volume correction by ASTM D1250.

    Attributes
    ----------
    edition : {1980, 2004}
    group : {"crude", "products", "lubricants"} or None
        None: the coefficient of expansion is given.
    base : {"15C", "20C", "60F"}
        Base temperature.
    alpha_per_k : float, optional
        Coefficient of expansion at the base (at 60 degF for the edition of 2004), 1/K, instead of a
        group (tables C).

    Examples
    --------
    >>> diesel = Petroleum(2004, "products", "20C")
    >>> round(float(diesel.factor(842.0, 34.2)), 6)
    0.988
    """

    edition: int
    group: str | None
    base: str
    alpha_per_k: float | None = None

    @property
    def base_c(self):
        """Base temperature, degC."""
        return BASES_C[self.base]

    @property
    def name(self):
        """Name of the edition and the group, for reports."""
        if self.group is None:
            group = message("group_coefficient", "alpha = {alpha:g}/K", alpha=self.alpha_per_k)
        else:
            group = _GROUP_NAMES[self.group]
        edition, base = f"{self.edition % 100:02d}", BASE_NAMES[self.base]
        return message("correction_d1250", "ASTM D1250-{edition}, {of}, base {base}",
                       edition=edition, of=group, base=base)  # fmt: skip

    def factor(self, density, temperature_c, pressure_kpa=0.0):
        """Volume correction factor from a temperature and gauge pressure to the base.

        Parameters
        ----------
        density : float or ndarray
            Density at the base, kg/m3.
        temperature_c : float or ndarray
            Temperature of the liquid, degC.
        pressure_kpa : float or ndarray, optional
            Gauge pressure, kPa; only with the edition of 2004.

        Returns
        -------
        float or ndarray
            rho(t, p) / rho(base), without a unit.

        Raises
        ------
        InputError
            For a value outside the range of the correction.
        """
        self._refuse_outside(density, temperature_c, pressure_kpa)
        return self._factor(density, temperature_c, pressure_kpa)

    def base_density(self, density, temperature_c, pressure_kpa=0.0):
        """Density at the base, kg/m3, of a density at another temperature and pressure.

        Parameters
        ----------
        density : float or ndarray
            Density of the sample at its temperature, kg/m3. A reading of a glass hydrometer is
            corrected before by `glass_correction`.
        temperature_c, pressure_kpa
            As for `factor`, of the sample.

        Returns
        -------
        float or ndarray

        Raises
        ------
        InputError
            If the density at the base or another value is outside the range, or if the iteration
            does not converge.
        """
        base = self._iterate(
            density, lambda rho, bound: self._factor(rho, temperature_c, pressure_kpa, bound)
        )
        self._refuse_outside(base, temperature_c, pressure_kpa)
        return base

    def _factor(self, density, temperature_c, pressure_kpa=0.0, bound=None):
        """VCF without a check of the range; `bound`: density that decides the group."""
        if self.edition == 1980:
            return self._factor_1980(density, temperature_c, bound)
        # All bases are reached through 60 degF: CTPL(t, p) over CTL(base).
        if self.base == "60F":
            return self._ctpl(density, temperature_c, pressure_kpa, bound)
        at_60 = self._iterate(density, lambda rho, group: self._ctpl(rho, self.base_c, 0.0, group))
        actual, base = (
            self._ctpl(at_60, t, p) for t, p in ((temperature_c, pressure_kpa), (self.base_c, 0.0))
        )
        return actual / base

    def _factor_1980(self, density, temperature_c, bound=None):
        if self.base == "20C":
            # The tables for 20 degC follow from those for 15 degC.
            at_15 = Petroleum(1980, self.group, "15C", self.alpha_per_k)
            rho_15 = at_15._iterate(
                density, lambda rho, group: at_15._factor_1980(rho, 20.0, group)
            )
            return at_15._factor_1980(rho_15, temperature_c) / at_15._factor_1980(rho_15, 20.0)
        is_fahrenheit = self.base == "60F"
        step = (temperature_c - self.base_c) * (1.8 if is_fahrenheit else 1.0)
        if self.group is None:
            alpha = self.alpha_per_k / (1.8 if is_fahrenheit else 1.0)
        else:
            groups = GROUPS_60F if is_fahrenheit else GROUPS_15C
            alpha, _ = _expansion(groups[self.group], density, bound)
        # VCF = exp(-a dt (1 + 0.8 a dt)).
        return np.exp(-alpha * step * (1 + 0.8 * alpha * step))

    def _ctpl(self, density, temperature_c, pressure_kpa, bound=None):
        """CTL CPL of 2004, from a temperature and pressure to 60 degF and no gauge pressure."""
        # Step 1: ITS-90 to IPTS-68, the scale of the measurements behind the constants.
        tau = temperature_c / 630.0
        shift = 0.0
        for coefficient in reversed(SCALES):
            shift = tau * (coefficient + shift)
        scaled = 1.8 * (temperature_c - shift) + 32.0
        # Steps 2 and 3: alpha at the density of 60 degF on that scale.
        if self.group is None:
            alpha = self.alpha_per_k / 1.8
            shifted = density * np.exp(0.5 * alpha * DELTA_60 * (1 + 0.4 * alpha * DELTA_60))
        else:
            alpha, (k0, k1, k2) = _expansion(GROUPS_2004[self.group], density, bound)
            a = DELTA_60 / 2 * alpha
            b = (2 * k0 + k1 * density) / (k0 + (k1 + k2 * density) * density)
            shifted = density * (1 + np.expm1(a * (1 + 0.8 * a)) / (1 + a * (1 + 1.6 * a) * b))
            alpha = (k0 / shifted + k1) / shifted + k2
        # Step 4: CTL.
        step = scaled - ZERO_68_F
        ctl = np.exp(-alpha * step * (1 + 0.8 * alpha * (step + DELTA_60)))
        # Step 5: compressibility F, 1e-5 per psi, and CPL.
        compressibility = np.exp(
            -1.9947 + 0.00013427 * scaled + (793920.0 + 2326.0 * scaled) / shifted**2
        )
        return ctl / (1 - 1e-5 * compressibility * pressure_kpa / KPA_PER_PSI)

    def _iterate(self, density, factor):
        """Density at the base with rho = density / factor(rho)."""
        return iterate_density(density, lambda rho, bound: density / factor(rho, bound), self.name)

    def _refuse_outside(self, density, temperature_c, pressure_kpa):
        if self.edition == 1980:
            high = np.select(
                [np.real(density) < LIGHT_KG_M3, np.real(density) < MIDDLE_KG_M3],
                HIGHEST_F[:2],
                HIGHEST_F[2],
            )
            limits = (LOWEST_F - 32) / 1.8, (high - 32) / 1.8, "degC", self.name
            refuse_outside("temperature_c", temperature_c, *limits, (LOWEST_F, high, FAHRENHEIT))
            refuse_outside("pressure_kpa", pressure_kpa, 0.0, 0.0, "kPa", self.name)
            groups = GROUPS_60F if self.base == "60F" else GROUPS_15C
        else:
            refuse_outside("temperature_c", temperature_c, *LIMITS_2004_C, "degC", self.name)
            limits = 0.0, _MOST_PSI * KPA_PER_PSI, "kPa", self.name
            refuse_outside("pressure_kpa", pressure_kpa, *limits, (0.0, _MOST_PSI, "psi"))
            groups = GROUPS_2004
        if self.group is None:
            per_f = ALPHA_1980_PER_F if self.edition == 1980 else ALPHA_2004_PER_F
            low, high = (1.8 * limit for limit in per_f)
            refuse_outside("alpha_per_k", self.alpha_per_k, low, high, "1/K", self.name)
            return
        least, *parts = groups[self.group]
        refuse_outside("density_kg_m3", density, least, parts[-1][0], "kg/m3", self.name)


def _expansion(groups, density, bound=None):
    """Coefficient of expansion per degree, and K0, K1, K2, of the group of a density.

    The group is that of the density `bound`, by default of the density itself.
    """
    _, *parts = groups
    real = np.real(density) if bound is None else bound
    # The number of upper bounds below the density is the place of its group.
    place = np.searchsorted([high for high, *_ in parts[:-1]], real)
    constants = tuple(np.array(parts)[:, 1:].T[:, place])
    k0, k1, k2 = constants
    return (k0 / density + k1) / density + k2, constants


def glass_correction(temperature_c, scale):
    """Factor on the reading of a glass hydrometer for the expansion of the glass.

    Parameters
    ----------
    temperature_c : float or ndarray
        Temperature of the sample, degC.
    scale : {"15C", "20C", "60F"}
        Temperature of the scale of the hydrometer.

    Returns
    -------
    float or ndarray

    Examples
    --------
    >>> round(glass_correction(25.0, "15C"), 6)
    0.999768
    """
    linear, quadratic = GLASS_EXPANSION[scale]
    step = (1.8 if scale == "60F" else 1.0) * (temperature_c - BASES_C[scale])
    return 1 - linear * step - quadratic * step**2


WATER_60F = 999.016  # kg/m3, of the relative density 60/60
BASE_C, BASE_K = (60.0 - 32.0) / 1.8, 519.67 / 1.8
LEAST_DENSITY, MOST_DENSITY = 0.35, 0.688  # relative density 60/60
LOWEST_F_OF_GASES, HIGHEST_F_OF_GASES = -50.8, 199.4

# Relative density 60/60, critical temperature K, compressibility at the critical point, critical
# density mol/L, and k1 to k4 of the saturation density.
_FLUIDS = np.array(
    [
        # EE 68/32
        (0.325022, 298.11, 0.27998, 6.250)
        + (2.54616855327, -0.058244177754, 0.803398090807, -0.745720314137),
        # ethane
        (0.355994, 305.33, 0.28220, 6.870)
        + (1.89113042610, -0.370305782347, -0.544867288720, 0.337876634952),
        # EP 65/35
        (0.429277, 333.67, 0.28060, 5.615)
        + (2.20970078464, -0.294253708172, -0.405754420098, 0.319443433421),
        # EP 35/65
        (0.470381, 352.46, 0.27930, 5.110)
        + (2.25341981320, -0.266542138024, -0.372756711655, 0.384734185665),
        # propane
        (0.507025, 369.78, 0.27626, 5.000)
        + (1.96568366933, -0.327662435541, -0.417979702538, 0.303271602831),
        # i-butane
        (0.562827, 407.85, 0.28326, 3.860)
        + (2.04748034410, -0.289734363425, -0.330345036434, 0.291757103132),
        # n-butane
        (0.584127, 425.16, 0.27536, 3.920)
        + (2.03734743118, -0.299059145695, -0.418883095671, 0.380367738748),
        # i-pentane
        (0.624285, 460.44, 0.27026, 3.247)
        + (2.06541640707, -0.238366208840, -0.161440492247, 0.258681568613),
        # n-pentane
        (0.631054, 469.65, 0.27235, 3.200)
        + (2.11263474494, -0.261269413560, -0.291923445075, 0.308344290017),
        # i-hexane
        (0.657167, 498.05, 0.26706, 2.727)
        + (2.02382197871, -0.423550090067, -1.152810982570, 0.950139001678),
        # n-hexane
        (0.664064, 507.35, 0.26762, 2.704)
        + (2.17134547773, -0.232997313405, -0.267019794036, 0.378629524102),
        # n-heptane
        (0.688039, 540.15, 0.26312, 2.315)
        + (2.19773533433, -0.275056764147, -0.447144095029, 0.493770995799),
    ]
)


@dataclass(frozen=True)
class LiquefiedGas:
    """Volume correction of liquefied petroleum gas to 60 degF by GPA TP-27."""

    base_c = BASE_C
    name = message("correction_tp27", "GPA TP-27, liquefied petroleum gas, base 60 °F")

    def factor(self, density, temperature_c, pressure_kpa=0.0):
        """Volume correction factor of the saturated liquid, as `Petroleum.factor`.

        The density is that at 60 degF; the gauge pressure above that of saturation must be 0.

        Raises
        ------
        InputError
            For a value outside the range, or a temperature above the critical point.
        """
        self._refuse_outside(density, temperature_c, pressure_kpa)
        return self._factor(density, temperature_c)

    def base_density(self, density, temperature_c, pressure_kpa=0.0):
        """Density at 60 degF, kg/m3, of a density at another temperature; as for `factor`."""

        def next_density(base, _):
            relative = np.clip(np.real(base) / WATER_60F, LEAST_DENSITY, MOST_DENSITY)
            inside = base - np.real(base) + relative * WATER_60F
            return density / self._factor(inside, temperature_c)

        base = iterate_density(density, next_density, self.name)
        self._refuse_outside(base, temperature_c, pressure_kpa)
        return base

    def _factor(self, density, temperature_c):
        relative = density / WATER_60F
        place = np.clip(np.searchsorted(_FLUIDS[:, 0], np.real(relative)), 1, len(_FLUIDS) - 1)
        light, heavy = _FLUIDS[place - 1].T, _FLUIDS[place].T
        weight = (relative - light[0]) / (heavy[0] - light[0])
        critical_k = light[1] + weight * (heavy[1] - light[1])
        # Ratio of the critical compressibility and density of both fluids.
        ratio = light[2] * light[3] / (heavy[2] * heavy[3])

        def density_at(temperature_k):
            reduced = 1 - temperature_k / critical_k
            rho_light, rho_heavy = (_saturation_density(fluid, reduced) for fluid in (light, heavy))
            return rho_light / (1 + weight * (rho_light / (ratio * rho_heavy) - 1))

        return density_at(temperature_c + 273.15) / density_at(BASE_K)

    def _refuse_outside(self, density, temperature_c, pressure_kpa):
        low, high = ((limit - 32) / 1.8 for limit in (LOWEST_F_OF_GASES, HIGHEST_F_OF_GASES))
        critical = np.interp(np.real(density) / WATER_60F, _FLUIDS[:, 0], _FLUIDS[:, 1]) - 273.15
        high = np.minimum(high, critical)
        least, most = LEAST_DENSITY * WATER_60F, MOST_DENSITY * WATER_60F
        refuse_outside("density_kg_m3", density, least, most, "kg/m3", self.name,
                       (LEAST_DENSITY, MOST_DENSITY, RELATIVE))  # fmt: skip
        refuse_outside("temperature_c", temperature_c, low, high, "degC", self.name,
                       (LOWEST_F_OF_GASES, 1.8 * high + 32, FAHRENHEIT))  # fmt: skip
        refuse_outside("pressure_kpa", pressure_kpa, 0.0, 0.0, "kPa", self.name)


def _saturation_density(fluid, reduced):
    """Saturation density of a reference fluid at the reduced temperature 1 - T / Tc, mol/L."""
    critical, k1, k2, k3, k4 = fluid[3:]
    # Above the critical point there is no liquid; the range excludes it.
    reduced = np.where(np.real(reduced) > 0, reduced, 1e-12)
    rise = k1 * reduced**0.35 + k3 * reduced**2 + k4 * reduced**3
    return critical * (1 + rise / (1 + k2 * reduced**0.65))


BRAZIL_BASE_C = 20.0
WATER = 0.999042  # g/cm3, of the fit
LEAST, MOST = 0.498, 1.1  # densities of the fit, g/cm3
LOWEST_C, HIGHEST_C = 0.0, 60.0  # temperatures of the check values, with a margin

# Factors of the tables: three decimals for light products, four for heavier ones. The bound between
# them lies between these two densities, which is all that the factors at hand show; g/cm3.
THREE_DECIMALS_TO, FOUR_DECIMALS_FROM = 0.626, 0.742

# Highest density at 20 degC of each class, g/cm3, and a1, a2, b1, b2 of the fit.
CLASSES = np.array(
    [
        (0.498, -0.002462, 0.003215, -1.014e-5, 1.738e-5),
        (0.518, -0.002391, 0.003074, -8.41e-6, 1.398e-5),
        (0.539, -0.002294, 0.002887, -8.39e-6, 1.387e-5),
        (0.559, -0.002146, 0.002615, -5.46e-6, 8.55e-6),
        (0.579, -0.001920, 0.002214, -5.51e-6, 8.59e-6),
        (0.600, -0.002358, 0.002962, -1.225e-5, 2.015e-5),
        (0.615, -0.001361, 0.001300, -4.9e-7, 6.0e-7),
        (0.635, -0.001237, 0.00110, -4.9e-7, 6.0e-7),
        (0.655, -0.001077, 0.00085, -4.9e-7, 6.0e-7),
        (0.675, -0.001011, 0.00075, -4.9e-7, 6.0e-7),
        (0.695, -0.000977, 0.00070, -4.9e-7, 6.0e-7),
        (0.746, -0.001005, 0.00074, -4.9e-7, 6.0e-7),
        (0.766, -0.001238, 0.00105, -4.9e-7, 6.0e-7),
        (0.786, -0.001084, 0.00085, -4.9e-7, 6.0e-7),
        (0.806, -0.000965, 0.00070, -4.9e-7, 6.0e-7),
        (0.826, -0.0008435, 0.00055, -4.9e-7, 6.0e-7),
        (0.846, -0.000719, 0.00040, -4.9e-7, 6.0e-7),
        (0.871, -0.000617, 0.00028, -4.9e-7, 6.0e-7),
        (0.896, -0.000512, 0.00016, -4.9e-7, 6.0e-7),
        (0.996, -0.0003948, 0.00003, -4.9e-7, 6.0e-7),
        (np.inf, -0.0005426, 0.0001778, 2.31e-6, -2.20e-6),
    ]
)


@dataclass(frozen=True)
class Brazil:
    """Volume correction by Resolução CNP 6/70.

    Attributes
    ----------
    is_rounded : bool
        True: density and factor are rounded as in the tables, which the law requires.
    """

    is_rounded: bool
    base_c = BRAZIL_BASE_C
    glass_scale = "20C"  # `base_density` corrects the glass of a hydrometer with this scale

    @property
    def name(self):
        """Name of the correction, for reports."""
        if self.is_rounded:
            return message(
                "correction_cnp_rounded", "Resolução CNP 6/70, rounded as its tables, base 20 °C"
            )
        return message("correction_cnp_unrounded", "Resolução CNP 6/70, unrounded, base 20 °C")

    def factor(self, density, temperature_c, pressure_kpa=0.0):
        """Volume correction factor to 20 degC, as `Petroleum.factor`; the pressure must be 0.

        Raises
        ------
        InputError
            For a value outside the range, and with rounding for a density between 626 and 742
            kg/m3, where the number of decimals of the tables is not known.
        """
        self._refuse_outside(density, temperature_c, pressure_kpa)
        relative = density / 1000.0
        if not self.is_rounded:
            return self._fit(relative, temperature_c)
        is_light = np.real(relative) <= THREE_DECIMALS_TO
        is_unknown = ~is_light & (np.real(relative) < FOUR_DECIMALS_FROM)
        if np.any(is_unknown):
            expected = message(
                "brazil_decimals_unknown",
                "found a density between {low:g} and {high:g} kg/m3, where the number of decimals "
                "of the tables is not known to tankcal; expected the unrounded correction",
                low=1000 * THREE_DECIMALS_TO,
                high=1000 * FOUR_DECIMALS_FROM,
            )
            raise OutsideRangeError("density_kg_m3", is_unknown, lambda _: expected)
        # The density is rounded to the nearest even third decimal. The unrounded factor gives the
        # derivatives, which a rounded factor does not have.
        # A density halfway between two of them goes to the multiple of 0.004; rounding to 1e-9
        # first keeps the error of the division from deciding this.
        even = 0.002 * np.round(np.round(np.real(relative) / 0.002, 9))
        factor = np.real(self._fit(even, temperature_c))
        rounded = np.where(is_light, np.round(factor, 3), np.round(factor, 4))
        unrounded = self._fit(relative, temperature_c)
        return rounded + (unrounded - np.real(unrounded))

    def base_density(self, density, temperature_c, pressure_kpa=0.0):
        """Density at 20 degC, kg/m3, of a hydrometer reading at another temperature.

        The correction contains the expansion of the glass. Parameters as for `factor`.
        """
        observed = density / 1000.0
        step = temperature_c - BRAZIL_BASE_C
        glass = glass_correction(temperature_c, "20C")

        def next_density(base, bound):
            p1, p2, p3, p4 = coefficients_of_class(base if bound is None else bound)
            return glass * (observed - p1 * step - p3 * step**2) / (1 + p2 * step + p4 * step**2)

        base = iterate_density(observed, next_density, self.name)
        self._refuse_outside(1000.0 * base, temperature_c, pressure_kpa)
        return 1000.0 * base

    def _fit(self, relative, temperature_c):
        """FCV = 1 + p2 x + p4 x^2 + (p1 x + p3 x^2) / D20, x = t - 20 degC."""
        p1, p2, p3, p4 = coefficients_of_class(relative)
        step = temperature_c - BRAZIL_BASE_C
        return 1 + p2 * step + p4 * step**2 + (p1 * step + p3 * step**2) / relative

    def _refuse_outside(self, density, temperature_c, pressure_kpa):
        refuse_outside("density_kg_m3", density, 1000 * LEAST, 1000 * MOST, "kg/m3", self.name)
        refuse_outside("temperature_c", temperature_c, LOWEST_C, HIGHEST_C, "degC", self.name)
        refuse_outside("pressure_kpa", pressure_kpa, 0.0, 0.0, "kPa", self.name)


def coefficients_of_class(relative):
    """p1 to p4 of the class of a density at 20 degC, g/cm3."""
    a1, a2, b1, b2 = CLASSES[np.searchsorted(CLASSES[:, 0], np.real(relative))].T[1:]
    q = 1 + 8 * a2 + 64 * b2
    # 9/5 and 81/25 convert the steps of the fit, in degF, to degC.
    p1 = 9 / 5 * WATER * (a1 + 16 * b1 - (8 * a1 + 64 * b1) * (a2 + 16 * b2) / q)
    p2 = 9 / 5 * (a2 + 16 * b2) / q
    p3 = 81 / 25 * WATER * (b1 - (8 * a1 + 64 * b1) * b2 / q)
    p4 = 81 / 25 * b2 / q
    return p1, p2, p3, p4
