"""Answers of a study, for people and machines."""
