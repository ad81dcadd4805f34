"""The file of a mesh, which lies beside job.toml or beside the workbook; it is not parsed here."""

import hashlib

from tankcal.job.tables import read_bytes

MAX_MESH_BYTES = 200_000_000


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
        log.problem(name, "missing file; expected the mesh of mesh.file beside the job")
        return None
    data = read_bytes(path, log, MAX_MESH_BYTES)
    if data is None:
        return None
    if not data.strip():
        log.problem(name, "empty; expected a closed mesh")
        return None
    return (name, hashlib.sha256(data).hexdigest(), len(data)), data
