"""Fit of a linear model to one axis: where to begin, and the way down."""
