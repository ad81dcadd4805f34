"""The picture in the README: pages of the example's report side by side (`make picture`)."""

import sys
from pathlib import Path

from PIL import Image

PAGES = (1, 2, 8, 9)
SHADE, GAP = (200, 200, 200), 12


def main(folder, target):
    """Put folder/page-NN.png of PAGES beside each other into one PNG."""
    pages = [Image.open(Path(folder) / f"page-{number:02d}.png") for number in PAGES]
    width = sum(page.width + GAP for page in pages) + GAP
    sheet = Image.new("RGB", (width, pages[0].height + 2 * GAP), SHADE)
    left = GAP
    for page in pages:
        sheet.paste(page, (left, GAP))
        left += page.width + GAP
    Path(target).parent.mkdir(parents=True, exist_ok=True)
    sheet.quantize(64).save(target, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
