"""A mesh on a ship: the surface leans by trim and list, the sounding is taken along a pipe.

In the ship's frame (x towards the bow, y to port, z up, square to the tank's base) the vertical of
a ship with tangents t of trim (by the stern positive) and l of list (to starboard positive) is, to
first order, (t, l, 1), and the liquid's surface is z = h_c - t x - l y. With z' = z + t x + l y it
is level, z' = h_c: the shear (x, y, z) -> (x, y, z') keeps volumes and the plan of each face, so
the tank below that surface is the sheared mesh below a level, whose volume is exact
(`meshes.part`). A pipe from b in the direction of the unit vector u is wet up to the sounding s
where b' + s (u_z + t u_x + l u_y) = h_c.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tankcal.tank.meshes.part import Mesh, MeshPart, mesh_part, moments_below, normals_of
from tankcal.tank.parts import Part, as_levels


@dataclass(frozen=True)
class Pipe:
    """A straight sounding pipe, in the frame of its tank.

    Attributes
    ----------
    bottom_m, top_m : ndarray, shape (3,)
        Its ends; soundings count from the lower one.
    """

    bottom_m: np.ndarray
    top_m: np.ndarray

    @property
    def length_m(self):
        """Distance of its ends."""
        return float(np.linalg.norm(self.top_m - self.bottom_m))

    @property
    def direction(self):
        """(3,) unit vector from the lower end to the upper."""
        return (self.top_m - self.bottom_m) / self.length_m

    def rise(self, trim=0.0, list_=0.0):
        """How much the surface rises at the pipe's axis for each metre of sounding.

        The same as the cosine of the pipe's lean where the ship is at even keel; a pipe with none
        of it, or less, cannot be sounded.
        """
        return float(self.direction @ (trim, list_, 1.0))


def in_ship_frame(xyz_m, bow_azimuth_rad):
    """(n, 3) coordinates with x towards the bow and y to port, of a frame whose bow lies elsewhere.

    Parameters
    ----------
    xyz_m : ndarray, shape (n, 3)
        z up.
    bow_azimuth_rad : float
        Direction of the bow there, clockwise from +y; a right angle leaves all as it is.

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
    """A mesh at one trim and list; levels are soundings along its pipe. Make one by `piped_mesh`.

    Attributes
    ----------
    pipe : Pipe
    trim, list_ : float
        Tangents: by the stern and to starboard are positive.
    sheared : MeshPart
        The mesh under z', whose level 0 is that of the pipe's lower end.
    corners_xy_m : ndarray, shape (m, 3, 2)
        x, y of the corners from the pipe's lower end, in the order of the corners of `sheared`.
    contracted : float or None
        Lengths of this mesh over those that were measured, by a uniform contraction; None: none
        was given.
    marks_m : float
        Distance that the input "trim" is read over, the tangent times it.
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
        """Rise of the surface at the pipe for each metre of sounding."""
        return self.pipe.rise(self.trim, self.list_)

    @property
    def face_count(self):
        """Number of triangles."""
        return self.sheared.face_count

    @property
    def top_m(self):
        """The sounding at which the tank becomes full."""
        return self.sheared.top_m / self.rise

    @cached_property
    def capacity_m3(self):
        """Volume of the full tank."""
        return self.sheared.capacity_m3

    @cached_property
    def dry_m3(self):
        """What the tank holds when the pipe has just become dry."""
        return float(self.volume_m3([0.0])[0])

    def volume_m3(self, levels_m):
        """(rows,) volume at each sounding; HeightError above the full tank."""
        return self.sheared.volume_m3(self._heights(levels_m))

    def area_m2(self, levels_m):
        """(rows,) derivative of the volume by the sounding."""
        return self.rise * self.sheared.area_m2(self._heights(levels_m))

    def derivatives(self, levels_m):
        """{input: (rows,)} derivative of the volume at a fixed sounding, all else fixed.

        scale      of all coordinates, those of the pipe too, but not of the soundings
        surface    an outward offset of the surface along its normal, m: the wetted area
        datum      of the pipe's zero along the pipe, m
        trim, list  draught aft less draught forward, m, and the angle, rad: by the tangents it is
                   A s u_x - moment of the free surface by x, and so by y
        pipe_x, pipe_y  place of the whole pipe, m
        pipe_lean  (rows, 2) of the pipe about its lower end, m/m, fore and aft and athwart
        contraction  of the share that all lengths are contracted by, where one was given
        """
        soundings, heights = as_levels(levels_m), self._heights(levels_m)
        volume = self.sheared.volume_m3(heights)
        area, *moment = self._moments(heights).T
        u, rise = self.pipe.direction, self.rise
        scale = 3 * volume - heights * area
        lean = (soundings * area)[:, None] * (np.array([self.trim, self.list_]) - rise * u[:2])
        found = {
            "scale": scale,
            "surface": self.sheared.wetted_m2(heights),
            "datum": rise * area,
            "trim": (soundings * u[0] * area - moment[0]) / self.marks_m,
            "list": (1 + self.list_**2) * (soundings * u[1] * area - moment[1]),
            "pipe_x": self.trim * area,
            "pipe_y": self.list_ * area,
            "pipe_lean": lean,
        }
        if self.contracted is not None:
            found["contraction"] = -scale / self.contracted
        return found

    def _heights(self, levels_m):
        return self.rise * as_levels(levels_m)

    def _moments(self, heights):
        """(rows, 3) area of the free surface, its moments by x and y about the pipe's lower end."""
        part = self.sheared
        at = heights + part.zero_m
        values = np.concatenate(
            [np.ones_like(self.corners_xy_m[..., :1]), self.corners_xy_m], axis=2
        )
        moments = moments_below(part.corners_m, values, -part.plan_m2, at)
        full = at >= part.height_m
        if full.any():  # as `MeshPart.area_m2` has it: the surface just below the top
            top = [part.height_m]
            moments[full] = moments_below(part.corners_m, values, -part.plan_m2, top, "right")
        return moments


def piped_mesh(mesh, pipe, trim=0.0, list_=0.0, *, scale=1.0, contracted=None, marks_m=1.0):
    """The `PipedMesh` of a `meshes.Mesh` in the ship's frame.

    Parameters
    ----------
    mesh : Mesh
        Bow towards +x, port towards +y (`in_ship_frame`).
    pipe : Pipe
        In the same frame, as measured.
    trim, list_ : float
        Tangents.
    scale : float
        Of all lengths, by temperature and contraction.
    contracted : float or None
        The part of the scale that a uniform contraction has.
    marks_m : float
        Between the draught marks.

    Returns
    -------
    PipedMesh

    References
    ----------
    Closed form: a shear along z keeps volumes and plans; sums over triangles as in `meshes.part`.

    Examples
    --------
    A box of 4 x 2 x 3 m whose pipe stands in its starboard corner aft, 2 cm of trim in each metre:

    >>> from tankcal.tank.meshes import closed_mesh
    >>> import trimesh
    >>> box = trimesh.creation.box((4.0, 2.0, 3.0))
    >>> pipe = Pipe(np.array([-2.0, -1.0, -1.5]), np.array([-2.0, -1.0, 2.0]))
    >>> tank = piped_mesh(closed_mesh(box.vertices, box.faces), pipe, trim=0.02)
    >>> tank.volume_m3([1.04]).round(9).tolist()
    [8.0]
    """
    local = scale * (mesh.vertices_m - pipe.bottom_m)
    sheared = local.copy()
    sheared[:, 2] += local[:, :2] @ (trim, list_)
    part = mesh_part(Mesh(sheared, mesh.faces, mesh.bodies, mesh.notes), 0.0)
    own_m2 = np.sqrt(np.sum(normals_of(local, mesh.faces) ** 2, axis=1)) / 2
    order = np.argsort(sheared[mesh.faces, 2], axis=1, kind="stable")
    corners = np.take_along_axis(mesh.faces, order, axis=1)
    ends = (scale * (end - pipe.bottom_m) for end in (pipe.bottom_m, pipe.top_m))
    return PipedMesh(
        Pipe(*ends),
        float(trim),
        float(list_),
        replace(part, surface_m2=own_m2),
        local[corners, :2],
        contracted,
        marks_m,
    )
