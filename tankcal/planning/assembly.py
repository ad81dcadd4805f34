"""Assemble a Plan from checked input: stations from rings, targets from patterns, tape ends."""

from dataclasses import replace

import numpy as np

from tankcal.geometry.field.amplitudes import assumed_amplitudes
from tankcal.planning.bases import bases_of
from tankcal.planning.given import PLAN_FILE
from tankcal.planning.model import Known, Limits, Plan, Tie
from tankcal.planning.obstacles import obstacles_of
from tankcal.planning.patterns import photographs_of, setups_of, shell_of, tape_of, targets_of

# Defaults of [limits]: largest angle of incidence, degrees, and fewest rays per point.
INCIDENCE_DEG, RAYS = 70.0, 3


def assemble_plan(job, given, bars, folder):
    """Return the Plan of a Job and of the valid input of a plan.

    Parameters
    ----------
    job : Job
    given : Given
        Valid sections and tables of the plan.
    bars : dict
        {name: {key: value}} of the stadias in the instruments of the job.
    folder : str
        Name of the folder of the plan.

    Returns
    -------
    Plan
    """
    pattern = given.single["pattern"]
    shell = shell_of(job, pattern)
    targets = targets_of(pattern, shell, job.courses)
    settings = job.measurements.settings
    photos, setups, ties, extra, facing = [], [], [], {}, {}
    for number, ring in enumerate(given.repeated["photo_rings"], 1):
        photos += photographs_of(ring, number, shell, settings.image_sd_mm, ring.place)
    for number, ring in enumerate(given.repeated["setup_rings"], 1):
        setups += setups_of(ring, number, shell, ring.place)
    for tape in given.repeated["tapes"]:
        tie, ends, out = tape_of(tape, shell)
        ties.append(tie)
        extra |= ends
        facing |= dict.fromkeys(ends, out)
    ties += _listed_ties(given.ties)
    places = dict(zip(targets.names, targets.xyz_m, strict=True)) | extra
    places |= {setup.name: setup.xyz_m for setup in setups}
    known = _known_points(job.measurements.control, places)
    extra |= {
        control_point.name: control_point.xyz_m
        for control_point in known
        if control_point.name not in places and np.isfinite(control_point.xyz_m).all()
    }
    return Plan(
        job=replace(job, measurements=replace(job.measurements, control=None)),
        shell=shell,
        targets=targets,
        photos=tuple(photos),
        setups=tuple(setups),
        ties=tuple(ties),
        known=tuple(
            control_point for control_point in known if np.isfinite(control_point.sd_m).any()
        ),
        extra=extra,
        facing=facing,
        obstacles=obstacles_of(given),
        limits=limits_of(given.single["limits"]),
        bases=bases_of(given.stadia, bars),
        bars={
            name: bar["length_m"]
            for name, bar in bars.items()
            if bar["length_m"] and bar["u_mm"] is not None
        },
        amplitudes=_amplitudes(pattern),
        costs={key: value or 0.0 for key, value in given.single["costs"].values.items()},
        folder=folder,
    )


def _listed_ties(tables):
    """Return the ties listed in the tables of a plan."""
    ties = []
    for name, table in tables.items():
        if table is None:
            continue
        kinds = table.of("kind") if "kind" in table.columns else [None] * len(table.rows)
        tools = table.of("instrument") if "instrument" in table.columns else kinds
        rows = zip(
            table.of("from"), table.of("to"), table.of("s_mm"), table.of("readings"),
            kinds, tools if name == "distances" else [None] * len(kinds), strict=True,
        )  # fmt: skip
        for start, end, sd, readings, kind, tool in rows:
            named = (f"{start}-{end}", name, start, end)
            ties.append(Tie(*named, sd / 1000, kind or "spatial", tool, int(readings or 1)))
    return ties


def _known_points(control, places):
    """Return the known points; a blank coordinate takes its nominal value where the plan has it.

    A check point (use = "check") has a position, but no standard deviations: it does not constrain
    the network.
    """
    if control is None:
        return []
    known = []
    sds = np.where(control.check[:, None], np.nan, control.sd_m)
    for name, xyz, sd in zip(control.point, control.xyz_m, sds, strict=True):
        nominal = places.get(name, np.full(3, np.nan))
        known.append(Known(name, np.where(np.isnan(xyz), nominal, xyz), sd))
    return known


def limits_of(section):
    """Return the `Limits` of a [limits] section."""
    incidence = INCIDENCE_DEG if section["incidence_deg"] is None else section["incidence_deg"]
    return Limits(
        incidence_rad=float(np.radians(incidence)),
        relative_u=section["relative_u"],
        of=section["of"] or "top",
        rays=int(section["rays"] or RAYS),
        place=(PLAN_FILE, section.rows.get("of", section.row), "limits.of"),
    )


def _amplitudes(pattern):
    """Return the `Amplitudes` of the wall: assumed values unless the plan states others."""
    forms_mm = (pattern[key] for key in ("form_mm", "common_form_mm"))
    return assumed_amplitudes(
        *(None if form_mm is None else form_mm / 1000 for form_mm in forms_mm)
    )
