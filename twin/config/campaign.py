"""Settings of `twin campaign`."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, ClassVar, Literal

from twin.config.options import Output
from twin.config.types import POSITIONAL, Flag, Range, Texts
from twin.errors import TwinError


@dataclass(frozen=True)
class Campaign(Output):
    """Fly a study of many flights, and answer its question from their rows."""

    group: ClassVar[str] = "campaign"
    effective = MappingProxyType(
        {
            "workers": ("action", ("run", "resume")),
            "fail_if": ("action", ("run", "resume", "report")),
            "paths": ("action", ("run", "resume", "report")),
        }
    )

    action: Annotated[Literal["run", "resume", "report", "refly"], POSITIONAL]
    """run: fly the study, or what a folder with flights of it lacks; resume: fly what is missing;
    report: write the page again from the rows there are; refly: fly one run again with a full
    recording."""
    study: Annotated[str, POSITIONAL]
    """Study file (.toml), or a shipped study: dispersion, limits, mechanism, servos, gains; or the
    folder of its results."""
    run: Annotated[Annotated[int, Range(0, 10**9)] | None, POSITIONAL] = None
    """Number of the run, for `refly`."""
    _: KW_ONLY
    workers: Annotated[int, Range(1, 256)] | None = None
    """Processes that fly at the same time; one for each processor if omitted."""
    ray: str | None = None
    """Fly with Ray on several machines: HOST:PORT of a running cluster, or `local` for one on this
    machine; needs the extra `cluster`."""
    fail_if: Texts = ()
    """Condition on a statistic, for example "hit_rate < 0.95": exit code 1 where its interval
    confirms it, 3 where it is undecided. Added to those of the study. Repeatable."""
    reweight: str | None = None
    """Study file that varies the same parameters with other distributions: rates as if these had
    been flown, from the rows there are; with `report`."""
    paths: Annotated[int, Range(0, 1000)] = 0
    """Runs to fly again for a recording with their paths, worst and median highlighted."""
    force: Flag = False
    """Remove the runs of the folder and start again, or replace any recording with `refly`."""
    out: Path | None = None
    """Folder of the results; runs/STUDY if omitted. With `refly` the recording (.rrd) to write;
    run-NUMBER with the date in the folder of the results if omitted."""

    def validate(self) -> None:
        """Refuse settings without effect.

        Raises
        ------
        TwinError : the flag and its value
        """
        super().validate()
        if (self.run is not None) != (self.action == "refly"):
            raise TwinError(
                "twin campaign refly: needs the number of a run, for example refly STUDY 17"
                if self.run is None
                else f"twin campaign {self.action}: takes no run number ({self.run})"
            )
        if self.ray is not None and self.action not in ("run", "resume"):
            raise TwinError(f"--ray {self.ray}: is for `twin campaign run` and `resume`")
        if self.workers is not None and self.ray not in (None, "local"):
            raise TwinError(f"--workers {self.workers}: a cluster has its own number; leave it out")
        if self.reweight is not None and self.action != "report":
            raise TwinError(f"--reweight {self.reweight}: is for `twin campaign report`")
