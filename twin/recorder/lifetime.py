"""Beginning and end of Rerun's streams, which Rerun 0.41 itself keeps with their threads."""

import contextlib
import ctypes
from collections.abc import Iterator

import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings

from analysis import schema

Sinks = list[rr.FileSink | rr.GrpcServerSink]
_abandoned: list[rr.RecordingStream] = []


def begin(stream: rr.RecordingStream, sinks: Sinks, look: rrb.Blueprint) -> None:
    """Send a stream to its sinks, a blueprint first.

    As `RecordingStream.set_sinks`, whose stream of the blueprint refers to itself and is never
    released: two threads and some memory a recording. And it waits for ever where the disk has no
    room for the blueprint; sent after the sinks are set, it fails at the next flush.

    Raises
    ------
    RuntimeError, OSError, ValueError : a sink cannot be opened
    """
    rerun_bindings.set_sinks(sinks, default_blueprint=None, recording=stream.to_native())
    show(stream, look)


def show(stream: rr.RecordingStream, look: rrb.Blueprint) -> None:
    """Send a blueprint that takes the place of the first one; as `rerun.send_blueprint`."""
    with _stored(look) as memory:
        rerun_bindings.send_blueprint(memory, True, True, recording=stream.to_native())


@contextlib.contextmanager
def _stored(look: rrb.Blueprint) -> Iterator[rerun_bindings.PyMemorySinkStorage]:
    layout = rr.RecordingStream._from_native(
        rerun_bindings.new_blueprint(
            application_id=schema.APPLICATION,
            make_default=False,
            make_thread_default=False,
            default_enabled=True,
        )
    )
    layout.set_time("blueprint", sequence=0)
    look._log_to_stream(layout)
    memory = layout.memory_recording()
    try:
        yield memory.storage
    finally:
        layout.disconnect()  # releases the memory, which holds the stream


def release() -> None:
    """End the threads of all streams that are disconnected and that nothing refers to."""
    if not _abandoned:  # Rerun would flush those as well, and fail or wait for ever
        rerun_bindings.flush_and_cleanup_orphaned_recordings()


def abandon(stream: rr.RecordingStream) -> None:
    """Abandon a stream whose file cannot be written.

    Rerun waits for ever when such a stream is disconnected, deleted or cleaned up at exit, so it is
    kept alive and unregistered.
    """
    for held in (stream, stream.to_native()):
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(held))
    _abandoned.append(stream)
    rr.unregister_shutdown()
