"""Correction of the volume of a liquid from its temperature to a base temperature.

petroleum    crude oil, products and lubricating oils (ASTM D1250)
alcohol      ethanol-water mixtures (OIML R 22)
gases        liquefied petroleum gas (GPA TP-27)
brazil       the tables of Brazil, Resolução CNP 6/70
corrections  choice of one of them by name
"""
