"""From measurement to knowledge: the assemblies of `twin identify` and `twin compare`."""

from twin.evaluation.compare import compare
from twin.evaluation.identify import identify

__all__ = ["compare", "identify"]
