"""The parts of a tank, and the points of its wall, in SI."""

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
        Of its plates, m.
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
        Of its plates, m.
    paint_m : float
        Thickness of their paint, m.
    lap : str or None
        "inner" or "outer" of lap-jointed rings; None: not known.
    """

    name: str
    length_m: float
    thickness_m: float
    paint_m: float = 0.0
    lap: str | None = None


@dataclass(frozen=True)
class Bottom:
    """The bottom of a vertical tank, below or above the bottom of its first course.

    Attributes
    ----------
    form : str
        "flat", "leaning" (square to the shell's axis), "cone", "dish", "ellipsoidal",
        "torispherical", "points" (a surveyed surface), "cloud" (the same, found in scans) or
        "liquid" (measured volumes).
    centre_z_m : float or None
        Cone, dish and so on: z of the centre in the survey's frame; the edge is at bottom_z_m.
    xyz_m : ndarray, shape (n, 3)
        Points: surveyed, in the survey's frame; of a cloud None until its scans are read.
    sd_m : ndarray, shape (n,)
        Standard deviations of their z, or None: not given.
    level_m : ndarray, shape (n,)
        Liquid: dips, from the table's zero, ascending.
    volume_m3 : ndarray, shape (n,)
        Liquid: the capacity below each level, ascending.
    u_m3 : ndarray, shape (n,)
        Their standard uncertainties, or None: not given.
    rows : tuple
        Row of each point or level in its file, for messages.
    shared : tuple of survey.results.Cause
        Cloud: what the heights of its points have in common; each has (n,) m.
    dish_radius_m, knuckle_radius_m : float or None
        Torispherical: where given; else None.
    standard : str or None
        Torispherical: what gives the radii by the diameter; else None.
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
    """A head on the shell of a vertical tank, which liquid may rise into; sizes inside.

    Attributes
    ----------
    form : str
        "cone", "dish", "ellipsoidal" or "torispherical".
    depth_m : float or None
        Rise of its middle over the top of the shell; None: it follows from radii.
    dish_radius_m, knuckle_radius_m : float or None
        Torispherical: where given; else None.
    standard : str or None
        Torispherical: what gives the radii by the diameter; else None.
    """

    form: str
    depth_m: float | None = None
    dish_radius_m: float | None = None
    knuckle_radius_m: float | None = None
    standard: str | None = None


@dataclass(frozen=True)
class Deadwood:
    """A thing in the tank that takes room (negative volume) or gives some (positive).

    Attributes
    ----------
    bottom_m, top_m : float
        Dips, from the table's zero; the volume is linear in height between them.
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
        Dips, from the table's zero: between them it is partly afloat.
    reference_density_kg_m3 : float
        Of the liquid that the table is for.
    weighing : str
        "air" or "vacuum": what `mass_kg` was weighed in.
    """

    mass_kg: float
    critical_bottom_m: float
    critical_top_m: float
    reference_density_kg_m3: float
    weighing: str


@dataclass(frozen=True)
class End:
    """One end of a horizontal cylinder, bulging outwards; sizes as measured.

    Attributes
    ----------
    kind : str
        "flat", "conical", "ellipsoidal", "torispherical", "spherical" or "guppy".
    depth_m : float
        Along the axis, from the end of the cylinder; flat: 0; torispherical: 0 where it follows
        from the radii.
    dish_radius_m : float or None
        Torispherical: radius of the dish (crown), where given; else None.
    knuckle_radius_m : float or None
        Torispherical: radius of the knuckle, where given; else None.
    standard : str or None
        Torispherical: what gives the radii by the diameter; else None.
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
    """A horizontal cylinder between its ends A and B; sizes as measured, on the side of the survey.

    Attributes
    ----------
    length_m : float
        Of the cylinder, without the ends; the same inside and outside.
    width_m, height_m : float or None
        Of its cross-section, equal when round; None: they come from the points or the straps.
    tilt : float or None
        Rise of end B over end A per metre of axis, tan of the angle; None: from the points.
    roll_rad : float
        Turn of the cross-section about the axis, clockwise seen from A.
    dip_from_a_m : float
        Of the dip point, along the axis from the start of the cylinder at A.
    dip_direction : str
        Dips are read "plumb", or "square" to the axis.
    thickness_m : float
        Plate and paint, to be subtracted from what was measured outside; of strapped rings those of
        the ends.
    azimuth_rad : float or None
        Direction from A to B, clockwise from +y; None: no points.
    tube_angle_rad : float or None
        Of the gauge tube off the plumb, square to the axis; its top to the right, seen from A;
        None: plumb.
    tube_offset_m : float or None
        Distance at which the tube passes the axis, to the right of it, seen from A; None: 0.
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
        As measured, on the side of the survey; None: it comes from the points.
    thickness_m : float
        Plate and paint, to be subtracted from what was measured outside.
    ovality_m : float or None
        Standard deviation of its degree 2 where no strap tells it; None: a share of its radius.
    form_m : float or None
        Of its radius beyond that; None: as `geometry.field.places` assumes.
    """

    diameter_m: float | None
    thickness_m: float = 0.0
    ovality_m: float | None = None
    form_m: float | None = None


@dataclass(frozen=True)
class Ship:
    """What a ship adds to a tank of a mesh: how she lies, and the pipe that is sounded.

    Attributes
    ----------
    trim_m : tuple of float
        Draught aft less draught forward, of the tables of corrections, ascending.
    length_between_marks_m : float
        Of the draughts.
    list_rad : tuple of float
        To starboard, ascending.
    bow_azimuth_rad : float
        Clockwise from +y of the mesh's frame.
    pipe_bottom_m, pipe_top_m : tuple of float
        Ends of the sounding pipe in the mesh's frame.
    correction_step_m : float or None
        Of the soundings of corrections; None: chosen.
    contraction : float or None
        Share by which all lengths are shorter in service than as measured; None: not given.
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
        Length of one unit of it, m.
    data : bytes
        What the file holds.
    """

    file: str
    unit_m: float
    data: bytes = field(repr=False)
