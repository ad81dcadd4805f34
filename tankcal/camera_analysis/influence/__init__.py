"""What does a wrong calibration do to a survey?"""
