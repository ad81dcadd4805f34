"""What an analysis was made from: version, files with their SHA-256, the notice of the job."""

import hashlib
from pathlib import Path

import tankcal


def made_from(paths=(), job=None):
    """{"version", "notice", "files": [{file, sha256}]} of files that were read, and of a job."""
    files = [] if job is None else [{"file": f.file, "sha256": f.sha256} for f in job.files]
    for path in map(Path, paths):
        path = path / "cameras.toml" if path.is_dir() else path
        files.append({"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()})
    notice = "" if job is None else str(job.certificate.get("notice", ""))
    return {"version": tankcal.__version__, "notice": notice, "files": files}
