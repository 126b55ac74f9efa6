"""The simulation of a thrust-vector-control gimbal and the meeting point of desk and analysis."""
