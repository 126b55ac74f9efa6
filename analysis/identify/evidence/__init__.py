"""How far a fit can be believed: deviations, residual, what stays unexplained."""
