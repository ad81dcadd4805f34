"""Uncertainty on paper: what is stated, budgets, deliveries, Monte Carlo, the decision rule.

Every function takes a Paper and gives rows, texts, blocks or a figure, from the record alone; the
workbook says the same with them. What a record of an earlier version lacks is left out.
"""
