"""The adjustment of a survey on paper: its sentences, tables and figures (docs/report.md).

Every function takes a Paper and gives blocks, texts or a figure; nothing here computes a number.
"""
