"""The base of every error the twin raises for its user."""


class TwinError(ValueError):
    """A mistake of the user, as one line; the command line maps it to exit code 2."""


class DivergenceError(RuntimeError):
    """A simulation that left the finite numbers; the command line maps it to exit code 1."""


class CheckError(RuntimeError):
    """A rig that failed a check before its run; the command line maps it to exit code 1."""
