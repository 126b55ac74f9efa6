"""The results of a campaign: one folder, rows in Parquet fragments that appear whole or not."""

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from analysis.files import FileError, content, write_text
from analysis.schema import AnalysisError
from twin.campaigns.sampling.study import Study, versions
from twin.campaigns.statistics.figures import FIGURES, NOT_COUNTED
from twin.errors import TwinError

Array = NDArray[np.float64]
SCHEMA = "tvc-twin/campaigns/1"
LARGEST = 1_000_000  # bytes of the description
SMALLEST_PART, LARGEST_PART, PARTS = 8, 1000, 400  # rows of a fragment, and fragments aimed at


class Store:
    """A results folder.

    Attributes
    ----------
    folder : of the results
    count, part_rows : runs of the campaign, and of one fragment
    """

    def __init__(self, folder: Path, study: Study, count: int, columns: Mapping[str, type]) -> None:
        self.folder, self._study = folder, study
        self.count = count
        self.part_rows = min(max(-(-count // PARTS), SMALLEST_PART), LARGEST_PART)
        self._schema = _schema(columns, [m.name for m in study.measures])

    @property
    def parts(self) -> int:
        """Fragments of the complete campaign."""
        return -(-self.count // self.part_rows)

    def runs_of(self, part: int) -> range:
        """Runs of a fragment."""
        return range(part * self.part_rows, min((part + 1) * self.part_rows, self.count))

    def file(self, part: int) -> Path:
        """Place of a fragment."""
        return self.folder / "rows" / f"part-{part:06d}.parquet"

    def begin(self, *, force: bool) -> None:
        """Make the folder of a new campaign; one that has runs of the same study keeps them.

        Raises
        ------
        TwinError : it has results of another study or version and `force` does not allow to remove
            them, or it cannot be written
        """
        if _description(self.folder) is None:
            if self.folder.is_dir() and any(f.name[0] != "." for f in self.folder.iterdir()):
                raise TwinError(f"--out {self.folder}: must be a new folder or one of a campaign")
        elif not force and any((self.folder / "rows").glob("part-*.parquet")):
            self.check()
            return
        try:
            for file in (self.folder / "rows").glob("part-*"):
                file.unlink()
            about = {
                "schema": SCHEMA, "study": self._study.name, "digest": self._study.digest,
                "versions": versions(), "runs": self.count, "part_rows": self.part_rows,
                "place": str(self._study.source.resolve()),
            }  # fmt: skip
            # first of all files, so that what a killed process leaves is a campaign's
            write_text(self.folder / "campaign.json", json.dumps(about, indent=2) + "\n")
            write_text(self.folder / "study.toml", self._study.text)
        except (OSError, AnalysisError) as error:
            raise TwinError(f"--out {self.folder}: {error}") from None

    def check(self) -> None:
        """Refuse a folder that is not of this study.

        Raises
        ------
        TwinError : what it is of, or that it is none
        """
        about = _description(self.folder)
        if about is None:
            raise TwinError(f"{self.folder}: holds no campaign; `twin campaign run` begins one")
        if about.get("digest") == self._study.digest:
            return
        theirs = about.get("versions")
        if isinstance(theirs, dict) and theirs != versions():
            old = ", ".join(f"{k} {v}" for k, v in sorted(theirs.items()))
            raise TwinError(
                f"{self.folder}: was flown with other versions ({str(old)[:120]}); `twin campaign"
                " run` flies it anew, with --out or --force"
            )
        raise TwinError(
            f"{self.folder}: holds the results of another study ({str(about.get('study'))[:60]!r}),"
            " or this one was changed; `twin campaign run` flies it anew, with --out or --force"
        )

    def present(self) -> Iterator[int]:
        """Fragments that are complete."""
        return (p for p in range(self.parts) if self.file(p).exists())

    @property
    def done(self) -> int:
        """Runs of the complete fragments."""
        return sum(len(self.runs_of(p)) for p in self.present())

    def write(self, part: int, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write a fragment beside its place and rename it.

        Raises
        ------
        OSError : it cannot be written; nothing is left of it
        """
        self._write(rows, self.file(part))

    def prepare(self) -> list[int]:
        """Load what writing needs, so that forked processes have it; gives the missing fragments.

        Raises
        ------
        TwinError : the folder cannot be written
        """
        try:
            (self.folder / "rows").mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise TwinError(f"cannot write {self.folder}: {error.strerror}") from None
        pq.write_table(self._table([{}]), pa.BufferOutputStream(), compression="zstd")
        present = set(self.present())
        return [p for p in range(self.parts) if p not in present]

    def _table(self, rows: Sequence[Mapping[str, Any]]) -> pa.Table:
        return pa.Table.from_pylist(list(rows), schema=self._schema)

    def _write(self, rows: Sequence[Mapping[str, Any]], place: Path) -> None:
        beside = place.with_suffix(f".{os.getpid()}.partial")
        try:
            pq.write_table(self._table(rows), beside, compression="zstd")
            beside.replace(place)
        finally:
            beside.unlink(missing_ok=True)

    def tidy(self) -> None:
        """Remove what processes that were ended have left of fragments."""
        for file in (self.folder / "rows").glob("*.partial"):
            file.unlink(missing_ok=True)

    def discard(self, first: int) -> None:
        """Remove fragments past a stop: which there are depends on how fast each process was."""
        for part in range(first, self.parts):
            self.file(part).unlink(missing_ok=True)

    def read(self, part: int) -> pa.Table:
        """Rows of a fragment.

        Raises
        ------
        TwinError : the file is damaged
        """
        try:
            table = pq.read_table(self.file(part), schema=self._schema)
        except (OSError, pa.ArrowException) as error:
            raise TwinError(f"{self.file(part)}: {' '.join(str(error).split())[:200]}") from None
        if table.num_rows != len(self.runs_of(part)):
            raise TwinError(f"{self.file(part)}: must have {len(self.runs_of(part))} rows")
        return table

    def table(self) -> pa.Table:
        """All rows, in order.

        Raises
        ------
        TwinError : there are none, or a file is damaged
        """
        parts = [self.read(p) for p in self.present()]
        if not parts:
            raise TwinError(f"{self.folder}: has no runs yet; `twin campaign resume` flies them")
        return pa.concat_tables(parts)


def _description(folder: Path) -> dict[str, Any] | None:
    file = folder / "campaign.json"
    if not file.exists():
        return None
    try:
        about = json.loads(content(file, LARGEST))
    except (FileError, ValueError, RecursionError) as error:
        raise TwinError(f"{file}: {error}") from None
    if not isinstance(about, dict) or about.get("schema") != SCHEMA:
        raise TwinError(f"{file}: is not the description of a campaign of this version")
    return about


def study_of(folder: Path) -> str:
    """The study file of a results folder, or its copy there where the file is gone.

    Raises
    ------
    TwinError : the folder holds no campaign
    """
    about = _description(folder)
    if about is None:
        raise TwinError(f"{folder}: holds no campaign; give a study file (.toml), or its results")
    place = Path(str(about.get("place", "")))
    return str(place if place.is_file() else folder / "study.toml")


def counted(table: pa.Table) -> pa.Table:
    """Rows of runs that count: all but those refused and crashed."""
    return table.filter(pc.invert(pc.is_in(table["outcome"], pa.array(NOT_COUNTED))))


def column(table: pa.Table, name: str) -> Array:
    """A column as numbers (n,), NaN where it has none."""
    return np.asarray(
        table[name].cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False), np.float64
    )


def _schema(columns: Mapping[str, type], measures: Sequence[str]) -> pa.Schema:
    kinds = {float: pa.float64(), int: pa.int64(), bool: pa.bool_(), str: pa.string()}
    return pa.schema(
        [("run", pa.int64()), ("seed", pa.int64())]
        + [(name, kinds[kind]) for name, kind in columns.items()]
        + [(name, pa.float64()) for name in FIGURES]
        + [(name, pa.bool_()) for name in measures]
        + [("outcome", pa.string()), ("reason", pa.string())]
    )
