"""Desk: the model of a job under edit, which notebook and app share. It is no command."""
