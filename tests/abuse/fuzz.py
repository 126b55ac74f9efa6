"""Coverage-guided fuzzing of a reader: python -m tests.abuse.fuzz KIND [SECONDS]

KIND is one of `KINDS` in tests/twin/cli/test_mutations.py. Needs atheris, for Python 3.11 on Linux
 (`pip install atheris`), and says so where it is missing. A failing input is kept in the
working folder; the process ends as libFuzzer does, with 0 if nothing failed.
"""

import sys
import tempfile
from pathlib import Path

READERS = (  # are instrumented; all that they import would take minutes
    "analysis.files",
    "analysis.recording",
    "analysis.transfer_function",
    "hardware.calibration.file",
    "twin.campaigns.sampling.study",
    "twin.config.overrides",
    "twin.physics.motor",
    "twin.physics.openrocket",
    "twin.physics.vehicle",
)


def main() -> None:
    """Fuzz one reader, from its valid file on."""
    try:
        import atheris
    except ImportError:
        sys.exit("tests.abuse.fuzz: atheris is not installed; pip install atheris")
    with atheris.instrument_imports(include=list(READERS)):
        from tests.twin.cli.test_mutations import KINDS, REFUSED
    kind, seconds = sys.argv[1], int(sys.argv[2]) if sys.argv[2:] else 60
    suffix, make, read, _ = KINDS[kind]
    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    path, corpus = folder / f"fuzzed{suffix}", folder / "corpus"
    corpus.mkdir()
    (corpus / "valid").write_bytes(make(folder))

    def one(data: bytes) -> None:
        path.write_bytes(data)
        try:
            read(path)
        except REFUSED as error:
            if "\n" in str(error):
                raise AssertionError(f"refused in several lines: {error}") from error

    options = [f"-max_total_time={seconds}", "-max_len=20000", "-rss_limit_mb=2000", "-timeout=10"]
    atheris.Setup([sys.argv[0], *options, str(corpus)], one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
