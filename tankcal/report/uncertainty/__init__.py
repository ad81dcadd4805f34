"""Uncertainty in the papers: stated U, budgets, deliveries, Monte Carlo, the decision rule.

The functions take a Paper and return rows, texts, blocks or a figure from the record. The workbook
uses these functions as well. Values that records of earlier versions lack are omitted.
"""
