"""Tanks of ships and barges: a mesh with trim and list, sounded along a pipe.

The frame of the ship has x towards the bow, y to port, and z up, perpendicular to the base of the
tank. For the tangents t of trim (positive by the stern) and l of list (positive to starboard), the
vertical is, to first order, (t, l, 1), and the liquid surface is z = h_c - t x - l y. With z' = z +
t x + l y the surface is level, z' = h_c. The shear (x, y, z) -> (x, y, z') preserves volumes and
the plan of each face. The tank below the inclined surface is thus the sheared mesh below a level,
whose volume is exact (`meshes.part`). A pipe from b in the direction of the unit vector u is wet up
to the sounding s with b' + s (u_z + t u_x + l u_y) = h_c.

Corrections of soundings
------------------------

The correction c of a sounding s at a trim and list is defined by

    V(s + c; even keel) = V(s; trim, list).

With the derivatives D of both volumes by an input, and A = dV/ds of the table at even keel, the
input changes c by (D(s; trim, list) - D(s + c; even keel)) / A. Common effects of both volumes,
such as a scale, nearly cancel. Trim and list change the first volume alone, since even keel is
exact.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import message
from tankcal.tank.meshes.part import Mesh, MeshPart, mesh_part, moments_below, normals_of
from tankcal.tank.parts import Part, as_levels

__all__ = [
    "CellCorrections",
    "Pipe",
    "PipedMesh",
    "corrections_of",
    "in_ship_frame",
    "piped_mesh",
    "soundings_of_volumes",
]
GRID = 257  # number of soundings of the first bracket of a volume
CLOSE = 1e-13  # tolerance of a volume, relative to the capacity
ROUNDS = 60  # largest number of iterations
READABLE, BELOW, FULL = "", "below", "full"  # states of a sounding


@dataclass(frozen=True)
class Pipe:
    """Straight sounding pipe, in the frame of its tank.

    Attributes
    ----------
    bottom_m, top_m : ndarray, shape (3,)
        Ends of the pipe; soundings count from the lower end.
    """

    bottom_m: np.ndarray
    top_m: np.ndarray

    @property
    def length_m(self):
        """Distance between the ends."""
        return float(np.linalg.norm(self.top_m - self.bottom_m))

    @property
    def direction(self):
        """Unit vector (3,) from the lower end to the upper end."""
        return (self.top_m - self.bottom_m) / self.length_m

    def rise(self, trim=0.0, list_=0.0):
        """Return the rise of the surface at the axis of the pipe per metre of sounding.

        At even keel, it is the cosine of the lean of the pipe. A pipe with a rise of zero or less
        cannot be sounded.
        """
        return float(self.direction @ (trim, list_, 1.0))


def in_ship_frame(xyz_m, bow_azimuth_rad):
    """Return coordinates (n, 3) with x towards the bow and y to port.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
        Coordinates in a frame with z up.
    bow_azimuth_rad : float
        Direction of the bow in that frame, clockwise from +y; for a right angle, coordinates are
        unchanged.

    Returns
    -------
    ndarray, shape (n, 3)

    Examples
    --------
    >>> in_ship_frame(np.array([[0.0, 2.0, 5.0]]), 0.0).round(12).tolist()
    [[2.0, 0.0, 5.0]]
    """
    x, y, z = np.asarray(xyz_m, dtype=float).T
    sin, cos = np.sin(bow_azimuth_rad), np.cos(bow_azimuth_rad)
    return np.column_stack([x * sin + y * cos, y * sin - x * cos, z])


@dataclass(frozen=True)
class PipedMesh(Part):
    """Mesh at a trim and list, with soundings along its pipe as levels; see `piped_mesh`.

    Attributes
    ----------
    pipe : Pipe
    trim, list_ : float
        Tangents, positive by the stern and to starboard.
    sheared : MeshPart
        Mesh under z', whose level 0 is that of the lower end of the pipe.
    corners_xy_m : ndarray, shape (m, 3, 2)
        x, y of the corners from the lower end of the pipe, in the order of the corners of
        `sheared`.
    contracted : float or None
        Ratio of lengths of this mesh to the measured lengths, by a uniform contraction; None: no
        contraction was given.
    marks_m : float
        Distance of the draught marks, over which the input "trim" is read.
    """

    pipe: Pipe
    trim: float
    list_: float
    sheared: MeshPart
    corners_xy_m: np.ndarray
    contracted: float | None = None
    marks_m: float = 1.0

    @property
    def rise(self):
        """Rise of the surface at the pipe per metre of sounding."""
        return self.pipe.rise(self.trim, self.list_)

    @property
    def face_count(self):
        """Number of triangles."""
        return self.sheared.face_count

    @property
    def top_m(self):
        """Sounding at which the tank becomes full."""
        return self.sheared.top_m / self.rise

    @cached_property
    def capacity_m3(self):
        """Volume of the full tank."""
        return self.sheared.capacity_m3

    @cached_property
    def dry_m3(self):
        """Volume of the tank when the pipe becomes dry."""
        return float(self.volume_m3([0.0])[0])

    def volume_m3(self, levels_m):
        """Return the volume (rows,) at each sounding; HeightError above the full tank."""
        return self.sheared.volume_m3(self._heights(levels_m))

    def area_m2(self, levels_m):
        """Return the derivative (rows,) of the volume by the sounding."""
        return self.rise * self.sheared.area_m2(self._heights(levels_m))

    def derivatives(self, levels_m):
        """Return {input: derivative (rows,) of the volume at a fixed sounding}.

        scale      scale of all coordinates, including those of the pipe, but not of the soundings
        surface    outward offset of the surface along its normal, m: the wetted area
        datum      zero of the pipe along the pipe, m
        trim, list  draught aft less draught forward, m, and the angle, rad; by the tangent of trim,
                    the derivative is A s u_x - moment of the free surface by x, and likewise for
                    list by y
        pipe_x, pipe_y  position of the whole pipe, m
        pipe_lean  (rows, 2) lean of the pipe about its lower end, m/m, fore and aft and athwart
        contraction  relative contraction of all lengths, if given
        """
        soundings, heights = as_levels(levels_m), self._heights(levels_m)
        volume = self.sheared.volume_m3(heights)
        area, *moment = self._moments(heights).T
        u, rise = self.pipe.direction, self.rise
        scale = 3 * volume - heights * area
        # A lean changes the direction u; its length stays one, so the rise changes as well.
        by_lean = (soundings * area)[:, None] * (np.array([self.trim, self.list_]) - rise * u[:2])
        derivatives = {
            "scale": scale,
            "surface": self.sheared.wetted_m2(heights),
            "datum": rise * area,
            "trim": (soundings * u[0] * area - moment[0]) / self.marks_m,
            "list": (1 + self.list_**2) * (soundings * u[1] * area - moment[1]),
            "pipe_x": self.trim * area,
            "pipe_y": self.list_ * area,
            "pipe_lean": by_lean,
        }
        if self.contracted is not None:
            derivatives["contraction"] = -scale / self.contracted
        return derivatives

    def _heights(self, levels_m):
        """Return heights (rows,) of the surface above the lower end of the pipe."""
        return self.rise * as_levels(levels_m)

    def _moments(self, heights):
        """Return area and moments (rows, 3) of the free surface about the end of the pipe."""
        part = self.sheared
        mesh_heights = heights + part.zero_m
        values = np.concatenate(
            [np.ones_like(self.corners_xy_m[..., :1]), self.corners_xy_m], axis=2
        )
        moments = moments_below(part.corners_m, values, -part.plan_m2, mesh_heights)
        full = mesh_heights >= part.height_m
        if full.any():  # as in `MeshPart.area_m2`: the surface just below the top
            top = [part.height_m]
            moments[full] = moments_below(part.corners_m, values, -part.plan_m2, top, "right")
        return moments


def piped_mesh(mesh, pipe, trim=0.0, list_=0.0, *, scale=1.0, contracted=None, marks_m=1.0):
    """Return the `PipedMesh` of a `meshes.Mesh` in the frame of the ship.

    Parameters
    ----------
    mesh : Mesh
        Mesh with the bow towards +x, port towards +y (`in_ship_frame`).
    pipe : Pipe
        Pipe in the frame of the mesh, as measured.
    trim, list_ : float
        Tangents.
    scale : float
        Factor on all lengths, due to temperature and contraction.
    contracted : float or None
        Part of the scale due to a uniform contraction.
    marks_m : float
        Distance between the draught marks.

    References
    ----------
    Closed form: a shear along z preserves volumes and plans; sums over triangles as in
    `meshes.part`.

    Examples
    --------
    A box of 4 x 2 x 3 m with its pipe in the starboard corner aft, and a trim of 2 cm per metre:

    >>> from tankcal.tank.meshes import closed_mesh
    >>> import trimesh
    >>> box = trimesh.creation.box((4.0, 2.0, 3.0))
    >>> pipe = Pipe(np.array([-2.0, -1.0, -1.5]), np.array([-2.0, -1.0, 2.0]))
    >>> tank = piped_mesh(closed_mesh(box.vertices, box.faces), pipe, trim=0.02)
    >>> tank.volume_m3([1.04]).round(9).tolist()
    [8.0]
    """
    # The lower end of the pipe becomes the origin, so that level 0 is the zero of the soundings.
    local = scale * (mesh.vertices_m - pipe.bottom_m)
    sheared = local.copy()
    sheared[:, 2] += local[:, :2] @ (trim, list_)
    part = mesh_part(Mesh(sheared, mesh.faces, mesh.bodies, mesh.notes), 0.0)
    # The shear changes surface areas: take them from the unsheared mesh.
    surface_areas_m2 = np.sqrt(np.sum(normals_of(local, mesh.faces) ** 2, axis=1)) / 2
    order = np.argsort(sheared[mesh.faces, 2], axis=1, kind="stable")
    corners = np.take_along_axis(mesh.faces, order, axis=1)
    ends = (scale * (end - pipe.bottom_m) for end in (pipe.bottom_m, pipe.top_m))
    return PipedMesh(
        Pipe(*ends),
        float(trim),
        float(list_),
        replace(part, surface_m2=surface_areas_m2),
        local[corners, :2],
        contracted,
        marks_m,
    )


@dataclass(frozen=True)
class CellCorrections:
    """Corrections at a trim and list.

    Attributes
    ----------
    volume_m3 : ndarray, shape (rows,)
        Volume at each sounding, at most the capacity.
    state : ndarray of str, shape (rows,)
        "" for a sounding with a correction; "full" if the tank is full, or the table at even keel
        ends at a smaller volume; "below" if that table begins at a larger volume.
    even_m : ndarray, shape (rows,)
        Soundings of equal volume at even keel; nan if there is none.
    dry_m3 : float
        Volume at which the pipe becomes dry.
    full_m : float
        Sounding at which the tank becomes full.
    interpolated_m : float
        Largest error of a correction interpolated half way between two soundings.
    """

    volume_m3: np.ndarray
    state: np.ndarray
    even_m: np.ndarray
    dry_m3: float
    full_m: float
    interpolated_m: float


def corrections_of(parts, even, soundings_m, top_m=np.inf):
    """Return the `CellCorrections` of each trim and list.

    Parameters
    ----------
    parts : sequence of PipedMesh
        One for each trim and list.
    even : PipedMesh
        Mesh at even keel.
    soundings_m : ndarray, shape (rows,)
        Soundings from the lower end of the pipe, ascending from 0.
    top_m : float, optional
        Last sounding of the table at even keel, a whole millimetre: larger soundings count as full.

    Returns
    -------
    list of CellCorrections
    """
    soundings = np.asarray(soundings_m, dtype=float)
    midpoints = (soundings[:-1] + soundings[1:]) / 2
    all_soundings = np.concatenate([soundings, midpoints])
    volumes = np.array([mesh.volume_m3(np.minimum(all_soundings, mesh.top_m)) for mesh in parts])
    is_full = all_soundings >= np.array([mesh.top_m for mesh in parts])[:, None]
    # A first row at even keel equals the volume of the dry pipe up to rounding: it is in the table.
    is_below = ~is_full & (volumes < even.dry_m3 - CLOSE * even.capacity_m3)
    even_m = np.full(volumes.shape, np.nan)
    # The volumes of all trims and lists are inverted at once.
    even_m[~is_full & ~is_below] = soundings_of_volumes(even, volumes[~is_full & ~is_below])
    is_full |= even_m > top_m
    even_m[is_full] = np.nan
    state = np.where(is_full, FULL, np.where(is_below, BELOW, READABLE))
    rows = len(soundings)
    return [
        CellCorrections(
            volumes[i, :rows],
            state[i, :rows],
            even_m[i, :rows],
            float(volumes[i, 0]),
            part.top_m,
            _interpolation_error(even_m[i, :rows] - soundings, even_m[i, rows:] - midpoints),
        )
        for i, part in enumerate(parts)
    ]


def _interpolation_error(correction, exact):
    """Return the largest error of corrections interpolated half way between soundings."""
    interpolated = (correction[:-1] + correction[1:]) / 2
    return float(np.nanmax(np.abs(interpolated - exact), initial=0.0))


def soundings_of_volumes(part, volumes_m3):
    """Return soundings (n,) of a `PipedMesh` for given volumes: the exact inverse.

    Newton's method, safeguarded by a bracket that each iteration reduces.

    Parameters
    ----------
    part : PipedMesh
    volumes_m3 : array_like, shape (n,)

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    SolutionError
        For a volume that is not between the volumes at the lowest sounding and of the full tank.
    """
    volumes = np.asarray(volumes_m3, dtype=float)
    capacity = part.capacity_m3
    slack = CLOSE * capacity
    outside = ~((volumes >= part.dry_m3 - slack) & (volumes <= capacity + slack))
    if outside.any():
        raise SolutionError(
            message(
                "volume_not_in_ship_tank",
                "{volume_m3:g} m3 is not between the volumes of the table, {least_m3:g} and "
                "{most_m3:g} m3",
                volume_m3=volumes[outside][0],
                least_m3=part.dry_m3,
                most_m3=capacity,
            )
        )
    grid = np.linspace(0.0, part.top_m, GRID)
    # Rounding may make the volumes fall slightly; the bracket requires ascending values.
    volumes_on_grid = np.maximum.accumulate(part.volume_m3(grid))
    upper = np.clip(np.searchsorted(volumes_on_grid, volumes), 1, GRID - 1)
    low, high = grid[upper - 1].copy(), grid[upper].copy()
    share = (volumes - volumes_on_grid[upper - 1]) / np.maximum(
        volumes_on_grid[upper] - volumes_on_grid[upper - 1], slack
    )
    soundings = low + np.clip(share, 0.0, 1.0) * (high - low)
    open_indices = np.arange(len(volumes))
    for _ in range(ROUNDS):
        excess = part.volume_m3(soundings[open_indices]) - volumes[open_indices]
        high[open_indices[excess >= 0]] = soundings[open_indices[excess >= 0]]
        low[open_indices[excess < 0]] = soundings[open_indices[excess < 0]]
        is_wide = high[open_indices] - low[open_indices] > 4 * np.finfo(float).eps * part.top_m
        unfinished = (np.abs(excess) > slack) & is_wide
        open_indices, excess = open_indices[unfinished], excess[unfinished]
        if len(open_indices) == 0:
            break
        area = part.area_m2(soundings[open_indices])
        step = np.divide(excess, area, out=np.full(len(open_indices), np.inf), where=area > 0)
        newton = soundings[open_indices] - step
        # A Newton step outside the bracket is replaced by bisection.
        inside = (newton > low[open_indices]) & (newton < high[open_indices])
        soundings[open_indices] = np.where(
            inside, newton, (low[open_indices] + high[open_indices]) / 2
        )
    return soundings
