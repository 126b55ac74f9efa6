"""`twin vehicle`: what a vehicle amounts to, from which design, as MJCF and picture."""
