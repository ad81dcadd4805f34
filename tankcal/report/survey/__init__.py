"""The adjustment of a survey in the papers: sentences, tables and figures (docs/report.md).

The functions take a Paper and return blocks, texts or a figure. They compute no number.
"""
