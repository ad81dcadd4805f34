"""Strapping: from the reading of a tape round a tank to the circumference of its painted shell.

    strain = (F - F_cert) / (A E),   F the mean tension round the tank
    length = (reading + correction_mm) (1 + correction) (1 + a (T - T_cert)) (1 + strain)
    circumference = length - pi d - sum of excesses - sag,   d the thickness of the tape

    mean tension = pull (1 - exp(-m)) / m,   m = mu w, w half the angle that one pull wraps
    sag of a free span = w^2 L^3 / (24 F^2),   w the weight per metre, F the tension there

Friction reduces the tension with the distance from the ends of the tape. The position of a span is
not recorded, so all positions are equally likely. 1 / F^2 is therefore the mean of exp(2 m s) /
pull^2 over s from 0 to 1, and its standard deviation enters the uncertainty.

A warm or stretched tape reads too little; a tape that hangs freely over a span reads too much. A
tape without a measured temperature lies on the shell and has the temperature of the shell.

Source: ISO 7507-1:2003; API MPMS 2.2A (methods); the sag is the first term of the catenary; the
formulas of excesses follow from plane geometry: a tape leaves a round shell on the two tangents
from an edge.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.messages import message

KINDS = ("butt_strap", "weld", "step", "lap", "step_over", "measured", "sag")
# Values assumed where a job declares none: half-widths of rectangular distributions.
TAPE_TEMPERATURE_K = 2.0  # of a measured tape temperature
TENSION_SHARE = 0.1  # of the pull, relative
FRICTION_SHARE = 0.5  # of the coefficient of friction, relative
WEIGHT_SHARE = 0.05  # of the weight per metre, relative
RECTANGULAR = np.sqrt(3.0)
MOST_STRAPS = 1000  # largest number of readings of one tank


def too_many_straps(count):
    """Message about more circumferences than can be used."""
    return message(
        "too_many_straps",
        "{count} readings; expected at most {most}",
        count=count,
        most=MOST_STRAPS,
    )


@dataclass(frozen=True)
class Tape:
    """A tape with the data of its certificate; None: not given.

    Attributes
    ----------
    name : str
    correction, correction_m : float
        True length = (reading + correction_m) (1 + correction).
    temperature_c, tension_n : float or None
        Reference conditions of the certificate.
    expansion_per_k, thickness_m, friction : float
        Friction 0: a tension applies round the whole tank; otherwise it is the pull at the ends.
    stiffness_n : float
        Cross section times Young's modulus; inf: no elastic strain.
    weight_n_per_m : float
        For the sag of free spans.
    u_scale, u_offset_m, laying_m : float
        Standard uncertainties; laying_m applies to each pull.
    master : str
        Tape of the comparison, whose certificate then applies; "": own certificate.
    certificate : str
    """

    name: str
    correction: float = 0.0
    correction_m: float = 0.0
    temperature_c: float | None = None
    tension_n: float | None = None
    expansion_per_k: float = 0.0
    thickness_m: float = 0.0
    friction: float = 0.0
    stiffness_n: float = np.inf
    u_scale: float = 0.0
    u_offset_m: float = 0.0
    laying_m: float = 0.0
    master: str = ""
    certificate: str = ""
    weight_n_per_m: float = 0.0


@dataclass(frozen=True)
class Comparison:
    """A length read with both the master tape and the working tape."""

    level: str
    master_m: float
    working_m: float
    sd_m: float = 0.0
    when: str = ""


@dataclass(frozen=True)
class Obstruction:
    """An object that lifts a tape off the shell; lengths in m, None where the kind needs none.

    Attributes
    ----------
    kind : str
        "butt_strap" or "weld" (thickness, width), "step" or "lap" (thickness), "step_over" (length
        over the obstruction, and arc of the shell between the legs of the tool), "measured"
        (excess) or "sag" (free span, see `sag_of`).
    """

    kind: str
    count: float = 1.0
    thickness_m: float | None = None
    width_m: float | None = None
    over_m: float | None = None
    arc_m: float | None = None
    excess_m: float | None = None
    span_m: float | None = None
    sd_m: float = 0.0

    def excess(self, diameter_m):
        """Length of the tape over the obstruction minus the circumference, m; 0 for a free span.

        Butt strap or weld cap: N (2 t W / D + (8/3) t sqrt(t / D)). A step has half the tangent
        term; a lap joint has half its thickness on each side.
        """
        if self.kind == "sag":
            return 0.0
        if self.kind == "measured":
            return self.count * self.excess_m
        if self.kind == "step_over":
            return self.count * (self.over_m - self.arc_m)
        t = self.thickness_m
        if self.kind == "lap":
            return self.count * 4 / 3 * t * np.sqrt(t / (2 * diameter_m))
        if self.kind == "step":
            return self.count * 4 / 3 * t * np.sqrt(t / diameter_m)
        # The tape covers the width W at radius increased by t, and leaves the shell on both sides.
        along = 2 * t * self.width_m / diameter_m
        return self.count * (along + 8 / 3 * t * np.sqrt(t / diameter_m))


@dataclass(frozen=True)
class Strap:
    """A reading of a tape round the outside of a tank.

    Attributes
    ----------
    name, course : str
        Readings of equal name repeat the same circumference.
    level_m : float
        Height above the zero of the table, m.
    reading_m, sd_m : float
    tape : str
        Name of a `Tape`.
    temperature_c, tension_n : float or None
        None: temperature of the shell; tension of the certificate.
    pulls : int
        Number of pulls round the tank.
    check : bool
        True: compared only.
    row : int or None
        Row of the file.
    """

    name: str
    course: str
    level_m: float
    reading_m: float
    sd_m: float
    tape: str
    temperature_c: float | None = None
    tension_n: float | None = None
    pulls: int = 1
    check: bool = False
    row: int | None = None


@dataclass(frozen=True)
class Strapping:
    """Strapping of a tank.

    Attributes
    ----------
    straps : tuple of Strap
    tapes : tuple of Tape
    obstructions : dict
        {name of a circumference: tuple of Obstruction}.
    comparisons : tuple of Comparison
        Of the working tape with its master.
    shape_sd_m : float
        Standard deviation of the radius along the circumference.
    wave_m, helix_m : float or None
        Bounds of the deviation of the tape from level, and of the height difference of its ends;
        None: not declared.
    plate_sd_m : dict
        {course: standard uncertainty of its plate thickness from gauge readings}.
    """

    straps: tuple[Strap, ...]
    tapes: tuple[Tape, ...]
    obstructions: dict = field(default_factory=dict)
    comparisons: tuple[Comparison, ...] = ()
    shape_sd_m: float = 0.0
    wave_m: float | None = None
    helix_m: float | None = None
    plate_sd_m: dict = field(default_factory=dict)


@dataclass(frozen=True)
class Effect:
    """Effect of one standard uncertainty of a cause on a circumference.

    Attributes
    ----------
    kind, name : str
        Identify the cause; readings share a cause if both are equal.
    u, unit
        Standard uncertainty of the cause as reported.
    by_m : float
        Change of the circumference, m.
    """

    kind: str
    name: str
    u: float
    unit: str
    by_m: float


@dataclass(frozen=True)
class ReducedStrap:
    """A reading reduced to the circumference of the shell.

    Attributes
    ----------
    strap : Strap
    circumference_m : float
    steps_m : dict
        {correction: amount added, m}, in the order "certificate", "temperature", "tension",
        "tape_thickness", "rise", "sag", "out_of_level".
    sd_m : float
        Standard deviation independent of all other readings.
    effects : tuple of Effect
    by_shell_temperature_m : float
        Derivative by the shell temperature, m/K, where the tape has the temperature of the shell.
    """

    strap: Strap
    circumference_m: float
    steps_m: dict
    sd_m: float
    effects: tuple[Effect, ...]
    by_shell_temperature_m: float


def reduce_strap(strap, tape, obstructions, shell_temperature_c, strapping, diameter_m):
    """Reduce one reading to the circumference of the shell.

    Parameters
    ----------
    strap : Strap
    tape : Tape
        Result of `certified`.
    obstructions : iterable of Obstruction
        Obstructions along the tape.
    shell_temperature_c : float or None
    strapping : Strapping
        Supplies the bounds of the level of the tape.
    diameter_m : float
        Diameter of the tank, for the excess of the obstructions.

    Returns
    -------
    ReducedStrap
    """
    observed_m = strap.reading_m
    # The corrections act on the length in turn, in the order of the heading.
    length = (observed_m + tape.correction_m) * (1 + tape.correction)
    steps = {"certificate": length - observed_m}
    on_shell = strap.temperature_c is None
    temperature = shell_temperature_c if on_shell else strap.temperature_c
    warmer = 0.0
    if None not in (temperature, tape.temperature_c):
        warmer = temperature - tape.temperature_c
    steps["temperature"] = length * tape.expansion_per_k * warmer
    length += steps["temperature"]
    strain, by_tension, by_friction = strain_of(strap, tape)
    steps["tension"] = length * strain
    length += steps["tension"]
    # The certificate refers to the middle of the tape, which lies d / 2 outside the shell: pi d.
    steps["tape_thickness"] = -np.pi * tape.thickness_m
    obstructions = tuple(obstructions)
    steps["rise"] = -sum(item.excess(diameter_m) for item in obstructions)
    sag = sag_of(strap, tape, obstructions)
    steps["sag"] = 0.0 - sag.excess_m
    unlevel = _level_excess_bound(strapping, diameter_m)
    steps["out_of_level"] = -unlevel
    # A tape at shell temperature shares the uncertainty of that temperature.
    per_k = length * tape.expansion_per_k if tape.temperature_c is not None else 0.0
    scale = tape.master or tape.name
    # Each assumed bound is the half-width of a rectangular distribution: u = bound / sqrt(3).
    effects = (
        Effect("instrument_scale", scale, 1e6 * tape.u_scale, "ppm", length * tape.u_scale),
        Effect("instrument_offset", tape.name, 1e3 * tape.u_offset_m, "mm", tape.u_offset_m),
        Effect("tape_tension", tape.name, 100 * TENSION_SHARE / RECTANGULAR, "%",
               (length * by_tension + 2 * sag.excess_m) * TENSION_SHARE / RECTANGULAR),
        Effect("tape_friction", tape.name, tape.friction * FRICTION_SHARE / RECTANGULAR, "1",
               (length * by_friction - sag.by_friction_m) * FRICTION_SHARE / RECTANGULAR),
        Effect("tape_weight", tape.name, 100 * WEIGHT_SHARE / RECTANGULAR, "%",
               -2 * sag.excess_m * WEIGHT_SHARE / RECTANGULAR),
        Effect("tape_sag", tape.name, 100 * sag.place_share, "%",
               -sag.excess_m * sag.place_share),
        Effect("tape_level", "", 1e3 * unlevel / RECTANGULAR, "mm", -unlevel / RECTANGULAR),
        Effect("tape_temperature", tape.name, TAPE_TEMPERATURE_K / RECTANGULAR, "K",
               0.0 if on_shell else per_k * TAPE_TEMPERATURE_K / RECTANGULAR),
    )  # fmt: skip
    # Each pull is laid anew, so the variances of laying add.
    variance = strap.sd_m**2 + strap.pulls * tape.laying_m**2
    variance += sum((item.count * item.sd_m) ** 2 for item in obstructions)
    return ReducedStrap(
        strap,
        observed_m + sum(steps.values()),
        steps,
        float(np.sqrt(variance)),
        tuple(item for item in effects if item.by_m),
        per_k if on_shell else 0.0,
    )


def _level_excess_bound(strapping, diameter_m):
    """Half the bound of the excess of a tape out of level, m.

    The excess lies between 0 and the bound: half the bound is its mean and its half-width.
    A plane tilted with amplitude a lengthens a tape by pi a^2 / D, a helix of height h by h^2 / (2
    C).
    """
    wave, helix = strapping.wave_m or 0.0, strapping.helix_m or 0.0
    return (np.pi * wave**2 / diameter_m + helix**2 / (2 * np.pi * diameter_m)) / 2


def certified(tape, tapes, comparisons):
    """Return the tape with scale and offset from the comparison with its master.

    Master and working tape were pulled at the same tension and time. The corrected master reading
    over the working reading is the scale of the working tape; its own certificate is not used.

    Parameters
    ----------
    tape : Tape
    tapes : dict
        {name: Tape}.
    comparisons : iterable of Comparison

    Returns
    -------
    tape : Tape
    sd : float
        Standard deviation of its scale from the comparison alone.
    """
    if not tape.master:
        return tape, 0.0
    master, many = tapes[tape.master], tuple(comparisons)
    lengths = np.array([comparison.working_m for comparison in many])
    true = np.array([(comparison.master_m + master.correction_m) * (1 + master.correction)
                     for comparison in many])  # fmt: skip
    sds = np.array([comparison.sd_m for comparison in many])
    # Without declared standard deviations, use the scatter of the comparisons; of a single
    # comparison, 1 mm.
    if np.any(sds <= 0):
        sds = np.full(len(many), np.std(true - lengths, ddof=1) if len(many) > 1 else 1e-3)
        sds = np.maximum(sds, 1e-6)
    weights = (lengths / sds) ** 2
    # Weighted mean of the scales; a scale has the standard deviation sd / length.
    scale = float(np.sum(weights * (true / lengths - 1)) / np.sum(weights))
    calibrated = replace(
        tape,
        correction=scale,
        correction_m=0.0,
        u_scale=master.u_scale,
        u_offset_m=0.0,
        temperature_c=master.temperature_c,
        tension_n=master.tension_n,
    )
    return calibrated, float(1 / np.sqrt(np.sum(weights)))


def tapes_used(strapping):
    """Each `Tape` used for a reading, `certified`, with the sd of its scale from the comparison."""
    tapes = {item.name: item for item in strapping.tapes}
    read = dict.fromkeys(strap.tape for strap in strapping.straps)
    return tuple(certified(tapes[name], tapes, strapping.comparisons) for name in read)


def reduce_straps(strapping, shell_temperature_c, diameter_m):
    """Reduce all readings, including those compared only.

    Parameters
    ----------
    strapping : Strapping
    shell_temperature_c : float or None
    diameter_m : float

    Returns
    -------
    tuple of ReducedStrap
    """
    tapes = {tape.name: (tape, sd) for tape, sd in tapes_used(strapping)}
    results = []
    for strap in strapping.straps:
        tape, sd = tapes[strap.tape]
        obstructions = strapping.obstructions.get(strap.name, ())
        reduced = reduce_strap(
            strap, tape, obstructions, shell_temperature_c, strapping, diameter_m
        )
        if sd:
            effect_m = sd * reduced.circumference_m
            compared = Effect("tape_comparison", tape.name, 1e6 * sd, "ppm", effect_m)
            reduced = replace(reduced, effects=(*reduced.effects, compared))
        results.append(reduced)
    return tuple(results)


@dataclass(frozen=True)
class Sag:
    """Excess of a reading caused by free spans.

    Attributes
    ----------
    excess_m : float
    by_friction_m : float
        Derivative by the relative coefficient of friction, m.
    place_share : float
        Relative standard deviation due to the unknown positions of the spans; 0 without friction.
    """

    excess_m: float = 0.0
    by_friction_m: float = 0.0
    place_share: float = 0.0


def mean_tension_n(pull_n, friction, pulls):
    """Mean tension of a tape round a tank, pulled at both ends, N.

        pull (1 - exp(-mu w)) / (mu w),   w half the angle that one pull wraps

    Parameters
    ----------
    pull_n : float
        Pull at the ends, N.
    friction : float
        Coefficient of friction mu.
    pulls : int
        Number of pulls round the tank.

    Returns
    -------
    float

    Examples
    --------
    >>> [round(float(mean_tension_n(1.0, mu, 1)), 3) for mu in (0.1, 0.3)]
    [0.858, 0.648]
    """
    exponent = friction * np.pi / pulls
    # expm1 avoids the cancellation of 1 - exp(-m) at small friction.
    return pull_n * (-np.expm1(-exponent) / exponent if exponent else 1.0)


def pull_of(strap, tape):
    """Pull of a reading, N: recorded, or that of the certificate; None: unknown."""
    return tape.tension_n if strap.tension_n is None else strap.tension_n


def strain_of(strap, tape):
    """Strain relative to the certificate, and its derivatives by relative pull and friction.

    Returns
    -------
    tuple of (float, float, float)
        Zero if the pull or the stiffness is unknown.
    """
    pull = pull_of(strap, tape)
    if pull is None or not np.isfinite(tape.stiffness_n):
        return 0.0, 0.0, 0.0
    mean = mean_tension_n(pull, tape.friction, strap.pulls)
    exponent = tape.friction * np.pi / strap.pulls
    # d(mean)/d(ln mu) = pull exp(-m) - mean.
    by_friction = (pull * np.exp(-exponent) - mean) / tape.stiffness_n if exponent else 0.0
    return (mean - (tape.tension_n or 0.0)) / tape.stiffness_n, mean / tape.stiffness_n, by_friction


def sag_excess_m(span_m, weight_n_per_m, tension_n):
    """Length of a freely hanging tape minus its span, m.

        w^2 L^3 / (24 F^2)

    The ends are level. The neglected terms are (w L / F)^2 / 80 of the excess.

    Parameters
    ----------
    span_m : float
    weight_n_per_m : float
        Weight per metre, N/m.
    tension_n : float

    Returns
    -------
    float

    Examples
    --------
    >>> [round(1000 * sag_excess_m(span, 0.2, 50.0), 3) for span in (5, 10, 20)]
    [0.083, 0.667, 5.333]
    """
    return weight_n_per_m**2 * span_m**3 / (24 * tension_n**2)


def sag_of(strap, tape, obstructions):
    """Compute the `Sag` of the free spans of a reading.

    Parameters
    ----------
    strap : Strap
    tape : Tape
    obstructions : iterable of Obstruction
        Obstructions of other kinds are ignored.

    Raises
    ------
    ValueError
        If there is a span but neither reading nor certificate gives the pull.
    """
    spans = [span for span in obstructions if span.kind == "sag"]
    if not spans:
        return Sag()
    pull = pull_of(strap, tape)
    if pull is None:
        raise ValueError(f"free span of {strap.name!r}: expected the pull of its tape")
    at_pull = sum(
        span.count * sag_excess_m(span.span_m, tape.weight_n_per_m, pull) for span in spans
    )  # fmt: skip
    exponent = 2 * tape.friction * np.pi / strap.pulls
    more = _mean_exp(exponent)
    # Relative standard deviation of exp(2 m s) over s uniform in 0 to 1: sqrt(E[x^2] / E[x]^2 - 1).
    spread = np.sqrt(max(_mean_exp(2 * exponent) / more**2 - 1, 0.0))
    return Sag(at_pull * more, at_pull * exponent * _mean_exp_slope(exponent), float(spread))


def _mean_exp(x):
    """Mean of exp(x s) over s from 0 to 1."""
    return np.expm1(x) / x if x else 1.0


def _mean_exp_slope(x):
    """Derivative of `_mean_exp`: mean of s exp(x s) over s from 0 to 1."""
    # The closed form cancels near 0, so a series replaces it below 1e-3.
    return (np.exp(x) * (x - 1) + 1) / x**2 if x > 1e-3 else 0.5 + x / 3 + x**2 / 8
