"""Files that appear whole or not at all."""

import os
import tempfile
from pathlib import Path

from analysis.schema import AnalysisError


def write_text(path: Path, text: str) -> None:
    """Write beside the path and rename over it; an older file of that name is replaced.

    Raises
    ------
    AnalysisError : the folder cannot be created or written
    """
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", newline="\n", dir=path.parent, prefix=f".{path.name}.",
            delete=False,
        ) as stream:  # fmt: skip
            temporary = Path(stream.name)
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.chmod(0o644)
        temporary.replace(path)
    except OSError as error:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
        raise AnalysisError(f"cannot write {path}: {error.strerror or error}") from None
