"""What each table, section and list of a starter job is for: the English."""

SECTION_NOTES = {
    "tank": "the tank, as in the drawing; the texts are printed when given",
    "survey": "how and when the tank was surveyed",
    "datum": "heights, in the frame of the points",
    "table": "what the capacity table is to be; dips count from the table's zero",
    "horizontal": "the cylinder and its ends; sizes as measured, inside or outside (survey.side)",
    "sphere": "the sphere; its size as measured, inside or outside (survey.side)",
    "mesh": "the closed surface of the inside",
    "bottom": "what the bottom is like; see bottom.csv, too",
    "roof": "the floating roof: all of it, or nothing when there is none",
    "corrections": "false switches a correction off, and the report says so",
    "material": "the shell's steel",
    "checks": "only compared, to tell a slip of the hand: nothing here changes a number",
    "adjustment": "how bad points are treated, and what holds the frame of a survey",
    "adjustment.camera": "what of the cameras is adjusted: off, camera free, camera weighted,"
    " camera fixed, or the same with block or photo in place of camera",
    "certificate": "printed when given, never invented",
    "csv": "how the CSV files are written; ; and , for a spreadsheet that uses decimal commas",
}
TABLE_NOTES = {
    "points": "one row for each surveyed point of the wall",
    "courses": "one row for each course (ring of plates), from the bottom up",
    "bottom": "one row for each surveyed point of the bottom (x_m, y_m, z_m), or for each level"
    " measured with liquid (level_m, volume_m3); leave it empty for other bottoms",
    "deadwood": "one row for each thing in the tank that takes or gives room; may stay empty",
    "uncertainty": "one row for each uncertainty that the points do not carry themselves",
    "correlations": "one row for each pair of inputs of uncertainty that are correlated; may stay"
    " empty",
    "stated": "one row for each dip, or pair of dips, whose volume is to be reported with its"
    " budget; may stay empty",
    "targets": "one row for each target of the wall; may stay empty: the wall is then searched",
    "photos": "one row for each photo; orientations may stay blank, they are found",
    "image_points": "one row for each image of a point; a repeated row is a repeated reading",
    "control": "one row for each point that is known beforehand",
    "check": "one row for each known point that is only compared; may stay empty",
    "setups": "one row for each set-up of an instrument over a station",
    "distances": "one row for each distance read with a tape or between two points; may stay empty",
    "slope_distances": "one row for each distance measured from a set-up",
    "directions": "one row for each direction read on the horizontal circle",
    "zenith_angles": "one row for each zenith angle, of both faces the mean",
    "height_differences": "one row for each levelled difference; may stay empty",
    "plumb_lines": "one row for each pair of points on one vertical line; may stay empty",
    "vectors": "one row for each vector between two points (GNSS); may stay empty",
    "correlated_readings": "one row for each pair of values that are correlated; may stay empty",
}
REGISTER_NOTES = {
    "cameras": "one section for each camera; put its name, as in photos.csv, in place of NAME",
    "instruments": "one section for each instrument; put its name in place of NAME; may stay empty",
}
