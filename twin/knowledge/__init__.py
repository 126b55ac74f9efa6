"""From measurement to knowledge: the assemblies of `twin identify` and `twin compare`."""

from twin.knowledge.comparison import compare
from twin.knowledge.identification import identify

__all__ = ["compare", "identify"]
