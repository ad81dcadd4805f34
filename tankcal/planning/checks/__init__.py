"""What cannot be meant in a plan: as it is given, where it stands, what it sees."""
