"""How the pages of a PDF are filled, from the places of its words (poppler's pdftotext).

pages = pages_of(path)                 Line(text, top, bottom) of the body of each page
filled(page)                           share of the body above the end of its last line
sparse_pages(pages)                    numbers of pages but the last that are nearly empty
lone_headings(pages, headings)         (page, heading) that end a page
"""

import re
import shutil
import subprocess
from html import unescape
from typing import NamedTuple

import pytest

TOP, BOTTOM = 85.0, 779.5  # of the body, points: the margins of page.typ
LEAST_FILLED = 0.25
_SAME_LINE = 2.0
_WORD = re.compile(
    r'<word xMin="[\d.]+" yMin="([\d.]+)" xMax="[\d.]+" yMax="([\d.]+)">(.*?)</word>'
)


class Line(NamedTuple):
    """Words that end at one height, in points from the top of the page."""

    text: str
    top: float
    bottom: float


def pages_of(path):
    """The lines of the body of each page; skips the test where poppler is not there."""
    if not shutil.which("pdftotext"):
        pytest.skip("pdftotext (poppler) is not on this machine")
    command = ["pdftotext", "-bbox", str(path), "-"]
    said = subprocess.run(command, capture_output=True, check=True, encoding="utf-8").stdout
    return [_lines(page) for page in said.split("<page ")[1:]]


def _lines(page):
    found = []
    for top, bottom, word in _WORD.findall(page):
        top, bottom, word = float(top), float(bottom), unescape(word)
        if top < TOP - 2 or bottom > BOTTOM + 4:
            continue  # running head and foot
        if found and abs(found[-1].bottom - bottom) < _SAME_LINE:
            last = found.pop()
            found.append(Line(f"{last.text} {word}", min(last.top, top), max(last.bottom, bottom)))
        else:
            found.append(Line(word, top, bottom))
    return found


def filled(page):
    """Share of the body of a page above the end of its lowest line."""
    lowest = max((line.bottom for line in page), default=TOP)
    return (lowest - TOP) / (BOTTOM - TOP)


def sparse_pages(pages, least=LEAST_FILLED):
    """Numbers, from 1, of the pages but the last that are filled to less than `least`."""
    return [number for number, page in enumerate(pages[:-1], 1) if filled(page) < least]


def lone_headings(pages, headings):
    """(page, heading) of each heading below which its page has nothing."""
    found = []
    for number, page in enumerate(pages, 1):
        if page:
            last = max(page, key=lambda line: line.bottom)
            found += [(number, last.text)] if last.text in headings else []
    return found
