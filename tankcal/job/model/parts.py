"""Parts of a tank, in SI."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Course:
    """One ring of plates, from the bottom up.

    Attributes
    ----------
    name : str
    height_m : float
        From joint to joint, m.
    thickness_m : float
        Thickness of its plates, m.
    paint_m : float
        Thickness of their paint, m.
    welds_rad : tuple of float or None
        Azimuths of its vertical welds, clockwise from +y, rad; None: not known.
    """

    name: str
    height_m: float
    thickness_m: float
    paint_m: float = 0.0
    welds_rad: tuple[float, ...] | None = field(
        default=None,
        metadata={
            "doc": "azimuths of its vertical welds, clockwise from +y; left out if unknown",
            "optional": True,
        },
    )


@dataclass(frozen=True)
class Ring:
    """One ring of plates of a lying cylinder, from end A to end B.

    Attributes
    ----------
    name : str
    length_m : float
        Along the axis, m.
    thickness_m : float
        Thickness of its plates, m.
    paint_m : float
        Thickness of their paint, m.
    lap : str or None
        "inner" or "outer" for lap-jointed rings; None: not known.
    """

    name: str
    length_m: float
    thickness_m: float = 0.0
    paint_m: float = 0.0
    lap: str | None = None


@dataclass(frozen=True)
class Bottom:
    """Bottom of a vertical tank, below or above the lower edge of its first course.

    Attributes
    ----------
    form : str
        "flat", "leaning" (perpendicular to the axis of the shell), "cone", "dish", "ellipsoidal",
        "torispherical", "points" (a surveyed surface), "cloud" (a surface measured by scans) or
        "liquid" (measured volumes).
    centre_z_m : float or None
        Cone, dish and so on: z of the centre in the frame of the survey; the edge is at bottom_z_m.
    xyz_m : ndarray, shape (n, 3)
        Points: surveyed, in the frame of the survey; for a cloud None until its scans are read.
    sd_m : ndarray, shape (n,)
        Standard deviations of their z, or None: not given.
    level_m : ndarray, shape (n,)
        Liquid: dips, from the zero of the table, ascending.
    volume_m3 : ndarray, shape (n,)
        Liquid: capacity below each level, ascending.
    u_m3 : ndarray, shape (n,)
        Standard uncertainties of the capacities, or None: not given.
    rows : tuple
        Row of each point or level in its file, for messages.
    shared : tuple of survey.results.Cause
        Cloud: common causes of error of the heights; each has (n,) m.
    dish_radius_m, knuckle_radius_m : float or None
        Torispherical: radii if given; else None.
    standard : str or None
        Torispherical: standard that defines the radii from the diameter; else None.
    """

    form: str = "flat"
    centre_z_m: float | None = None
    xyz_m: np.ndarray | None = None
    sd_m: np.ndarray | None = None
    level_m: np.ndarray | None = None
    volume_m3: np.ndarray | None = None
    u_m3: np.ndarray | None = None
    rows: tuple = ()
    shared: tuple = ()
    dish_radius_m: float | None = None
    knuckle_radius_m: float | None = None
    standard: str | None = None


@dataclass(frozen=True)
class Top:
    """Head on the shell of a vertical tank, which can contain liquid; inside dimensions.

    Attributes
    ----------
    form : str
        "cone", "dish", "ellipsoidal" or "torispherical".
    depth_m : float or None
        Height of its centre above the top of the shell; None: determined by the radii.
    dish_radius_m, knuckle_radius_m : float or None
        Torispherical: radii if given; else None.
    standard : str or None
        Torispherical: standard that defines the radii from the diameter; else None.
    """

    form: str
    depth_m: float | None = None
    dish_radius_m: float | None = None
    knuckle_radius_m: float | None = None
    standard: str | None = None


@dataclass(frozen=True)
class Deadwood:
    """Object in the tank that reduces (negative volume) or increases (positive) the capacity.

    Attributes
    ----------
    bottom_m, top_m : float
        Dips, from the zero of the table; the volume is linear in height between them.
    u_m3 : float or None
        Standard uncertainty of the volume, or None: not given.
    """

    name: str
    bottom_m: float
    top_m: float
    volume_m3: float
    u_m3: float | None = None
    row: int | None = None


@dataclass(frozen=True)
class Roof:
    """A floating roof. It displaces its mass over the density of the liquid.

    Attributes
    ----------
    critical_bottom_m, critical_top_m : float
        Dips, from the zero of the table; between them the roof is partly afloat.
    reference_density_kg_m3 : float
        Density of the liquid of the table.
    weighing : str
        "air" or "vacuum": condition of the weighing that gave `mass_kg`.
    high_critical_bottom_m, high_critical_top_m : float or None
        Critical zone with the legs in their high position; None: they have a single position.
    """

    mass_kg: float
    critical_bottom_m: float
    critical_top_m: float
    reference_density_kg_m3: float
    weighing: str
    high_critical_bottom_m: float | None = None
    high_critical_top_m: float | None = None


@dataclass(frozen=True)
class End:
    """One end of a horizontal cylinder, curved outwards; dimensions as measured.

    Attributes
    ----------
    kind : str
        "flat", "conical", "ellipsoidal", "torispherical", "spherical" or "guppy".
    depth_m : float
        Along the axis, from the end of the cylinder; flat: 0; torispherical: 0 if determined by the
        radii.
    dish_radius_m : float or None
        Torispherical: radius of the dish (crown) if given; else None.
    knuckle_radius_m : float or None
        Torispherical: radius of the knuckle if given; else None.
    standard : str or None
        Torispherical: standard that defines the radii from the diameter; else None.
    """

    kind: str
    depth_m: float = 0.0
    dish_radius_m: float | None = None
    knuckle_radius_m: float | None = None
    standard: str | None = field(
        default=None,
        metadata={"doc": "form that both radii follow from; left out if none", "optional": True},
    )


@dataclass(frozen=True)
class Horizontal:
    """Horizontal cylinder between its ends A and B; dimensions on the side of the survey.

    Attributes
    ----------
    length_m : float
        Length of the cylinder without the ends; equal inside and outside.
    width_m, height_m : float or None
        Width and height of its cross-section, equal if round; None: from the points or the straps.
    tilt : float or None
        Rise of end B over end A per metre of axis, tan of the angle; None: from the points.
    roll_rad : float
        Rotation of the cross-section about the axis, clockwise seen from A.
    dip_from_a_m : float
        Position of the dip point along the axis, from the end A of the cylinder.
    dip_direction : str
        Direction of the dips: "plumb", or "square" to the axis.
    thickness_m : float
        Thickness of plate and paint, subtracted from outside dimensions; for strapped rings,
        thickness of the ends.
    azimuth_rad : float or None
        Direction from A to B, clockwise from +y; None: no points.
    tube_angle_rad : float or None
        Inclination of the gauge tube perpendicular to the axis; positive: its top is to the right,
        seen from A; None: plumb.
    tube_offset_m : float or None
        Distance of the tube from the axis, positive to the right, seen from A; None: 0.
    """

    length_m: float
    end_a: End
    end_b: End
    width_m: float | None
    height_m: float | None
    tilt: float | None = 0.0
    roll_rad: float = 0.0
    dip_from_a_m: float = 0.0
    dip_direction: str = "plumb"
    thickness_m: float = 0.0
    azimuth_rad: float | None = None
    tube_angle_rad: float | None = field(
        default=None,
        metadata={"doc": "of the gauge tube off the plumb; left out if plumb", "optional": True},
    )
    tube_offset_m: float | None = field(
        default=None,
        metadata={"doc": "of the tube off the axis; left out if through it", "optional": True},
    )


@dataclass(frozen=True)
class Sphere:
    """A sphere.

    Attributes
    ----------
    diameter_m : float or None
        Diameter as measured, on the side of the survey; None: from the points.
    thickness_m : float
        Thickness of plate and paint, subtracted from outside dimensions.
    ovality_m : float or None
        Prior standard deviation of its degree 2, for directions without straps; None: a share of
        its radius.
    form_m : float or None
        Prior standard deviation of its radius in higher degrees; None: as in
        `geometry.field.places`.
    """

    diameter_m: float | None
    thickness_m: float = 0.0
    ovality_m: float | None = None
    form_m: float | None = None


@dataclass(frozen=True)
class Ship:
    """Attitudes and sounding pipe of a tank of a ship, in addition to its mesh.

    Attributes
    ----------
    trim_m : tuple of float
        Draught aft less draught forward, for the tables of corrections, ascending.
    length_between_marks_m : float
        Distance between the marks of the draughts.
    list_rad : tuple of float
        List to starboard, ascending.
    bow_azimuth_rad : float
        Azimuth of the bow, clockwise from +y of the frame of the mesh.
    pipe_bottom_m, pipe_top_m : tuple of float
        Ends of the sounding pipe in the frame of the mesh.
    correction_step_m : float or None
        Step of the soundings in tables of corrections; None: automatic.
    contraction : float or None
        Relative contraction of all lengths from measurement to service; None: not given.
    """

    trim_m: tuple[float, ...]
    length_between_marks_m: float
    list_rad: tuple[float, ...]
    bow_azimuth_rad: float
    pipe_bottom_m: tuple[float, float, float]
    pipe_top_m: tuple[float, float, float]
    correction_step_m: float | None = None
    contraction: float | None = None


@dataclass(frozen=True)
class Mesh:
    """A closed mesh of the inside.

    Attributes
    ----------
    file : str
        Name of its file.
    unit_m : float
        Length of one unit of its coordinates, m.
    data : bytes
        Content of the file.
    """

    file: str
    unit_m: float
    data: bytes = field(repr=False)
