"""Blocks as HTML: inside Jupyter, and as one offline page with its own small scripts."""

from tankcal.report.web.elements import block_html
from tankcal.report.web.offline import page

__all__ = ["block_html", "page"]
