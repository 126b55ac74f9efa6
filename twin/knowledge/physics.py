"""The assembly of `twin identify --linkage`."""

from typing import NoReturn

from twin.configuration import Identify


class PhysicsResult:
    pass


def identify_linkage(config: Identify) -> NoReturn:
    raise NotImplementedError
