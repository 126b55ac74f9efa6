"""The least-squares problem of one axis: samples, parameters, weights, columns."""
