"""Write tank.off: a made-up wing tank with a hopper, starboard, whose forward end is narrower.

    python examples/ship/make_mesh.py

The ship's frame: x towards the bow, y to port, z up; the origin midships on the base line.
"""

from pathlib import Path

AFT = ((-11.0, 2.5), (-9.0, 0.0), (-3.0, 0.0), (-3.0, 9.0), (-11.0, 9.0))  # y, z of the section
FORWARD = ((-10.0, 3.0), (-8.0, 0.4), (-3.0, 0.4), (-3.0, 9.0), (-10.0, 9.0))
ENDS_M = -20.0, 4.0  # x of both sections


def corners_and_faces():
    """Corners (x, y, z) and triangles whose corners run anticlockwise seen from outside."""
    corners = [
        (x, *yz) for x, section in zip(ENDS_M, (AFT, FORWARD), strict=True) for yz in section
    ]
    count = len(AFT)
    faces = [(0, i + 1, i) for i in range(1, count - 1)]
    faces += [(count, count + i, count + i + 1) for i in range(1, count - 1)]
    for i in range(count):
        j = (i + 1) % count
        faces += [(i, j, count + j), (i, count + j, count + i)]
    return corners, faces


def write(path):
    corners, faces = corners_and_faces()
    lines = ["OFF", f"{len(corners)} {len(faces)} 0"]
    lines += [" ".join(f"{value:g}" for value in corner) for corner in corners]
    lines += ["3 " + " ".join(map(str, face)) for face in faces]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    write(Path(__file__).with_name("tank.off"))
