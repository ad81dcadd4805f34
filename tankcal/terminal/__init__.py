"""Tools of all commands: language and output of the terminal, arguments, signals."""
