"""What lies beside job.toml or the workbook; the file of a mesh is not parsed here."""

from dataclasses import dataclass

import numpy as np

from tankcal.job.tables import fingerprint, read_bytes
from tankcal.messages import message
from tankcal.tank.rules.model import Rule

MAX_MESH_BYTES = 200_000_000


@dataclass(frozen=True)
class Attached:
    """What a job has beside its settings and tables; None: not there.

    covariance_m2  (3n, 3n) of its points
    mesh           ((name, SHA-256, size), bytes)
    rule           (Rule, (name, SHA-256, size) of its file, or None: it ships with tankcal)
    """

    covariance_m2: np.ndarray | None
    mesh: tuple | None
    rule: tuple[Rule, tuple | None] | None

    @property
    def files(self):
        """(name, SHA-256, size) of each file that was read for it."""
        given = (self.mesh and self.mesh[0], self.rule and self.rule[1])
        return tuple(file for file in given if file)


def read_mesh_file(folder, name, log):
    """((name, SHA-256, size), bytes) of the file, or None after telling `log` what is wrong.

    folder  Path that the job lies in; name  as checked by the field mesh.file: no path
    """
    path = folder / name
    try:
        exists = path.exists()
    except (OSError, ValueError):
        exists = False
    if not exists:
        log.problem(
            name,
            message(
                "missing_mesh_file", "missing file; expected the mesh of mesh.file beside the job"
            ),
        )
        return None
    data = read_bytes(path, log, MAX_MESH_BYTES)
    if data is None:
        return None
    if not data.strip():
        log.problem(name, message("empty_mesh_file", "empty; expected a closed mesh"))
        return None
    return fingerprint(name, data), data
