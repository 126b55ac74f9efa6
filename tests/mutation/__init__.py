"""Mutation testing: whether a test turns red when a line of the product is wrong."""
