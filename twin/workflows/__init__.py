"""Several verbs in a row: a demonstration, and measuring until a model is known well enough."""
