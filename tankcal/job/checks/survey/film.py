"""film.csv: the form of the film of a camera or a photo."""

import numpy as np

from tankcal.job.checks.common import has_rows
from tankcal.job.checks.survey.files import refuse_undefined, tell_rows
from tankcal.job.imagery import is_surface, surfaces_of
from tankcal.messages import message

FLAT_UM = 0.5  # a film whose heights are all below it: in millimetres?


def check_film(files, imagery):
    """Each film belongs to one camera or photo, and is a surface."""
    table = files.tables["film"]
    if not has_rows(table):
        return
    sound = files.sound(table)
    has = {
        name: np.array([value is not None for value in table.of(name)], dtype=bool)
        for name in ("camera", "photo")
    }
    for is_told, expected in (
        (
            has["camera"] & has["photo"],
            message("film_of_both", "camera and photo both given; expected one of them"),
        ),
        (
            ~has["camera"] & ~has["photo"],
            message("film_of_none", "blank; expected a camera, or a photo"),
        ),
    ):
        tell_rows(files.log.problem, table, sound & is_told, "camera", expected)
    refuse_undefined(files, table, "camera", files.registers["cameras"], "cameras")
    photos = files.tables["photos"]
    defined = () if photos is None else dict.fromkeys(photos.of("photo"))
    refuse_undefined(files, table, "photo", defined, "photos")
    for (kind, name), (surface, row) in surfaces_of(table).items():
        if not is_surface(surface):
            expected = message(
                "film_without_surface",
                "the {count} places of the film of {of_kind} {name!r} make no surface; expected "
                "3 or more, each once, not on one line",
                count=len(surface.xy_mm),
                of_kind=kind,
                name=name,
            )
            files.log.problem(table.file, expected, row, "x_mm")
        elif 0 < np.abs(surface.height_mm).max() * 1000 < FLAT_UM:
            expected = message(
                "film_flat",
                "all heights of the film of {name!r} are below {limit_um:g} um: in millimetres?",
                name=name,
                limit_um=FLAT_UM,
            )
            files.log.warning(table.file, expected, row, "height_um")
    for (_, name), (beyond, count) in imagery.outside.items():
        if beyond:
            expected = message(
                "beyond_film",
                "{beyond} of {count} image points of {name!r} lie outside the places of its film:"
                " the height of the nearest is taken",
                beyond=beyond,
                count=count,
                name=name,
            )
            files.log.warning(table.file, expected)
