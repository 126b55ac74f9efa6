"""What the program says to small inputs that once broke it: python -m tests.benchmarks.cases FOLDER

FOLDER holds motors/, tables/, mechanisms/, identification/ and hostile/; none of it is shipped. One
line each: exit code, seconds, and the figures or the refusal.
"""

import contextlib
import io
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from twin.cli.main import main

TABLE = "--time t --input u --angle y"
DEG, VOLTS = "--angle-unit deg", "--angle-unit 1 --input-unit 1"
AXIS = f"--time t --input u --angle angle {DEG} --input-stamps exact"
SHORT = "--duration-s 0.5"
KEPT = re.compile(
    r"gain|delay|frequency|damping|limit|predict|check|fit|motor|thrust|warning", re.I
)
SENSORS = f"--time t --input u1,u2 --angle pot1,pot2 --rate gyro1,gyro2 {DEG}"
CASES: tuple[tuple[str, str], ...] = (
    ("motors/bom_comment.eng", f"fly --motor F {SHORT}"),
    ("motors/trailing_zeros.eng", f"fly --motor F {SHORT}"),
    ("motors/one_bad_motor.eng", f"fly --motor F {SHORT}"),
    ("motors/one_bad_motor.eng", f"fly --motor F:X20 {SHORT}"),
    ("motors/grams.eng", f"fly --motor F {SHORT}"),
    ("motors/never_ends.eng", f"fly --motor F {SHORT}"),
    ("motors/x20.rse", f"fly --motor F {SHORT}"),
    *((f"tables/rate_limited_{u}.csv", f"identify F {TABLE} --input-stamps exact --servo")
      for u in ("rad", "us", "percent")),
    ("tables/cut_off.csv", f"identify F {TABLE}"),
    ("tables/one_step.csv", f"identify F {TABLE}"),
    ("identification/b_late_stamps.csv",
     f"identify F --time t --input u --rate gyro --angle pot {DEG} --commands F.commands.csv"),
    ("identification/c_single_step.csv", f"identify F {AXIS}"),
    ("identification/d_long_delay.csv",
     "identify F --time t --input u --angle y --input-stamps exact --max-delay-ms 3000"),
    ("identification/e_pot_volts.csv",
     f"identify F --time t --input u --angle volts {VOLTS} --input-stamps exact"),
    *((f"identification/f_coloured_{k}.csv", f"identify F {AXIS}") for k in (1, 2, 3)),
    ("identification/g_train.csv",
     f"identify F {AXIS} --initial free --check D/g_check_moving.csv"),
    ("identification/h_mimo_4.csv",
     f"identify F {SENSORS} --commands F.commands.csv --zeros 1 --coupling full"),
    ("hostile/model_self.xml", "step --scene F"),
    ("hostile/mat_segv.mat", f"identify F {TABLE}"),
    ("hostile/replicate.xml", "step --mechanism F"),
)  # fmt: skip
MECHANISMS = ("soft", "millimetres", "mirrored")  # written by mechanisms/make.sh


def answer(arguments: list[str], folder: Path) -> str:
    """Exit code, seconds and what was printed of figures or of the error."""
    began, out, err = time.monotonic(), io.StringIO(), io.StringIO()
    code: object = 0
    with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(arguments)
        except SystemExit as ended:
            code = ended.code or 0
    took = time.monotonic() - began
    text = out.getvalue() if code == 0 else err.getvalue()
    lines = [" ".join(line.split()) for line in text.splitlines() if line.strip()]
    told = [x for x in lines if KEPT.search(x)][:9] if code == 0 else lines[-1:]
    return f"exit {code}, {took:.1f} s: {'; '.join(told)}"


def table(cases: Path) -> Iterator[str]:
    """One line a case."""
    for name, line in CASES:
        file = cases / name
        plain = str(file).removesuffix(".csv")
        words = [
            w.replace("F.commands", f"{plain}.commands") if w.startswith("F.")
            else str(file) + w[1:] if w == "F" or w.startswith("F:")
            else w.replace("D/", f"{file.parent}/", 1) if w.startswith("D/") else w
            for w in line.split()
        ]  # fmt: skip
        with tempfile.TemporaryDirectory() as folder:
            yield f"{name} | {' '.join(line.split()[:3])} | {answer(words, Path(folder))}"
    with tempfile.TemporaryDirectory() as folder:
        root = Path(__file__).resolve().parents[2]
        script = cases / "mechanisms" / "make.sh"
        subprocess.run(["sh", script, root], cwd=folder, capture_output=True, check=False)
        for name in MECHANISMS:
            words = f"fly --mechanism mjcf/{name}.xml --programme doublet --duration-s 8".split()
            yield f"mechanisms/{name}.xml | fly | {answer(words, Path(folder))}"


if __name__ == "__main__":
    for text in table(Path(sys.argv[1]).resolve()):
        print(text, flush=True)
