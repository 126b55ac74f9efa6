"""Serial line to a rig: open a pyserial URL, send and receive messages without blocking."""

from hardware.link.link import Gap, Link, LinkStatistics
from hardware.link.port import LinkError, available

__all__ = ["Gap", "Link", "LinkError", "LinkStatistics", "available"]
