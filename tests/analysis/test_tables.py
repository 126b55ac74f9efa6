"""Tables from anybody's rig, and from nobody's friend."""

import contextlib
import math
import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from analysis.recording import Columns, RecordingError
from analysis.recording.columns import measurement_of_table
from analysis.recording.tables import read
from analysis.schema import AnalysisError

GOOD = "t,u,pot,gyro\n0.00,0,0.1,\n0.01,5,0.2,1.5\n0.02,5,,1.0\n0.03,0,0.4,0.5\n"


def table(tmp_path, text, name="run.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read(path)


def chosen(found, time="t", inputs=("u",), angle=("pot",), unit="rad", **more):
    return measurement_of_table(found, Columns(time, inputs, angle, unit=unit, **more))


def test_columns_come_by_name_and_empty_fields_are_missing(tmp_path):
    found = table(tmp_path, GOOD)
    assert list(found.columns) == ["t", "u", "pot", "gyro"]
    assert found.column("u").tolist() == [0, 5, 5, 0]
    assert math.isnan(found.column("pot")[2])


def test_missing_commands_are_held_in_one_line_and_refused_in_the_first_row(tmp_path):
    r = chosen(table(tmp_path, "t,u,pot\n0,0,0\n0.1,5,0\n0.2,,4\n0.3,,5\n0.4,0,5\n"))
    assert r.command.values[:, 0].tolist() == [0, 5, 5, 5, 0]
    note, _ = r.note.split("; ")  # the other one is of its unit
    assert note == "2 missing commands are taken as the one before, first in sample 3"
    with pytest.raises(AnalysisError, match="first row has no command in 'u'"):
        chosen(table(tmp_path, "t,u,pot\n0,,0\n0.1,5,0\n0.2,5,4\n0.3,5,5\n"))


def test_an_unknown_column_lists_the_valid_ones(tmp_path):
    with pytest.raises(AnalysisError, match=r"no column 'po'.*gyro, pot, t, u"):
        table(tmp_path, GOOD).column("po")


def test_a_record_is_in_radians_whatever_the_file(tmp_path):
    r = chosen(table(tmp_path, GOOD), rate=("gyro",), unit="deg")
    assert r.command.values[1, 0] == pytest.approx(math.radians(5.0))
    assert r.rate.values[1, 0] == pytest.approx(math.radians(1.5))
    assert math.isnan(r.angle.values[2, 0])


def test_milliseconds_and_a_command_unit_of_its_own(tmp_path):
    text = "ms,u,y\n0,1,0\n10,2,0.1\n20,2,0.2\n"
    r = chosen(table(tmp_path, text), time="ms", angle=("y",), input_unit="deg", time_scale=1e-3)
    assert r.time.tolist() == [0.0, 0.01, 0.02]
    assert r.command.values[0, 0] == pytest.approx(math.radians(1.0))
    assert r.angle.values[2, 0] == 0.2


def test_commands_may_have_a_file_and_stamps_of_their_own(tmp_path):
    commands = tmp_path / "commands.csv"
    commands.write_text("t,u\n-1,0\n0.0137,5\n")
    r = chosen(table(tmp_path, GOOD), commands=commands)
    assert r.command.time.tolist() == [-1.0, 0.0137]
    assert r.slack == 0.0


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"unit": None}, "5 rad, 286.5°: is it in degrees? give --angle-unit deg"),
        ({"unit": "rad"}, "5 rad, 286.5°: check the unit given"),
        ({"input_unit": "turn"}, "5 turn, 1800°: check the unit given"),
        ({"unit": "deg"}, ""),
        ({"unit": None, "input_unit": "us"}, ""),
    ],
)
def test_commands_beyond_a_quarter_turn_have_a_doubtful_unit(tmp_path, more, said):
    """No gimbal turns so far; the number is the file's own, the angle that of the unit."""
    note = chosen(table(tmp_path, GOOD), **more).note
    assert note == (f"command 'u' reaches {said}" if said else "")


@pytest.mark.parametrize("names", [("t", "u", "u"), ("t", "t", "pot"), ("t", "u", "t")])
def test_one_column_for_two_purposes_is_refused(names):
    time, command, angle = names
    with pytest.raises(AnalysisError, match="is named twice"):
        Columns(time, (command,), (angle,))


def test_a_table_of_commands_may_call_its_column_as_the_other_one_does(tmp_path):
    Columns("t", ("angle",), ("angle",), commands=tmp_path / "commands.csv")


def test_unknown_unit_lists_the_valid_ones(tmp_path):
    with pytest.raises(AnalysisError, match=r"no unit 'degrees'.*deg.*rad"):
        chosen(table(tmp_path, GOOD), unit="degrees")


def test_semicolons_with_decimal_commas_and_a_byte_order_mark(tmp_path):
    found = table(tmp_path, "\ufefft;u\n0,00;1,5\n0,01;-2\n")
    assert found.column("u").tolist() == [1.5, -2.0]


def test_backward_stamps_of_a_file_name_the_file(tmp_path):
    text = GOOD.replace("0.02,", "0.005,")
    with pytest.raises(RecordingError, match=r"run\.csv: time runs from 0\.01 s to 0\.005 s"):
        chosen(table(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        ("t,u\n", "no rows of numbers"),
        ("0,1\n2,3\n", "must name the columns"),
        ("t,t\n0,1\n", "two columns are called 't'"),
        ("t,u\n0\n", "row 2 has 1 fields, the header 2"),
        ("t,u\n0,volts\n", "row 2, column 'u': 'volts' is not a number"),
        ("t,u\n0,1_000\n", "not a number"),
        ("t,u\n0,inf\n", "infinite"),
        (b"t,u\n\x00\x01", "zero bytes"),
        (b"t,u\n0,\x81\n", "not UTF-8"),
        ("t,u\n2026-05-01 10:00:00,1\n3,2\n", "column 't' holds dates and numbers"),
        ("t,u\n0," + "9" * 5000 + "\n", "not a number"),
        (",".join(f"c{i}" for i in range(600)) + "\n", "600 columns"),
    ],
)
def test_what_is_no_table_is_refused_in_one_line(tmp_path, text, said):
    with pytest.raises(AnalysisError, match=said) as caught:
        table(tmp_path, text).stack(["u", "t"])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "content",
    [
        "sep=;\r\nt;u °\r\n0,00;1,5\r\n0,25;-2\r\n".encode("cp1252"),
        "t\tu °\r\n0,00\t1,5\r\n0,25\t-2\r\n".encode("utf-16"),
        "t,u °\ns,deg\n0,1.5\n0.25,-2\n".encode(),
        "t,u °,state\ns,deg,\n0,1.5,1\n0.25,-2,1\n".encode(),
        "t,u °\n2026-05-01T23:59:59.75Z,1.5\n2026-05-02 00:00:00+00:00,-2\n".encode(),
        "t,u °\n23:59:59.5,1.5\n23:59:59.75,-2\n".encode(),
    ],
)
def test_encodings_separators_unit_rows_and_dates_of_other_programs(tmp_path, content):
    found = table(tmp_path, content)
    assert found.stack(["t", "u °"]).tolist() == [[0, 1.5], [0.25, -2]]
    assert ("row 2 (s, deg" in found.note) is (b"s,deg" in content)


@pytest.mark.parametrize(
    "content",
    [
        't,u\n"0,0","1,5"\n"0,25","-2"\n',  # LibreOffice, commas for both
        "t u y\n0,000 1,5 0,0\n0,250 -2,0 0,1\n",
        't;u\n"0,000";"1,500"\n"0,250";"-2,000"\n',
        "t|u\n0.0|1.5\n0.25|-2\n",
        "t = 0 u = 1.5\nt = 0.25 u = -2\n",
        "t,u\n0,1.5\n0.25,\u22122\n",
        "t,u\n(sec),(\u00b0)\n0,1.5\n0.25,-2\n",
        "t,u\n0,1.5\n0.25,-2\n" + 300 * "\0",  # room that a log has not filled
        "t,u\n00:00.5,1.5\n00:00.75,-2\n",  # minutes and seconds, as Excel writes them
        "t,u\n9:59:59.75,1.5\n10:00:00.00,-2\n",
    ],
)
def test_numbers_as_people_and_programs_write_them(tmp_path, content):
    found = table(tmp_path, content)
    assert found.stack(["t", "u"]).tolist() == [[0, 1.5], [0.25, -2]]


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_commas_between_thousands_are_no_decimal_commas_and_no_times_of_day(tmp_path, delimiter):
    rows = [delimiter.join((f'"{10000 + 10 * k:,}"', f"{0.5 * k}")) for k in range(9)]
    found = table(tmp_path, delimiter.join("tu") + "\n" + "\n".join(rows) + "\n")
    assert found.column("t").tolist() == [10000 + 10 * k for k in range(9)]


@pytest.mark.parametrize(
    ("written", "more"),
    [
        ("12.000;0,5\n12.250;-2", ""),  # points between thousands, commas decimal
        ("12.000,0;0,5\n12.250,0;-2", ""),
        ("'12000';'0.5'\n'12250';'-2'", ""),
        ("12'000;0.5\n12'250;-2", ""),
        ("12\u202f000;0.5\n12\u202f250;-2", ""),
        ("12,000.0;0.5\n12,250.0;-2", ""),
        ("12000;0,5 °\n12250;-2 °", "deg"),
        ("12000ms;0.5 deg\n12250ms;-2 deg", "deg"),
        ("27.11.2026 10:11:12,000;0,5\n27.11.2026 10:11:12,250;-2", ""),
        ("27.11.26 23:59:59.9;0.5\n28.11.26 00:00:00.15;-2", ""),
        ("11/27/2026 11:59:59.9 AM;0.5\n11/27/2026 12:00:00.15 PM;-2", ""),
        ("31/12/2026 23:59:59.9;0.5\n01/01/2027 00:00:00.15;-2", ""),
        ("2026/12/31 23:59:59.9;0.5\n2027/01/01 00:00:00.15;-2", ""),
        ("31-Dec-2026 23:59:59.9;0.5\n01-Jan-2027 00:00:00.15;-2", ""),
        ("Dec 31 23:59:59.9;0.5\nJan  1 00:00:00.15;-2", ""),
        ("0 days 23:59:59.9;0.5\n1 days 00:00:00.15;-2", ""),
        ("99:59:59.9;0.5\n100:00:00.15;-2", ""),
        ("2026-11-27T10:11:12.000000001+01:00;0.5\n2026-11-27T10:11:12.250000001+01:00;-2", ""),
    ],
)
def test_stamps_and_numbers_as_other_countries_and_programs_write_them(tmp_path, written, more):
    """A quarter of a second, or 250 of the counter, from 0.5 to -2."""
    found = table(tmp_path, f"t;u\n{written}\n")
    assert np.diff(found.column("t")) == pytest.approx(0.25 if ":" in written else 250.0)
    assert found.column("u").tolist() == [0.5, -2.0]
    assert found.units.get("u", "") == more


def test_a_unit_behind_the_numbers_holds_and_another_one_is_refused(tmp_path):
    rows = "".join(f"{10 * k} ms,{k % 2} deg,{k / 2} °\n" for k in range(9))
    found = table(tmp_path, "t,u,pot\n" + rows)
    run = chosen(found, unit=None)
    np.testing.assert_allclose(run.time, 0.01 * np.arange(9))
    np.testing.assert_allclose(run.angles.values[:, 0], np.radians(np.arange(9) / 2))
    assert run.command.values.max() == pytest.approx(math.radians(1.0))
    with pytest.raises(AnalysisError, match="'pot' has values in deg; give --angle-unit deg"):
        chosen(found, unit="rad")
    with pytest.raises(AnalysisError, match="'t' has values in ms, --time-scale 1 is given"):
        chosen(found, unit="deg", time_scale=1.0)
    mixed = table(tmp_path, "t,u,pot\n0,0,1 deg\n0.01,1,0.02 rad\n0.02,1,2 deg\n")
    with pytest.raises(AnalysisError, match="'pot' has values in deg and rad; give one unit"):
        chosen(mixed)


@pytest.mark.parametrize(
    ("bits", "signed", "unit"),
    [(16, False, 1e-3), (16, False, 1e-6), (16, True, 1e-3), (24, False, 1e-6)],
)
def test_a_counter_of_16_or_24_bits_goes_on_behind_its_overflows(tmp_path, bits, signed, unit):
    """Every 10 ms for 200 s, as truth; row 70 is late by a fifth of the spacing."""
    turn, period = 2**bits, round(0.01 / unit)
    true = period * np.arange(20_000) + turn // 2 - 5 * period
    true[70] += period // 5
    stamps = (true + turn // 2) % turn - turn // 2 if signed else true % turn
    rows = "".join(f"{t},{k % 7},{k}\n" for k, t in enumerate(stamps))
    run = chosen(table(tmp_path, "t,u,pot\n" + rows), time_scale=unit)
    np.testing.assert_allclose(run.time - run.time[0], unit * (true - true[0]), atol=1e-9)


@pytest.mark.parametrize(("turn", "scale"), [(2**32 * 1e-6, 1.0), (2**16 * 1e-3, 1.0)])
def test_a_counter_that_a_program_divided_goes_on_behind_its_overflow(tmp_path, turn, scale):
    """micros() / 1e6 and a 16-bit millis() / 1e3, as seconds."""
    true = 0.01 * np.arange(300) + turn - 1.5
    rows = "".join(f"{t:.6f},{k % 7},{k}\n" for k, t in enumerate(true % turn))
    run = chosen(table(tmp_path, "t,u,pot\n" + rows), time_scale=scale)
    np.testing.assert_allclose(run.time - run.time[0], true - true[0], atol=2e-6)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"\x1f\x8b\x08\x00" + bytes(40), "compressed by gzip; unpack it first"),
        (b"PK\x03\x04" + bytes(40), "a ZIP archive or an Excel workbook"),
        (b"\n<!DOCTYPE html><html></html>", "a web page; download the file itself"),
        (b"t,u\n0,3 furlongs\n1,4 furlongs\n", "of units behind numbers 'furlongs' is none"),
    ],
)
def test_files_of_other_kinds_are_called_what_they_are(tmp_path, content, said):
    with pytest.raises(AnalysisError, match=said):
        table(tmp_path, content).column("u")


@pytest.mark.parametrize(
    ("stamps", "said"),
    [
        ([*range(100), *range(100)], "give each a file"),
        ([*range(100)][::-1], "sort the rows by time"),
        ([k // 10 for k in range(100)], "rows share their stamps"),
        ([*range(65_000, 65_050), *range(30_000, 30_050)], r"\(1 do not\)$"),
    ],
)
def test_stamps_that_start_again_are_no_overflow(tmp_path, stamps, said):
    rows = "".join(f"{t},{k % 7},{k}\n" for k, t in enumerate(stamps))
    with pytest.raises(RecordingError, match=said):
        chosen(table(tmp_path, "t,u,pot\n" + rows), time_scale=0.01)


def test_a_short_counter_dates_no_commands_of_an_own_file(tmp_path):
    rows = "".join(f"{10_000 * k % 2**16},{k}\n" for k in range(50))
    (tmp_path / "commands.csv").write_text("t,u\n100,0\n20000,5\n")
    with pytest.raises(AnalysisError, match="overflows at 65536"):
        chosen(
            table(tmp_path, "t,pot\n" + rows), commands=tmp_path / "commands.csv", time_scale=1e-6
        )


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-8-sig"])
def test_every_encoding_of_unicode_is_read(tmp_path, encoding):
    found = table(tmp_path, GOOD.encode(encoding))
    assert found.column("u").tolist() == [0, 5, 5, 0]


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("| t | u |\n|---|--:|\n| 0 | 1.5 |\n| 0.25 | -2 |\n", "tu"),
        ("# t u\n# s deg\n0 1.5\n0.25 -2\n", "tu"),
        ("t\tu\tComment\n0\t1,5\n0,25\t-2\n", "tu"),
        ('[{"t": 0, "u": 1.5},\n{"t": 0.25, "u": -2}]\n', "tu"),
        ('{"t": "0", "u": "1.5"}\n{"t": "0.25", "u": "-2"}\n', "tu"),
        ('{"t": 0, "d": {"u": 1.5}}\n{"t": 0.25, "d": {"u": -2}}\n', ["t", "d.u"]),
        ('{"t": 0, "u": [1.5]}\n{"t": 0.25, "u": [-2]}\n', ["t", "u[0]"]),
        ("t=0s u=1.5°\nt=0.25s u=-2°\n", "tu"),
    ],
)
def test_tables_of_other_forms(tmp_path, text, names):
    found = table(tmp_path, text)
    assert found.stack([*names]).tolist() == [[0, 1.5], [0.25, -2]]


def test_a_name_may_hold_the_separator_in_quotes(tmp_path):
    found = table(tmp_path, '"time, s", "u, deg"\n0, 1.5\n0.25, -2\n')
    assert list(found.columns) == ["time, s", "u, deg"]


def test_marks_of_missing_readings_are_empty_fields(tmp_path):
    found = table(
        tmp_path,
        "t,u\n0,NA\n1,null\n2,n/a\n3,NaN\n4,\n5,--\n6,-nan(ind)\n7,?\n8,#WERT!\n9,1.#QNAN\n10,7\n",
    ).column("u")
    np.testing.assert_array_equal(found, [np.nan] * 10 + [7])


def test_a_counter_of_32_bits_goes_on_behind_its_overflow(tmp_path):
    start = 2**32 - 15_000
    stamps = [(start + 10_000 * k) % 2**32 for k in range(4)]
    text = "t,u,pot\n" + "".join(f"{t},{k},{k}\n" for k, t in enumerate(stamps))
    run = chosen(table(tmp_path, text), time_scale=1e-6)
    np.testing.assert_allclose(np.diff(run.angles.time), 0.01, rtol=1e-9)


@pytest.mark.parametrize(("first", "commanded"), [(-3, 2), (1, -1), (1, 3)])
def test_commands_of_an_own_file_begun_on_the_other_side_of_an_overflow(tmp_path, first, commanded):
    """Periods of 10 ms from the overflow; each file has its stamps modulo 2³²."""
    commands = tmp_path / "commands.csv"
    stamps = [10_000 * k % 2**32 for k in range(commanded, commanded + 3)]
    commands.write_text("t,u\n" + "".join(f"{t},{k}\n" for k, t in enumerate(stamps)))
    rows = "".join(f"{10_000 * k % 2**32},0\n" for k in range(first, first + 8))
    table_ = table(tmp_path, "t,pot\n" + rows)
    run = chosen(table_, commands=commands, before=(0.0,), time_scale=1e-6)
    at = run.command.time[-3:] - run.angles.time[0]
    np.testing.assert_allclose(at, 0.01 * (np.arange(3) + commanded - first), atol=1e-6)


def test_dates_of_commands_and_readings_are_on_one_clock(tmp_path):
    commands = tmp_path / "commands.csv"
    commands.write_text("t,u\n2026-05-01 10:00:00.95,0\n2026-05-01 10:00:01.00,5\n")
    rows = "".join(f"2026-05-01 10:00:0{k / 4:.2f},0.1\n" for k in range(8))
    run = chosen(table(tmp_path, "t,pot\n" + rows), commands=commands, before=(0.0,))
    np.testing.assert_allclose(run.command.time[-2:], [0.95, 1.0], atol=1e-6)


def test_a_date_may_be_missing_and_one_behind_text_is_no_stamp(tmp_path):
    found = table(tmp_path, "t,u,s\n2026-05-01,1,on\n,2,2026-05-01\n2026-05-02,3,off\n")
    np.testing.assert_array_equal(found.column("t"), [0.0, np.nan, 86400.0])
    with pytest.raises(AnalysisError, match="row 2, column 's': 'on' is not a number"):
        found.column("s")


def test_a_board_that_began_anew_is_no_overflow(tmp_path):
    text = "t,u,pot\n2520000000,0,0\n2520010000,0,0\n0,1,1\n10000,1,1\n"
    with pytest.raises(RecordingError, match=r"stamps must increase \(1 do not\)"):
        chosen(table(tmp_path, text), time_scale=1e-6)


def test_a_column_of_text_troubles_only_who_asks_for_it(tmp_path):
    found = table(tmp_path, "t,u,state\n0,1,OK\n0.01,2,inf\n0.02,3,stopped\n")
    assert found.stack(["t", "u"]).tolist() == [[0, 1], [0.01, 2], [0.02, 3]]
    with pytest.raises(AnalysisError, match=r"row 2, column 'state': 'OK' is not a number"):
        found.column("state")


@pytest.mark.parametrize("header", ["t,u", "t,u,"])
def test_lines_may_end_with_a_separator_but_not_hold_one_field_more(tmp_path, header):
    found = table(tmp_path, f"{header}\n0,1,\n0.01,2,\n")
    assert list(found.columns) == ["t", "u"]
    assert found.column("u").tolist() == [1, 2]
    with pytest.raises(AnalysisError, match="row 3 has 3 fields, the header 2"):
        table(tmp_path, f"{header}\n0,1,\n0.01,2,7\n")


def test_comments_are_skipped_and_rows_keep_their_numbers(tmp_path):
    text = '# rig 7; 2.5" nozzle, 2024-05-01\nt,u\n# begun late\n0,1\n0.01,2\n0.02,x\n'
    assert table(tmp_path, text.replace("x", "3")).column("u").tolist() == [1, 2, 3]
    with pytest.raises(AnalysisError, match=r"row 6, column 'u'"):
        table(tmp_path, text).column("u")


def test_the_header_that_numpy_writes_names_the_columns(tmp_path):
    path = tmp_path / "run.csv"
    np.savetxt(path, [[0.0, 1.0], [0.01, 2.0]], delimiter=",", header="rig 7\nt,u")
    assert read(path).column("u").tolist() == [1.0, 2.0]


@pytest.mark.parametrize(("apart", "scale"), [(4.0, "0.001"), (4000.0, "1e-06")])
def test_stamps_that_are_no_seconds_are_noticed_before_a_fit(tmp_path, apart, scale):
    found = table(tmp_path, "t,u,y\n" + "".join(f"{k * apart},1,{k}\n" for k in range(5)))
    with pytest.raises(AnalysisError, match=f"--time-scale {scale}"):
        chosen(found, angle=("y",))
    assert chosen(found, angle=("y",), time_scale=1.0).period == apart
    with pytest.raises(AnalysisError, match="time scale of 0"):
        chosen(found, angle=("y",), time_scale=0.0)


def test_missing_and_foreign_files_are_refused(tmp_path):
    with pytest.raises(AnalysisError, match="No such file"):
        read(tmp_path / "none.csv")
    (tmp_path / "image.png").write_bytes(b"x")
    with pytest.raises(AnalysisError, match=r"'\.png' is no table"):
        read(tmp_path / "image.png")
    with pytest.raises(AnalysisError, match="is no table"):
        read(tmp_path)


def test_matlab_vectors_matrices_and_structs_become_columns(tmp_path):
    path = tmp_path / "run.mat"
    savemat(path, {"t": np.arange(5.0), "y": np.ones((5, 2)), "log": {"u": np.zeros(5), "s": "a"}})
    found = read(path)
    assert set(found.columns) == {"t", "y(1)", "y(2)", "log.u"}
    assert found.stack(["t", "log.u"]).shape == (5, 2)


def test_columns_of_different_lengths_do_not_stack(tmp_path):
    path = tmp_path / "run.mat"
    savemat(path, {"t": np.arange(5.0), "y": np.ones(4)})
    with pytest.raises(AnalysisError, match="different lengths"):
        read(path).stack(["t", "y"])


def test_a_newer_matlab_file_is_named_as_such(tmp_path):
    path = tmp_path / "run.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file" + b" " * 105 + b"\x00\x02IM" + bytes(512))
    with pytest.raises(AnalysisError, match=r"7\.3 file; save it with -v7"):
        read(path)


@settings(max_examples=25, deadline=None)
@given(st.binary(max_size=300))
def test_hostile_bytes_are_refused_or_read_but_never_crash(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("hostile") / "x.csv"
    path.write_bytes(content)
    with contextlib.suppress(AnalysisError):
        read(path)


def test_a_matlab_file_that_crashes_its_reader_is_refused_in_one_line(tmp_path):
    """SciPy's reader looks a type's size up without a check: an unknown type is a crash."""
    path = tmp_path / "x.mat"
    savemat(path, {"t": np.arange(20.0)})
    whole = bytearray(path.read_bytes())
    whole[176] = 255  # type of the values; 9 is double
    path.write_bytes(whole)
    with pytest.raises(AnalysisError, match=r"x\.mat: is damaged or hostile") as caught:
        read(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["x.csv", "x.mat"])
def test_what_is_not_a_regular_file_is_not_opened(tmp_path, name):
    """A FIFO would block for ever, a device never end."""
    os.mkfifo(tmp_path / name)
    with pytest.raises(AnalysisError, match="not a regular file"):
        read(tmp_path / name)
    (tmp_path / name).unlink()
    (tmp_path / name).symlink_to("/dev/zero")
    with pytest.raises(AnalysisError, match="not a regular file"):
        read(tmp_path / name)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30))
def test_numbers_survive_a_csv(tmp_path_factory, values):
    path = tmp_path_factory.mktemp("round") / "x.csv"
    path.write_text("v,w\n" + "".join(f"{v!r},0\n" for v in values), encoding="utf-8")
    assert read(path).column("v").tolist() == values


@pytest.mark.parametrize("end", ["3.0,0.1", "3.0", "3.0,"])
def test_a_last_line_that_was_cut_off_is_left_out_and_said_so(tmp_path, end):
    """As a logger leaves it whose power is switched off; elsewhere a short line is refused."""
    file = tmp_path / "log.csv"
    file.write_text(f"t,u,y\n1.0,0.1,0.2\n2.0,0.1,0.3\n{end}")
    table = read(file)
    assert table.column("t").tolist() == [1.0, 2.0]
    assert table.note == "row 4, the last, is cut off and was left out"
    file.write_text(f"t,u,y\n1.0,0.1,0.2\n{end}\n3.0,0.1,0.4\n")
    with pytest.raises(AnalysisError, match="row 3 has"):
        read(file)


@pytest.mark.parametrize(
    "text",
    [
        "t u y\n0 1.5 -2\n0.01 2.5 3e-1\n",
        "  t    u     y\n  0    1.5   -2\n  0.01 2.5   3e-1 \n",
        "# t u y\n0 1.5 -2\n0.01 2.5 3e-1\n",
        "t\tu\ty\n0\t1,5\t-2\n0,01\t2,5\t3e-1\n",
    ],
    ids=["spaces", "aligned", "savetxt", "tabs and decimal commas"],
)
def test_blanks_separate_columns_and_tabs_allow_decimal_commas(tmp_path, text):
    path = tmp_path / "log.txt"
    path.write_text(text)
    table = read(path)
    assert {name: table.column(name).tolist() for name in table.columns} == {
        "t": [0.0, 0.01], "u": [1.5, 2.5], "y": [-2.0, 0.3]
    }  # fmt: skip


@pytest.mark.parametrize(
    ("text", "time"),
    [
        ("23:59:59.750 -> u,y\n23:59:59.750 -> 1.5,0\n00:00:00.000 -> -2,0\n", "monitor_time"),
        ("12:00:01.500 -> u y\n12:00:01.500 -> 1.5 0\n12:00:01.750 -> -2 0\n", "monitor_time"),
        ("12:00:01.500 -> u:1.5\ty:0\n12:00:01.750 -> u:-2\ty:0\n", "monitor_time"),
        ("t:0,u:1.5,y:0\nt:0.25,u:-2,y:0\n", "t"),
        ("t:0 u:1.5 y:0 \nt:0.25 u:-2 y:0 \n", "t"),
        ('{"t": 0, "u": 1.5, "state": "ok"}\n{"t": 0.25, "u": -2.0, "state": "ok"}\n', "t"),
        ("MPU6050 connected, address 0x68\n\nt,u,y\n0,1.5,0\n0.25,-2,0\n", "t"),
        ("t,u,y\nbus error, retry\n0,1.5,0\nbus error\n0.25,-2,0\nt,u,y\n", "t"),
        ("% made by hand\n% t u y\n 0 1.5 0\n 0.25 -2 0\n", "t"),
        ("// t,u\nt,u\n0.0D+00,1.5D0\n2.5D-01,-0.2D1\n", "t"),
        ("s, set up at 12:30\nt;u\n0;1,5\n0,25;-2\n", "t"),
        ("me:12 u:1 y:0\nt:0 u:1.5 y:0\nt:0.25 y:0 u:-2\n" + 200 * "u:0 y:0 t:1\n", "t"),
        (
            '{"boot": 1}\n{"t": 0, "u": 1.5}\n{"u": -2, "t": 0.25}\n' + 200 * '{"t": 1, "u": 0}\n',
            "t",
        ),
        ("boot\x0cx\n\nt,u,y\n0,1.5,0\n0.25,-2,0\n", "t"),
        ("offsets: -120, 34, 12\nt,u,y\n0,1.5,0\n0.25,-2,0\n1,0,0\n", "t"),
        (
            "12:00:00.000 -> # t,u\n12:00:01.500 -> u\n12:00:01.500 -> 1.5\n12:00:01.750 -> -2\n",
            "monitor_time",
        ),
    ],
)
def test_logs_of_serial_lines_are_tables(tmp_path, text, time):
    found = table(tmp_path, text, "log.txt")
    assert found.column(time).tolist()[:2] == [0.0, 0.25]
    assert found.column("u").tolist()[:2] == [1.5, -2.0]
    chatter = any(word in text for word in ("connected", "bus", "12:30", "boot\x0c", "offsets"))
    assert ("of text left out" in found.note) is chatter


def test_few_rows_that_a_serial_line_garbled_are_left_out_and_named(tmp_path):
    rows = [f"{k},{k % 7},0" for k in range(400)]
    rows[100], rows[200], rows[300] = "1", "200,5", "300,6,0,77"
    rows[50] = "50,x\x7f,0"
    found = table(tmp_path, "t,u,y\n" + "\n".join(rows) + "\n")
    assert found.column("t").tolist() == [k for k in range(400) if k not in (100, 200, 300)]
    assert np.flatnonzero(np.isnan(found.column("u"))).tolist() == [50]
    assert "3 rows of another length left out, the first row 102 with 1 fields for 3" in found.note
    assert (
        r"no number in 1 field of 'u', taken as missing, the first 'x\x7f' in row 52" in found.note
    )
    rows[102], rows[103] = "1", "2"
    with pytest.raises(AnalysisError, match="row 102 has 1 fields, the header 3"):
        table(tmp_path, "t,u,y\n" + "\n".join(rows) + "\n")


def test_labelled_lines_of_other_names_are_rows_of_another_length(tmp_path):
    lines = ["t:0 u:1", "t:1 u:2"] * 40 + ["t:2 y:1"] * 30
    with pytest.raises(AnalysisError, match="row 81 has 4 fields, the header 2"):
        table(tmp_path, "\n".join(lines) + "\n", "log.txt")


def test_few_rows_without_a_stamp_are_left_out(tmp_path):
    rows = [f"{k / 100},{k % 7},{k % 5}" for k in range(300)]
    rows[55] = "0.5x,1,2"
    r = chosen(table(tmp_path, "t,u,pot\n" + "\n".join(rows) + "\n"))
    assert len(r.angle.time) == 299
    assert "1 row without a stamp in 't' left out" in r.note


@pytest.mark.parametrize(
    ("row", "stamp", "lost"),
    [
        (55, "0.0", 55),  # goes back once
        (55, "0.54", 55),  # again the stamp before, with another reading
        (55, "99", 55),  # runs ahead once
        (0, "4294967.2", 0),
        (299, "0", 299),
    ],
)
def test_a_row_out_of_order_is_left_out_and_said_so(tmp_path, row, stamp, lost):
    rows = [[f"{k / 100}", f"{k % 7}", f"{k}"] for k in range(300)]
    rows[row][0] = stamp
    r = chosen(table(tmp_path, "t,u,pot\n" + "\n".join(map(",".join, rows)) + "\n"))
    assert r.angle.values[:, 0].tolist() == [k for k in range(300) if k != lost]
    assert "1 row whose 't' does not increase left out" in r.note


def test_rows_that_repeat_the_one_before_count_once_however_many(tmp_path):
    rows = [f"{k / 100},{k % 7},{k}" for k in range(100)]
    twice = [row for row in rows for _ in range(2)]
    r = chosen(table(tmp_path, "t,u,pot\n" + "\n".join(twice) + "\n"))
    assert r.angle.values[:, 0].tolist() == list(range(100))
    assert "100 rows repeating the one before left out" in r.note
    other = [f"{k // 2 / 100},{k % 7},{k}" for k in range(100)]  # the stamps are too coarse
    with pytest.raises(RecordingError, match="50 do not"):
        chosen(table(tmp_path, "t,u,pot\n" + "\n".join(other) + "\n"))


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ("0.3,2e303,0", "command holds values beyond 1e\\+09"),
        ("3e81,2,0", "sample 30 is 3e\\+81 s"),
    ],
)
def test_numbers_of_a_broken_file_are_refused_and_not_fitted(tmp_path, row, says):
    rows = [*(f"{k / 100},{k % 7},0" for k in range(30)), row]
    with pytest.raises(RecordingError, match=says):
        chosen(table(tmp_path, "t,u,pot\n" + "\n".join(rows) + "\n"), time_scale=1.0)


def test_a_log_begun_anew_is_refused_as_a_whole(tmp_path):
    rows = [f"{k % 200 / 100},{k % 7},{k}" for k in range(300)]
    with pytest.raises(RecordingError, match=r"from 1\.99 s to 0 s at sample 200"):
        chosen(table(tmp_path, "t,u,pot\n" + "\n".join(rows) + "\n"))


def test_a_header_longer_than_what_is_looked_at_keeps_its_separator(tmp_path):
    names = [f"column number {k:03d}" for k in range(500)]
    found = table(tmp_path, ";".join(names) + "\n" + ";".join("1,5" for _ in names) + "\n")
    assert found.column(names[-1]).tolist() == [1.5]


def test_names_with_control_characters_are_refused_in_one_line(tmp_path):
    with pytest.raises(AnalysisError, match="control characters") as error:
        table(tmp_path, '{"t\\nq": 1, "u": 2}\n{"t\\nq": 2, "u": 2}\n', "log.jsonl")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("delimiter", [",", "\t", " ", ";"])
@pytest.mark.parametrize("last", ["pots ok, starting...", "pots ok"])
def test_what_a_board_says_above_its_table_names_no_column(tmp_path, delimiter, last):
    rows = [["cmd", "pot"], *(["1.5", f"{k}"] for k in range(20)), ["cmd", "pot"], ["2", "3"]]
    lines = ["test, board Nano", "servo pins 9 10", last, *(delimiter.join(r) for r in rows)]
    text = "".join(f"12:00:00.{k:03d} -> {line}\n" for k, line in enumerate(lines))
    found = table(tmp_path, text, "log.txt")
    assert list(found.columns) == ["monitor_time", "cmd", "pot"]
    assert found.column("pot").tolist() == [*range(20), 3]
    assert found.note == "4 lines of text left out"
