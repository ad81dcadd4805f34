"""Words: messages in the languages of the users, numbers as they are written, names."""
