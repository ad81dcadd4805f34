"""Are two calibrations of a camera the same?"""
