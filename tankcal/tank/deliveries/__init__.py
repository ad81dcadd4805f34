"""Deliveries: the uncertainty of V(h2) - V(h1), and the worst delivery of at least a given height.

u(h1, h2) = |f(h2) - f(h1)|, with f(h) the row of the factor at a dip, linear between rows; common
errors of both dips cancel. U = k u, with k from Welch-Satterthwaite for each delivery. The search
for the worst case excludes whole blocks of rows at once; it never builds a matrix of rows by rows.

Sources: JCGM 100:2008 5.2, G.4; JCGM 102:2011 6.2.
"""

from tankcal.tank.deliveries.pairs import Deliveries, deliveries, ratio_of
from tankcal.tank.deliveries.worst import (
    TOLERANCE,
    Delivery,
    WorstDeliveries,
    least_delivery_m,
    worst_deliveries,
)

__all__ = [
    "TOLERANCE",
    "Deliveries",
    "Delivery",
    "WorstDeliveries",
    "deliveries",
    "least_delivery_m",
    "ratio_of",
    "worst_deliveries",
]
