"""Identification: the numbers of a vessel's physics fitted to recorded runs, with honest uncertainty."""
