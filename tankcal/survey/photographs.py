"""Photographs of a survey: those adjusted, and the prior information on their orientation."""

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.geometry.rotations import rotation_of_angles
from tankcal.messages import message
from tankcal.survey.network import Photos
from tankcal.survey.observations import PhotoOrientation, PhotoRotation, Source

ELEMENTS = ("x", "y", "z", "omega", "phi", "kappa")
TURNS = ("about x", "about y", "about z")  # rotations of the image relative to the given rotation
FEWEST = 3  # image points required in a photo


def gathered_photos(measurements):
    """Collect the photos with image points.

    Returns
    -------
    photos : network.Photos or None
        Unknown values are nan; None without photographs.
    cameras : tuple of network.Camera
    order : dict
        {name: number} of the photos.

    Raises
    ------
    InputError
        If photos have too few image points.
    """
    images = measurements.image_points
    if images is None or not len(images.photo):
        return None, (), {}
    points_of_photo = {}
    for photo, point, check in zip(images.photo, images.point, images.check, strict=True):
        if not check:
            points_of_photo.setdefault(photo, set()).add(point)
    photos = [item for item in measurements.photos if item.name in points_of_photo]
    _refuse_poor(photos, points_of_photo)
    # Number the cameras in the order of their first photo; unused cameras are left out.
    cameras = {}
    for item in photos:
        cameras.setdefault(item.camera, len(cameras))
    settings = {item.camera.name: item.camera for item in measurements.cameras}
    values = np.array([item.values for item in photos], dtype=float)
    fixed = np.array([item.sd for item in photos]) == 0
    result = Photos(
        names=tuple(item.name for item in photos),
        camera=np.array([cameras[item.camera] for item in photos], dtype=int),
        xyz_m=values[:, :3],
        rotation=rotation_of_angles(*values[:, 3:].T),
        fixed=np.column_stack([fixed[:, :3], fixed[:, 3:].all(axis=1)]),
    )
    order = {item.name: number for number, item in enumerate(photos)}
    return result, tuple(settings[name] for name in cameras), order


def _refuse_poor(photos, points_of_photo):
    """Raise InputError listing all photos with too few image points."""
    poor = [
        Problem(
            "photos.csv",
            message(
                "photo_hardly_seen",
                "photo {name} has {count} image points; at least {fewest} are needed, or all six "
                "elements of its orientation with standard deviations",
                name=photo.name,
                count=len(points_of_photo[photo.name]),
                fewest=FEWEST,
            ),
            photo.row,
        )
        for photo in photos
        if len(points_of_photo[photo.name]) < FEWEST and not np.isfinite(photo.sd).all()
    ]
    if poor:
        raise InputError(poor)


def orientation_of(measurements, order):
    """Return observations of the elements of orientation known a priori.

    Fixed coordinates and fixed rotations are not unknowns, so they are not observed.

    Parameters
    ----------
    measurements : Measurements
    order : dict
        {name: number} of the adjusted photos.

    Returns
    -------
    list of Observations
    """
    photos = [photo for photo in measurements.photos if photo.name in order]
    single, whole = [], []
    for photo in photos:
        sd = np.asarray(photo.sd, dtype=float)
        rotation = np.isfinite(sd[3:]) & (sd[3:] > 0)
        for element in np.flatnonzero(np.isfinite(sd) & (sd > 0)):
            # A rotation with three standard deviations is observed as a whole, below.
            if element < 3 or not rotation.all():
                single.append((photo, int(element)))
        # A rotation is fixed only as a whole. Single fixed angles enter as observations with sd 0.
        if not rotation.all() and not (sd[3:] == 0).all():
            single += [(photo, int(3 + element)) for element in np.flatnonzero(sd[3:] == 0)]
        if rotation.all():
            whole.append(photo)
    observations = [_single(single, order)] if single else []
    return [*observations, _whole(whole, order)] if whole else observations


def _single(single, order):
    """PhotoOrientation of single elements."""
    value = np.array([photo_of_row.values[element] for photo_of_row, element in single])
    sd = np.array([photo_of_row.sd[element] for photo_of_row, element in single])
    photo = np.array([order[photo_of_row.name] for photo_of_row, _ in single])
    element = np.array([element for _, element in single])
    trace = _trace([photo_of_row for photo_of_row, _ in single], [(ELEMENTS[e],) for e in element])
    return PhotoOrientation(value, sd, photo, element, trace=trace)


def _whole(photos, order):
    """PhotoRotation of photos whose three angles have standard deviations."""
    angles = np.array([item.values[3:] for item in photos], dtype=float)
    sd = np.array([item.sd[3:] for item in photos], dtype=float)
    photo = np.array([order[item.name] for item in photos])
    trace = _trace(photos, [TURNS] * len(photos))
    known = rotation_of_angles(*angles.T)
    # The observed small rotation relative to the given rotation is zero.
    return PhotoRotation(np.zeros((len(photos), 3)), sd, photo, known, trace=trace)


def _trace(photos, elements):
    names = tuple((photo.name,) for photo in photos)
    return Source(
        "photos.csv", tuple(photo.row for photo in photos), names, tuple(elements)
    ).trace()
