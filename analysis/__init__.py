"""From measurement to knowledge: recordings, identified models, responses, comparisons."""
