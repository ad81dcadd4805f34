"""Try an app without its sources: pages, an example, its computation, and the certificate.

python installers/try_app.py PROGRAM
"""

import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "support"))

from app_visitors import Visitor, serve_app  # noqa: E402


def main(program):
    """Start the app, compute the example in it, and end it by Ctrl-C."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        with serve_app([program], folder) as (process, address):
            visitor = Visitor(address)
            assert "<main" in visitor.home, visitor.home
            job = visitor.open_example()
            for page in ("", "table/points", "problems"):
                assert "<main" in visitor.get(job + page), page
            assert "1249" in visitor.compute(job, documents=True)
            assert visitor.get(f"{job}file/certificate.pdf").startswith("%PDF")
        assert process.returncode == 0, process.returncode
    print(f"{program}: the app showed its pages and computed the example")


if __name__ == "__main__":
    main(sys.argv[1])
