"""nbconvert exporters: `jupyter nbconvert --to tankcal-pdf report.ipynb`, and tankcal-html.

They typeset an executed notebook without its input cells. `--PdfExporter.part=certificate` selects
a single part.
"""

from nbconvert.exporters import Exporter
from traitlets import Unicode, default

from tankcal.report.document import blocks_of
from tankcal.report.pdf import pdf
from tankcal.report.web import page


class _BlocksExporter(Exporter):
    """Common base of the exporters: conversion of the selected part into blocks."""

    part = Unicode(
        "", help='Which part: "certificate", "working-papers", "field-table", or "" for the whole.'
    ).tag(config=True)

    def _blocks(self, notebook, resources):
        return blocks_of(notebook, self.part, _metadata(resources).get("name") or "notebook")


def _metadata(resources):
    return (resources or {}).get("metadata", {})


class PdfExporter(_BlocksExporter):
    """Exporter of a notebook to PDF/A-3a and PDF/UA-1, typeset by typst."""

    export_from_notebook = "tankcal PDF"
    output_mimetype = "application/pdf"

    @default("file_extension")
    def _file_extension_default(self):
        return ".pdf"

    def from_notebook_node(self, nb, resources=None, **kwargs):
        notebook, resources = super().from_notebook_node(nb, resources, **kwargs)
        folder = _metadata(resources).get("path") or "."
        return pdf(self._blocks(notebook, resources), folder), resources


class HtmlExporter(_BlocksExporter):
    """Exporter of a notebook to an HTML page that needs neither network nor scripts."""

    export_from_notebook = "tankcal HTML"
    output_mimetype = "text/html"

    @default("file_extension")
    def _file_extension_default(self):
        return ".html"

    def from_notebook_node(self, nb, resources=None, **kwargs):
        notebook, resources = super().from_notebook_node(nb, resources, **kwargs)
        return page(self._blocks(notebook, resources)), resources
