"""Messages in the languages of the users, formats of numbers, and names."""
