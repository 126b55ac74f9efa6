"""`twin view`: open recordings in the Rerun viewer."""

import tempfile
from pathlib import Path

from twin.config import View
from twin.errors import TwinError


def view(config: View) -> int:
    """Show recordings until the viewer is closed; returns the viewer's exit code.

    Raises
    ------
    TwinError, AnalysisError : a recording cannot be shown
    """
    from twin import status, viewer

    status.say("")
    if not config.recordings:
        raise TwinError("view: name one or more recordings (.rrd)")
    if len(config.recordings) == 1:
        return int(viewer.view(config.recordings[0], web=config.web, port=config.port) or 0)
    from twin.recorder.layout.together import write

    with tempfile.TemporaryDirectory(prefix="twin-view-") as folder:
        both = Path(folder) / "together.rrd"
        write([viewer.repaired(path) for path in config.recordings], both)
        return int(viewer.view(both, web=config.web, port=config.port) or 0)
