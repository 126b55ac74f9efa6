"""Random hostile input for every reader, verb and port; `make abuse` prints attempts, failures."""
