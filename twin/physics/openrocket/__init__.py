"""OpenRocket designs (.ork): container, parts, masses, and the vehicle made of them."""

from twin.physics.openrocket.container import document
from twin.physics.openrocket.convert import Imported, described, imported
from twin.physics.openrocket.stored import Stored, stored

__all__ = ["Imported", "Stored", "described", "document", "imported", "stored"]
