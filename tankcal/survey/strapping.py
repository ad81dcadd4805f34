"""Strapping: from the reading of a tape round a tank to the circumference of its painted shell.

    strain = (F - F_cert) / (A E),   F the mean tension round the tank
    length = (reading + correction_mm) (1 + correction) (1 + a (T - T_cert)) (1 + strain)
    circumference = length - pi d - sum of excesses - sag,   d the thickness of the tape

A warm or a stretched tape reads too little, one that hangs free over a span too much. A tape whose
temperature nobody read lies on the shell and has that of the shell.

Source: ISO 7507-1:2003; API MPMS 2.2A (methods); the formulas of excesses follow from plane
geometry: a tape leaves a round shell on the two tangents from an edge.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.survey.tape_tension import sag_of, strain_of

KINDS = ("butt_strap", "weld", "step", "lap", "step_over", "measured", "sag")
# what is assumed where a job says nothing: half-widths of rectangular distributions
TAPE_TEMPERATURE_K = 2.0  # of a tape whose own temperature was read
TENSION_SHARE = 0.1  # of the pull
FRICTION_SHARE = 0.5  # of the coefficient
WEIGHT_SHARE = 0.05  # of the weight of a metre
RECTANGULAR = np.sqrt(3.0)


@dataclass(frozen=True)
class Tape:
    """A tape as its certificate has it; None: not said.

    Attributes
    ----------
    name : str
    correction, correction_m : float
        True length = (reading + correction_m) (1 + correction).
    temperature_c, tension_n : float or None
        That the certificate is for.
    expansion_per_k, thickness_m, friction : float
        Friction 0: a tension is that round the whole tank; else it is that of the pull.
    stiffness_n : float
        Section times Young's modulus; inf: it does not stretch.
    weight_n_per_m : float
        For the sag of free spans.
    u_scale, u_offset_m, laying_m : float
        Standard uncertainties; of the laying for each pull.
    master : str
        Tape that it was compared with, whose certificate then counts; "": its own.
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
    """A length read by the master and by the working tape."""

    level: str
    master_m: float
    working_m: float
    sd_m: float = 0.0
    when: str = ""


@dataclass(frozen=True)
class Obstruction:
    """What keeps a tape off the shell; lengths in m, None where its kind needs none.

    kind  "butt_strap" or "weld" (thickness, width), "step" or "lap" (thickness), "step_over" (over
          the obstruction, and the shell's arc between the tool's legs), "measured" (excess) or
          "sag" (span that the tape hangs free over: see `tape_tension.sag_of`)
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
        """By how much the tape is longer than the shell's circumference, m; 0 of a free span.

        Of a butt strap or weld cap N (2 t W / D + (8/3) t sqrt(t / D)), of one step half the term
        of its tangents, of a lap joint that of half its thickness on each side.
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
        along = 2 * t * self.width_m / diameter_m
        return self.count * (along + 8 / 3 * t * np.sqrt(t / diameter_m))


@dataclass(frozen=True)
class Strap:
    """A reading of a tape round the tank, outside.

    Attributes
    ----------
    name, course : str
        Readings of one name are repeats of one circumference.
    level_m : float
        From the table's zero, m.
    reading_m, sd_m : float
    tape : str
        Name of a `Tape`.
    temperature_c, tension_n : float or None
        None: that of the shell; that of the certificate.
    pulls : int
        In which the tape was pulled round the tank.
    check : bool
        Only compared.
    row : int or None
        In its file.
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
    """What was strapped, and with what.

    Attributes
    ----------
    straps : tuple of Strap
    tapes : tuple of Tape
    obstructions : dict
        {name of a circumference: tuple of Obstruction}.
    comparisons : tuple of Comparison
        Of the working tape with its master.
    shape_sd_m : float
        Standard deviation of the radius round the wall.
    wave_m, helix_m : float or None
        Bounds of how far the tape was out of level, and of what its ends stood apart in height;
        None: nobody says.
    plate_sd_m : dict
        {course: standard uncertainty of its plate by the readings of a gauge}.
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
    """What one standard uncertainty of a cause does to a circumference.

    kind, name  of the cause: two readings share it where both are the same
    u, unit     of it, as it is told; by_m: what it does, m
    """

    kind: str
    name: str
    u: float
    unit: str
    by_m: float


@dataclass(frozen=True)
class Reduced:
    """A reading reduced to the circumference of the shell.

    Attributes
    ----------
    strap : Strap
    circumference_m : float
    steps_m : dict
        {correction: what it adds}, in their order: "certificate", "temperature", "tension",
        "tape_thickness", "rise", "sag", "out_of_level".
    sd_m : float
        Of what no other reading shares.
    effects : tuple of Effect
    by_shell_temperature_m : float
        m per K, where the tape has the temperature of the shell.
    """

    strap: Strap
    circumference_m: float
    steps_m: dict
    sd_m: float
    effects: tuple[Effect, ...]
    by_shell_temperature_m: float


def reduce_strap(strap, tape, obstructions, shell_temperature_c, strapping, diameter_m):
    """`Reduced` circumference of one reading.

    Parameters
    ----------
    strap : Strap
    tape : Tape
        After `certified`: its scale is its own, or its master's.
    obstructions : iterable of Obstruction
        On its way.
    shell_temperature_c : float or None
    strapping : Strapping
        For the bounds of how level the tape was.
    diameter_m : float
        Of the tank, for the excess of what keeps the tape off.
    """
    given = strap.reading_m
    length = (given + tape.correction_m) * (1 + tape.correction)
    steps = {"certificate": length - given}
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
    steps["tape_thickness"] = -np.pi * tape.thickness_m
    obstructions = tuple(obstructions)
    steps["rise"] = -sum(one.excess(diameter_m) for one in obstructions)
    sag = sag_of(strap, tape, obstructions)
    steps["sag"] = 0.0 - sag.excess_m
    unlevel = _out_of_level(strapping, diameter_m)
    steps["out_of_level"] = -unlevel
    per_k = length * tape.expansion_per_k if tape.temperature_c is not None else 0.0
    scale = tape.master or tape.name
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
    own = strap.sd_m**2 + strap.pulls * tape.laying_m**2
    own += sum((one.count * one.sd_m) ** 2 for one in obstructions)
    return Reduced(
        strap,
        given + sum(steps.values()),
        steps,
        float(np.sqrt(own)),
        tuple(one for one in effects if one.by_m),
        per_k if on_shell else 0.0,
    )


def _out_of_level(strapping, diameter_m):
    """Half the bounds of the excess of a tape that is not level: it is never below zero.

    A tilted plane of amplitude a makes a tape longer by pi a^2 / D, a helix of height h by
    h^2 / (2 C).
    """
    wave, helix = strapping.wave_m or 0.0, strapping.helix_m or 0.0
    return (np.pi * wave**2 / diameter_m + helix**2 / (2 * np.pi * diameter_m)) / 2


def certified(tape, tapes, comparisons):
    """The tape with the scale and the offset that its master gives it.

    Both tapes were pulled alike at one time: what the master reads, corrected, over what the
    working tape read is the working tape's scale; its certificate is not copied.

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
        Of its scale by the comparison alone.
    """
    if not tape.master:
        return tape, 0.0
    master, many = tapes[tape.master], tuple(comparisons)
    lengths = np.array([one.working_m for one in many])
    true = np.array([(one.master_m + master.correction_m) * (1 + master.correction)
                     for one in many])  # fmt: skip
    sds = np.array([one.sd_m for one in many])
    if np.any(sds <= 0):  # nobody says how well: their scatter does
        sds = np.full(len(many), np.std(true - lengths, ddof=1) if len(many) > 1 else 1e-3)
        sds = np.maximum(sds, 1e-6)
    weights = (lengths / sds) ** 2
    scale = float(np.sum(weights * (true / lengths - 1)) / np.sum(weights))
    found = replace(
        tape,
        correction=scale,
        correction_m=0.0,
        u_scale=master.u_scale,
        u_offset_m=0.0,
        temperature_c=master.temperature_c,
        tension_n=master.tension_n,
    )
    return found, float(1 / np.sqrt(np.sum(weights)))


def tapes_used(strapping):
    """Each `Tape` that was read, `certified`, and the sd of its scale by the comparison."""
    tapes = {one.name: one for one in strapping.tapes}
    read = dict.fromkeys(strap.tape for strap in strapping.straps)
    return tuple(certified(tapes[name], tapes, strapping.comparisons) for name in read)


def reduce_straps(strapping, shell_temperature_c, diameter_m):
    """`Reduced` of every reading, those that are only compared too.

    Parameters
    ----------
    strapping : Strapping
    shell_temperature_c : float or None
    diameter_m : float
    """
    tapes = {tape.name: (tape, sd) for tape, sd in tapes_used(strapping)}
    found = []
    for strap in strapping.straps:
        tape, sd = tapes[strap.tape]
        obstructions = strapping.obstructions.get(strap.name, ())
        reduced = reduce_strap(
            strap, tape, obstructions, shell_temperature_c, strapping, diameter_m
        )
        if sd:
            by = sd * reduced.circumference_m
            compared = Effect("tape_comparison", tape.name, 1e6 * sd, "ppm", by)
            reduced = replace(reduced, effects=(*reduced.effects, compared))
        found.append(reduced)
    return tuple(found)
