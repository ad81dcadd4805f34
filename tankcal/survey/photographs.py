"""Photographs of a survey: which take part, and what is known of where they were taken."""

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.geometry.rotations import rotation_of_angles
from tankcal.messages import message
from tankcal.survey.network import Photos
from tankcal.survey.observations import PhotoOrientation, PhotoRotation, Source

ELEMENTS = ("x", "y", "z", "omega", "phi", "kappa")
TURNS = ("about x", "about y", "about z")  # of the image, away from the rotation that was given
FEWEST = 3  # image points of a photo


def gathered_photos(measurements):
    """network.Photos (values that are not known: nan), cameras, and {name: number} of photos.

    None, () and {} without photographs. Photos without image points are left out.
    """
    images = measurements.image_points
    if images is None or not len(images.photo):
        return None, (), {}
    seen = {}
    for photo, point, check in zip(images.photo, images.point, images.check, strict=True):
        if not check:
            seen.setdefault(photo, set()).add(point)
    photos = [one for one in measurements.photos if one.name in seen]
    _refuse_poor(photos, seen)
    cameras = {}
    for one in photos:
        cameras.setdefault(one.camera, len(cameras))
    settings = {one.camera.name: one.camera for one in measurements.cameras}
    values = np.array([one.values for one in photos], dtype=float)
    fixed = np.array([one.sd for one in photos]) == 0
    found = Photos(
        names=tuple(one.name for one in photos),
        camera=np.array([cameras[one.camera] for one in photos], dtype=int),
        xyz_m=values[:, :3],
        rotation=rotation_of_angles(*values[:, 3:].T),
        fixed=np.column_stack([fixed[:, :3], fixed[:, 3:].all(axis=1)]),
    )
    order = {one.name: number for number, one in enumerate(photos)}
    return found, tuple(settings[name] for name in cameras), order


def _refuse_poor(photos, seen):
    """Raise when photos have too few points, all of them at once."""
    poor = [
        Problem(
            "photos.csv",
            message(
                "photo_hardly_seen",
                "photo {name} has {count} image points; at least {fewest} are needed, or all six "
                "elements of its orientation with standard deviations",
                name=one.name,
                count=len(seen[one.name]),
                fewest=FEWEST,
            ),
            one.row,
        )
        for one in photos
        if len(seen[one.name]) < FEWEST and not np.isfinite(one.sd).all()
    ]
    if poor:
        raise InputError(poor)


def orientation_of(measurements, order):
    """Observations of the elements of orientation known beforehand, a list.

    Fixed coordinates and fixed rotations are not among them: these are no unknowns.
    """
    photos = [one for one in measurements.photos if one.name in order]
    single, whole = [], []
    for one in photos:
        sd = np.asarray(one.sd, dtype=float)
        rotation = np.isfinite(sd[3:]) & (sd[3:] > 0)
        for element in np.flatnonzero(np.isfinite(sd) & (sd > 0)):
            if element < 3 or not rotation.all():
                single.append((one, int(element)))
        if not rotation.all() and not (sd[3:] == 0).all():
            single += [(one, int(3 + element)) for element in np.flatnonzero(sd[3:] == 0)]
        if rotation.all():
            whole.append(one)
    found = [_single(single, order)] if single else []
    return [*found, _whole(whole, order)] if whole else found


def _single(single, order):
    value = np.array([one.values[element] for one, element in single])
    sd = np.array([one.sd[element] for one, element in single])
    photo = np.array([order[one.name] for one, _ in single])
    element = np.array([element for _, element in single])
    trace = _trace([one for one, _ in single], [(ELEMENTS[e],) for e in element])
    return PhotoOrientation(value, sd, photo, element, trace=trace)


def _whole(photos, order):
    angles = np.array([one.values[3:] for one in photos], dtype=float)
    sd = np.array([one.sd[3:] for one in photos], dtype=float)
    photo = np.array([order[one.name] for one in photos])
    trace = _trace(photos, [TURNS] * len(photos))
    known = rotation_of_angles(*angles.T)
    return PhotoRotation(np.zeros((len(photos), 3)), sd, photo, known, trace=trace)


def _trace(photos, elements):
    names = tuple((one.name,) for one in photos)
    return Source("photos.csv", tuple(one.row for one in photos), names, tuple(elements)).trace()
