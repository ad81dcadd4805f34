"""Image coordinates as they were read become photo coordinates: comparator, pixels, film.

In this order: repeated readings of marks are rejected where they scatter too much; the others make
the transformation of their photo; image points go through it; then the film is made flat.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.camera.comparator import repeats, transformation
from tankcal.camera.film import Surface, flatten_film, heights_at
from tankcal.errors import SolutionError
from tankcal.job.cameras import image_coordinates, image_frames
from tankcal.job.contract.registers import MARKS
from tankcal.messages import message
from tankcal.survey.measurements import FiducialFit, RejectedReadings

FEWEST_HEIGHTS = 3
FLAT = 1e-6  # of the extent of the places of a film: nearer to one line they are no surface


@dataclass(frozen=True)
class Imagery:
    """The rows of image_points in the photo system.

    xy_mm         (n, 2), nan where it cannot be told     sd_mm  (n, 2) of the readings
    shared_sd_mm  (n, 2) of the transformations, or None
    fits          {photo: FiducialFit}
    outside       {owner of a film: (image points outside its hull, all of them)}
    """

    xy_mm: np.ndarray
    sd_mm: np.ndarray
    shared_sd_mm: np.ndarray | None = None
    fits: dict = field(default_factory=dict)
    outside: dict = field(default_factory=dict)


def imagery_of(tables, cameras, adjustment):
    """The Imagery of the tables of a survey; what is not sound in them is left out.

    tables  {name: ColumnValues or None}       cameras  {name: {key: value}}
    adjustment  {key: value} of [adjustment], or None
    """
    images, photos = tables["image_points"], tables["photos"]
    size, pixel = image_frames(images, photos, cameras)
    xy = image_coordinates(images, size, pixel)
    sd = np.column_stack([images.numbers("sx_um"), images.numbers("sy_um")]) / 1000
    sd = np.where(np.isnan(sd), images.numbers("s_px")[:, None] * pixel, sd)
    found = Imagery(xy, sd)
    if photos is None:
        return found
    if tables["fiducials"] is not None:
        found = _transformed(found, tables, cameras, adjustment or {})
    if tables["film"] is not None:
        found = _flattened(found, tables, cameras)
    return found


def cameras_of_photos(photos, cameras):
    """{photo: (name of its camera, {key: value} of it)} of photos whose camera is known."""
    rows = zip(photos.of("photo"), photos.of("camera"), strict=True)
    return {photo: (name, cameras[name]) for photo, name in rows if photo and name in cameras}


def _transformed(found, tables, cameras, adjustment):
    images = tables["image_points"]
    default = (adjustment.get("image_sd_um") or np.nan) / 1000
    fits = fiducial_fits(tables["fiducials"], tables["photos"], cameras, adjustment)
    xy, sd, shared = found.xy_mm.copy(), found.sd_mm.copy(), np.zeros_like(found.xy_mm)
    read, points_of = set(tables["fiducials"].of("photo")), images.of("point")
    for photo, mine in rows_by(images.of("photo")).items():
        if photo not in read:
            continue
        if photo not in fits:
            xy[mine] = np.nan
            continue
        fit = fits[photo].transformation
        points = [points_of[i] for i in mine.tolist()]
        readings, own = xy[mine], fit.turned(np.where(np.isnan(sd[mine]), default, sd[mine]))
        added = np.einsum("nii->ni", fit.added_covariance(readings))
        same = repeats(points, readings)
        variance = own**2 / same.count[same.group][:, None]
        growth = np.sqrt(1 + added / variance)
        xy[mine], sd[mine], shared[mine] = fit.of(readings), own, np.sqrt(added)
        if np.isfinite(growth).any():
            fits[photo] = replace(fits[photo], growth=float(np.nanmax(growth)))
    return replace(found, xy_mm=xy, sd_mm=sd, shared_sd_mm=shared, fits=fits)


def rows_by(names):
    """{name: (n,) places of its rows}, without None."""
    found = {}
    for place, name in enumerate(names):
        if name is not None:
            found.setdefault(name, []).append(place)
    return {name: np.array(places) for name, places in found.items()}


def fiducial_fits(table, photos, cameras, adjustment):
    """{photo: FiducialFit}; photos whose marks do not determine a transformation are left out."""
    of_photos, fits = cameras_of_photos(photos, cameras), {}
    for photo, readings in readings_of_marks(table, of_photos, adjustment).items():
        try:
            fits[photo] = readings.fit(photo, of_photos[photo][0])
        except SolutionError:
            continue
    return fits


def readings_of_marks(table, of_photos, adjustment):
    """{photo: MarkReadings} of the photos in fiducials.csv whose camera is known.

    of_photos  see `cameras_of_photos`; a reading without any sd is left out
    """
    default = adjustment.get("image_sd_um") or np.nan
    limit = adjustment.get("reading_limit_um")
    xy = np.column_stack([table.numbers("x_mm"), table.numbers("y_mm")])
    sd = table.numbers("s_um")
    sd = np.where(np.isnan(sd), default, sd) / 1000
    sound = np.isfinite(xy).all(axis=1) & np.isfinite(sd)
    found, marks = {}, table.of("mark")
    for photo, rows in rows_by(table.of("photo")).items():
        if photo not in of_photos:
            continue
        given = of_photos[photo][1]
        known = {mark: place for mark, place in given[MARKS].items() if len(place) == 2}
        rows = np.array([i for i in rows.tolist() if sound[i] and marks[i] in known], dtype=int)
        names = tuple(marks[i] for i in rows)
        places = np.array([known[name] for name in names]).reshape(-1, 2)
        kind = given["fiducial_transformation"] or "affine"
        read = MarkReadings(rows, names, xy[rows], places, sd[rows], kind)
        found[photo] = read.within(None if limit is None else limit / 1000, photo, table.rows)
    return found


@dataclass(frozen=True)
class MarkReadings:
    """The readings of the marks of one photo that can be used, (n,) in the order of their rows.

    rows      (n,) places in the table     xy_mm     (n, 2)
    names     (n,) marks                   marks_mm  (n, 2) calibrated
    sd_mm     (n,)                         kind      of the transformation
    rejected  tuple of RejectedReadings
    """

    rows: np.ndarray
    names: tuple
    xy_mm: np.ndarray
    marks_mm: np.ndarray
    sd_mm: np.ndarray
    kind: str
    rejected: tuple = ()

    def within(self, limit_mm, photo, numbers):
        """Those of marks whose readings scatter no more than a limit; the others as `rejected`.

        numbers  row of the file of each place in the table
        """
        same = self.repeats
        bad = same.beyond(limit_mm)
        rejected = tuple(
            RejectedReadings(
                photo,
                self.names[same.first[i]],
                int(same.count[i]),
                same.sd[i],
                numbers[self.rows[same.first[i]]],
            )
            for i in np.flatnonzero(bad)
        )
        kept = np.flatnonzero(~bad[same.group])
        return MarkReadings(
            self.rows[kept],
            tuple(self.names[i] for i in kept),
            self.xy_mm[kept],
            self.marks_mm[kept],
            self.sd_mm[kept],
            self.kind,
            rejected,
        )

    @property
    def repeats(self):
        """The comparator.Repeats of the marks."""
        return repeats(self.names, self.xy_mm)

    def fit(self, photo, camera):
        """The FiducialFit; raises SolutionError where the marks do not determine it."""
        same = self.repeats
        if not len(self.rows):
            raise SolutionError(message("no_marks", "no marks"))
        found = transformation(self.xy_mm, self.marks_mm, self.sd_mm[:, None], self.kind)
        calibrated = self.marks_mm[same.first]
        return FiducialFit(
            photo=photo,
            camera=camera,
            marks=tuple(self.names[i] for i in same.first),
            calibrated_mm=calibrated,
            count=same.count,
            mean_mm=same.mean,
            sd_mm=same.sd,
            residual_mm=found.of(same.mean) - calibrated,
            transformation=found,
            rejected=self.rejected,
        )


def surfaces_of(table):
    """{("camera" or "photo", name): (Surface, first row)} of film.csv, sound or not."""
    xy = np.column_stack([table.numbers("x_mm"), table.numbers("y_mm")])
    height = table.numbers("height_um") / 1000
    owners = {}
    for i, (camera, photo) in enumerate(zip(table.of("camera"), table.of("photo"), strict=True)):
        if (camera is None) != (photo is None) and np.isfinite([*xy[i], height[i]]).all():
            owner = ("camera", camera) if photo is None else ("photo", photo)
            owners.setdefault(owner, []).append(i)
    return {
        owner: (Surface(xy[rows], height[rows]), table.rows[rows[0]])
        for owner, rows in owners.items()
    }


def is_surface(surface):
    """Three places or more, not on one line, each of them once."""
    xy = surface.xy_mm
    if len(xy) < FEWEST_HEIGHTS or len(np.unique(xy, axis=0)) < len(xy):
        return False
    spread = np.linalg.svd(xy - xy.mean(axis=0), compute_uv=False)
    return bool(spread[1] > FLAT * spread[0])


def _flattened(found, tables, cameras):
    """The Imagery on the plane of the photo system; a photo's own film before its camera's."""
    surfaces = {
        owner: surface for owner, (surface, _) in surfaces_of(tables["film"]).items()
        if is_surface(surface)
    }  # fmt: skip
    xy, outside = found.xy_mm.copy(), {}
    rows = rows_by(tables["image_points"].of("photo"))
    for photo, (camera, given) in cameras_of_photos(tables["photos"], cameras).items():
        owner = ("photo", photo) if ("photo", photo) in surfaces else ("camera", camera)
        if owner not in surfaces or given["c_mm"] is None or photo not in rows:
            continue
        mine = rows[photo]
        height, beyond = heights_at(surfaces[owner], xy[mine])
        interior = (given["c_mm"], given["x0_mm"] or 0.0, given["y0_mm"] or 0.0)
        xy[mine] = flatten_film(xy[mine], height, interior)
        so_far = outside.get(owner, (0, 0))
        outside[owner] = (so_far[0] + int(beyond.sum()), so_far[1] + len(mine))
    return replace(found, xy_mm=xy, outside=outside)
