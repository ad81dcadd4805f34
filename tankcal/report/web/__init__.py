"""Conversion of blocks to HTML, for Jupyter and for an offline web page with scripts."""

from tankcal.report.web.elements import block_html
from tankcal.report.web.offline import page

__all__ = ["block_html", "page"]
