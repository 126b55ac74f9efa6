"""`twin view`: open a recording in the Rerun viewer."""

from twin.config import View


def view(config: View) -> int:
    """Show a recording until the viewer is closed; returns the viewer's exit code.

    Raises
    ------
    TwinError : the recording cannot be shown
    """
    from twin import status, viewer

    status.say("")

    return int(viewer.view(config.recording, web=config.web, port=config.port) or 0)
