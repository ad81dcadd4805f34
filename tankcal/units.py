"""Sizes of units, and the standard gravity; exact by definition.

The names of units in columns and files are mapped to these sizes where the files are read. Source:
international yard and pound agreement of 1959; BIPM, The International System of Units.
"""

from math import pi

FULL_TURN = 2 * pi  # rad
GON = FULL_TURN / 400  # rad
ARCSEC = pi / 180 / 3600  # rad
ARCSEC_PER_DEG, ARCSEC_PER_RAD = 3600.0, 648_000 / pi
GON_IN_DEG, DEG_IN_GON = 0.9, 1 / 0.9
INCH_M = 0.0254
FOOT_M = 0.3048
US_SURVEY_FOOT_M = 1200 / 3937
MM_PER_M = 1000.0
HOUR_S = 3600.0
STANDARD_GRAVITY = 9.80665  # m/s2, 3rd General Conference on Weights and Measures, 1901
