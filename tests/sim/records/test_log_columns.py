"""Logs in text files: what is honoured to mean what it says, and what is refused with its line and its column."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mathnavi as mn
from mathnavi.interfaces.reading import number_blocks, tables
from mathnavi.interfaces.reading.table_format import TableFormat

SENSORS = {"position": ["a", "b"]}
NAN = float("nan")
PLAIN = [[1.5, 2.0], [-1.25, 300.0]]  # at 0 and 0.1 s


def honoured(feature: str, content: str | bytes, values: Any = PLAIN, notes: str = "", **arguments: Any) -> Any:
    return pytest.param(content, arguments, values, notes, marks=pytest.mark.honoured("CSV", feature), id=feature)


def refused(feature: str, content: str | bytes, message: str, **arguments: Any) -> Any:
    return pytest.param(content, arguments, message, marks=pytest.mark.refused("CSV", feature), id=feature)


DATE = "2024-05-01T10:00:00"
TEXT = "t,a,b\n0,1.5,2\n0.1,-1.25,3e2\n"
HONOURED = [
    honoured("comma-separated values, any order of columns", "b,note,t,a\n2,x_1,0,1.5\n3e2,,0.1,-1.25\n"),
    honoured("byte-order mark of UTF-8", TEXT.encode("utf-8-sig")),
    honoured("UTF-16 with a byte-order mark", TEXT.encode("utf-16")),
    honoured(
        "encoding that is given",
        "t,a,b [µm],°\n0,1.5,2e6,\n0.1,-1.25,3e8,\n".encode("latin-1"),
        notes="'b [µm]' was converted from µm",
        encoding="latin-1",
    ),
    honoured("line ends CR LF", TEXT.replace("\n", "\r\n")),
    honoured("line ends CR", TEXT.replace("\n", "\r")),
    honoured("separator that is given", TEXT.replace(",", ";"), sep=";"),
    honoured("separator tab", TEXT.replace(",", "\t"), sep=r"\t"),
    honoured("separator blanks", "  t a\t  b \n 0  1.5 2\n0.1 -1.25   3e2  \n", sep=r"\s+"),
    honoured("decimal comma", TEXT.replace(",", ";").replace(".", ","), sep=";", decimal=","),
    honoured("decimal comma in quotes", 't,a,b\n0,"1,5",2\n"0,1","-1,25",3e2\n', decimal=","),
    honoured(
        "marks between thousands", 't,a,b\n0,1.5,2\n0.1,-1.25,"1,300"\n', [[1.5, 2.0], [-1.25, 1300.0]], thousands=","
    ),
    honoured("quoted cells, with line breaks", 't,"a","b","no\nte"\n0, "1.5",2,"x,\ny"\n0.1,-1.25,3e2,"""q"""\n'),
    honoured("blank lines and rows of empty cells", "\nt,a,b\n0,1.5,2\n\n,,\n0.1,-1.25,3e2\n , ,\n\n"),
    honoured("blanks around cells", " t , a,b \n 0 ,1.5 , 2\n0.1,\t-1.25,3e2 \n"),
    honoured("separator at each line's end", "t,a,b,\n0,1.5,2,\n0.1,-1.25,3e2,\n"),
    honoured("comments", "# log of 7\nt,a,b # names\n0,1.5,2\n# a gap\n0.1,-1.25,3e2 # last\n", comment="#"),
    honoured("lines above the names", f"logger 7\nrate, 10\n{TEXT}", skiprows=2),
    honoured("names that are given", TEXT.partition("\n")[2], names=["t", "a", "b"]),
    honoured(
        "missing values as pandas takes them",
        "t,a,b\n0,,NaN\n0.1,NA,nan\n0.2,null,#N/A\n0.3,None,1\n",
        [[NAN, NAN], [NAN, NAN], [NAN, NAN], [NAN, 1.0]],
    ),
    honoured(
        "missing values that are given",
        "t,a,b\n0,-999.0,2\n0.1,---,3\n",
        [[NAN, 2.0], [NAN, 3.0]],
        na_values=["-999", "---"],
    ),
    honoured("infinite readings", "t,a,b\n0,inf,-Infinity\n", [[np.inf, -np.inf]]),
    honoured(
        "unit in brackets",
        "t [ms],a [deg],b (km/h)\n0,180,36\n100,-90,72\n",
        [[np.pi, 10.0], [-np.pi / 2, 20.0]],
        notes="column 't [ms]' was converted from ms, 1 ms = 0.001 s column 'a [deg]' was converted from deg, 1 deg",
    ),
    honoured(
        "unit of a column that is given",
        TEXT,
        [[np.radians(1.5), 0.002], [np.radians(-1.25), 0.3]],
        notes="column 'b' was converted from mm, 1 mm = 0.001 m",
        units={"a": "deg", "b": "mm"},
    ),
    honoured(
        "unit that is given against the one in brackets",
        "t,a [deg],b\n0,1.5,2\n0.1,-1.25,3e2\n",
        notes="'a [deg]' is in rad, as units says, and not in deg",
        units={"a": "rad"},
    ),
    honoured(
        "row of units below the names",
        "t,a,b,n\nms,mm,m s^-1,\n0,1500,2,\n100,-1250,3e2,\n",
        notes="line 2 holds units",
    ),
    honoured(
        "brackets that hold no unit",
        "t,a[0],b (left)\n0,1.5,2\n0.1,-1.25,3e2\n",
        readings={"position": ["a[0]", "b (left)"]},
    ),
    honoured("times in a unit among those of columns", TEXT.replace("0.1", "100"), units={"t": "msec"}),
    honoured(
        "times in a unit that is given",
        TEXT.replace("0.1", "100"),
        notes="column 't' was converted from ms, 1 ms = 0.001 s",
        time_unit="ms",
    ),
    honoured(
        "last line without a line end",
        TEXT.rstrip("\n"),
        notes="line 3 does not end: its last number, 3e2, may be cut off",
    ),
    honoured("last line cut off within a cell that is not read", TEXT.replace("\n", ",ok\n")[:-2]),
    honoured(
        "last line cut off, too few cells: left out", f"{TEXT}0.2,1.", notes="line 4 is cut off and left out: '0.2,1.'"
    ),
    honoured("last line cut off within an exponent: left out", f"{TEXT}0.2,1,1e", notes="line 4 is cut off"),
    honoured(
        "last line cut off within the decimals that all have: left out",
        "t,a,b\n0,1.5,2.000\n0.1,-1.25,300.000\n0.2,1,7.1",
        notes="line 4 is cut off",
    ),
    honoured("last line of null bytes: left out", TEXT.encode() + bytes(64), notes="line 4 is cut off"),
]


@pytest.mark.parametrize(("content", "arguments", "values", "notes"), HONOURED)
def test_a_file_means_what_it_says(
    content: str | bytes, arguments: Any, values: Any, notes: str, tmp_path: Path
) -> None:
    log = mn.SensorLog.from_csv(written(tmp_path, content), **{"readings": SENSORS, **arguments})
    np.testing.assert_allclose(log.readings["position"], values, rtol=1e-15)
    np.testing.assert_allclose(log.t, 0.1 * np.arange(len(values)), rtol=1e-15)
    assert notes in " ".join(log.notes)
    assert bool(notes) or not [note for note in log.notes if "converted" not in note]


EPOCH = 1_700_000_000
STAMPS = "2023-11-14T22:13:20.000000001,2023-11-14T22:13:20.100000001"  # EPOCH s and 1 ns
CLOCKS = [
    honoured("times in ns since an epoch", f"{EPOCH}000000001,{EPOCH}100000001", f"{EPOCH}.000000001", time_unit="ns"),
    honoured("times in us since an epoch", f"{EPOCH}000001,{EPOCH}100001", f"{EPOCH}.000001", time_unit="us"),
    honoured("times in s since an epoch", f"{EPOCH}.000000001,{EPOCH}.100000001", f"{EPOCH}.000000001"),
    honoured("times of ISO 8601 without a zone", STAMPS, f"{EPOCH}.000000001", time_unit="iso"),
    honoured(
        "times of ISO 8601 with a zone",
        STAMPS.replace("T22:", " 23:").replace("1,", "1+01:00,") + "+0100",
        f"{EPOCH}.000000001",
        time_unit="iso",
    ),
]


@pytest.mark.parametrize(("content", "arguments", "start", "notes"), CLOCKS)
def test_times_since_an_epoch_lose_nothing(
    content: str, arguments: Any, start: str, notes: str, tmp_path: Path
) -> None:
    one, two = content.split(",")
    log = mn.SensorLog.from_csv(written(tmp_path, f"t,a,b\n{one},1,2\n{two},1,2\n"), readings=SENSORS, **arguments)
    assert log.t.tolist() == [0.0, 0.1]
    assert log.start == Decimal(start)


REFUSED = [
    refused("unit of times given twice", TEXT, "for the times, and time_unit is 's'", units={"t": "ms"}, time_unit="s"),
    refused("unit of times that is given and is none", TEXT, r"time_unit = 'm'; allowed: s, ms", units={"t": "m"}),
    refused("another separator", TEXT.replace(",", ";"), r"no column 't'; it has t;a;b; sep=';' allows it"),
    refused(
        "another separator and a decimal comma",
        TEXT.replace(",", ";").replace(".", ","),
        r"sep=';', decimal=',' allows it",
    ),
    refused("another separator behind quotes", '"t"\t"a"\t"b"\n0\t1\t2\n', r"line 1: .*; sep='\\t' allows it"),
    refused(
        "decimal comma", 't,a,b\n0,"1,5",2\n', r"line 2, column 'a': '1,5'; allowed: a number.*; decimal=',' allows it"
    ),
    refused("decimal point beside a decimal comma", "t;a;b\n0;1.5;2\n", r"column 'a': '1\.5'", sep=";", decimal=","),
    refused("marks between thousands", 't,a,b\n0,1,"1,300.5"\n', r"'1,300\.5'; .*; thousands=',' allows it"),
    refused("marks between thousands at other places", 't,a,b\n0,1,"1,30"\n', r"'1,30'", thousands=","),
    refused("underscore in a number", "t,a,b\n0,1_5,2\n", r"line 2, column 'a': '1_5'; allowed: a number"),
    refused("hexadecimal number", "t,a,b\n0,0x1f,2\n", r"line 2, column 'a': '0x1f'"),
    refused("exponent of Fortran", "t,a,b\n0,1d5,2\n", r"line 2, column 'a': '1d5'"),
    refused("digits of another script", "t,a,b\n0,１.５,2\n", r"line 2, column 'a': '１.５'"),
    refused("number too large for a double", "t,a,b\n0,1e999,2\n", r"line 2, column 'a': '1e999'"),
    refused("unit in a cell", "t,a,b\n0,1.5 m,2\n", r"line 2, column 'a': '1.5 m'"),
    refused("too few cells", "t,a,b\n0,1,2\n\n0.1,1\n0.2,1,2\n", r"line 4: 2 cells; allowed: 3"),
    refused("too many cells", "t,a,b\n0,1,2,3\n", r"line 2: 4 cells; allowed: 3"),
    refused("names repeated in the middle", f"{TEXT}{TEXT}", r"line 4: it repeats the names"),
    refused("two columns of one name", "t,a,a,b\n0,1,1,2\n", r"there are 2 columns 'a'; it has t, a, a, b"),
    refused("column that is missing", "t,A,b\n0,1,2\n", r"no column 'a'; it has t, A, b; did you mean 'A'\?"),
    refused("no names", "0,1.5,2\n0.1,1,2\n", r"first line holds numbers: names=\[\.\.\.\] with 3 names allows it"),
    refused("lines above the names", f"log 7\n\n{TEXT}", r"no column 't'; it has log 7; skiprows=2 allows it"),
    refused("comments", "# log of 7\n# rate\n0,1,2\n", r"comment='#' leaves out the lines that begin so"),
    refused(
        "another encoding",
        "t,a,b,°\n0,1,2,3\n".encode("latin-1"),
        r"line 1: it is not text in utf-8 \(byte 0xb0\); allowed: .*'cp1252'",
    ),
    refused("UTF-16 without a mark", TEXT.encode("utf-16-le"), r"allowed with encoding='utf-16-le'"),
    refused(
        "encoding against the byte-order mark", TEXT.encode("utf-16"), r"byte-order mark of utf-16", encoding="latin-1"
    ),
    refused("null bytes", "t,a,b\n0,1,2\n\0\0\n0.1,1,2\n", r"line 3: it has null bytes"),
    refused("quotes that do not end", 't,a,b\n0,"1,2\n0.1,1,2\n', r"line \d: unexpected end of data"),
    refused("compressed file", b"\x1f\x8b\x08", r"is a gzip archive"),
    refused("workbook", b"PK\x03\x04", r"is a zip archive or a workbook"),
    refused("empty file", "", r"it has no line"),
    refused("no rows", "t,a,b\n", r"it has no row below the names"),
    refused("no time", "t,a,b\n0,1,2\n,1,2\n", r"line 3, column 't': no time"),
    refused("times that go back", "t,a,b\n0,1,2\n\n1,1,2\n0.5,1,2\n", r"line 5, column 't': 0\.5 s comes after 1 s"),
    refused(
        "times of ISO 8601 as numbers", "t,a,b\n2024-05-01T10:00:00Z,1,2\n", r"is a date; time_unit='iso' allows it"
    ),
    refused("times in ns as s", f"t,a,b\n{EPOCH}000000000,1,2\n", r"is no time in s; time_unit='ns' allows it"),
    refused("numbers as dates", "t,a,b\n0.5,1,2\n", r"line 2, column 't': '0\.5' is no date", time_unit="iso"),
    refused(
        "date among dates that is none",
        f"t,a,b\n{DATE}Z,1,2\n2024-05-01T10:61:00Z,1,2\n",
        r"line 3, .* is no date",
        time_unit="iso",
    ),
    refused(
        "dates with and without a zone",
        f"t,a,b\n{DATE}Z,1,2\n2024-05-01T10:00:01,1,2\n",
        r"line 3, .* all or none",
        time_unit="iso",
    ),
    refused(
        "name of times that ends in a unit",
        "t_ms,a,b\n0,1,2\n",
        r"'t_ms' may be in ms; allowed with time_unit='ms'",
        time="t_ms",
    ),
    refused(
        "unit of times that is none", "t [m],a,b\n0,1,2\n", r"'t \[m\]' has the unit 'm'; allowed with time_unit=UNIT"
    ),
    refused(
        "name that ends in a unit",
        "t,a_deg,b\n0,1,2\n",
        r"may be in deg; units=\{'a_deg': 'deg'\} converts it",
        readings={"x": ["a_deg"]},
    ),
    refused(
        "unit in brackets that is not known",
        "t,a [counts],b\n0,1,2\n",
        r"unit 'counts', which is not known; allowed with units=\{'a \[counts\]': UNIT\}",
    ),
    refused(
        "unit that is given and not known",
        TEXT,
        r"units = \{'a': 'furlong'\}; allowed: units such as deg",
        units={"a": "furlong"},
    ),
    refused("unit of a column that is not read", TEXT, r"units names 'c', which is neither time", units={"c": "deg"}),
    refused(
        "input without a value",
        "t,a,b\n0,1,2\n1,1,\n",
        r"line 3, column 'b': nan; allowed: finite inputs",
        inputs=["b"],
    ),
]


@pytest.mark.parametrize(("content", "arguments", "message"), REFUSED)
def test_what_a_log_cannot_mean_is_refused_with_its_place(
    content: str | bytes, arguments: Any, message: str, tmp_path: Path
) -> None:
    with pytest.raises(mn.LogError, match=message) as refusal:
        mn.SensorLog.from_csv(written(tmp_path, content), **{"readings": SENSORS, **arguments})
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"sep": "ab"}, "sep = 'ab'; allowed: one character"),
        ({"decimal": "x"}, "decimal = 'x'; allowed"),
        ({"decimal": ",", "thousands": ","}, "thousands = ','; allowed"),
        ({"encoding": "klingon"}, "encoding = 'klingon'; allowed"),
        ({"comment": "//"}, "comment = '//'; allowed: one character"),
        ({"skiprows": -1}, "skiprows = -1; allowed"),
        ({"readings": {"ranges": "front"}}, r"readings\['ranges'\] = 'front'; allowed: a list, \['front'\]"),
        ({"inputs": "v"}, "inputs = 'v'; allowed: a list"),
    ],
)
def test_an_argument_out_of_its_range_is_refused(arguments: Any, message: str, tmp_path: Path) -> None:
    with pytest.raises(mn.FieldError, match=message):
        mn.SensorLog.from_csv(written(tmp_path, TEXT), **{"readings": SENSORS, **arguments})


CELLS = st.one_of(
    st.floats(allow_nan=False).map(repr),
    st.integers(-(10**20), 10**20).map(str),
    st.sampled_from(
        ["", "1_5", "0x1f", "1e", ".", "+.5", "5.", "-0", "1e-400", "1e999", "inf", "nan", "NA", "١", "1.5 "]
    ),
    st.sampled_from(["1 2", "--1", "1e+05", "infinity", "+nan", "1.e2", "00012", "#"]),
)


@settings(max_examples=60, deadline=None)
@given(rows=st.lists(st.tuples(CELLS, CELLS), min_size=1, max_size=4))
def test_numbers_are_the_same_whether_a_block_is_read_whole_or_cell_by_cell(
    rows: list[tuple[str, str]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    """A quoted cell in a column that is not read has a block read cell by cell; a large one is read by pyarrow."""
    folder = tmp_path_factory.mktemp("tables")
    found, form = [], TableFormat()
    for note, large in (('"1"', 0), ("1", 0), ("1", number_blocks.LARGE)):
        path = written(folder, "t,a,b,n\n" + "".join(f"{k},{a},{b},{note}\n" for k, (a, b) in enumerate(rows)))
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(number_blocks, "LARGE", large)
            try:
                head = tables.read_head(path, form, ValueError)
                found.append(repr(tables.read_table(path, form, head, [1, 2], [0], ValueError).numbers.tolist()))
            except ValueError as error:
                found.append(str(error))
    assert found[0] == found[1] == found[2]


def test_blocks_of_a_large_file_join_without_a_seam(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of a few bytes, so that lines, quoted cells and characters of several bytes lie across their ends."""
    monkeypatch.setattr(tables, "_BLOCK", 7)
    rows = [f'{k},{k / 7!r},"{k},5","µ\n{k}"' for k in range(50)]
    path = written(tmp_path, "t,a,b,n\r\n" + "\r\n".join(rows) + "\r\n")
    log = mn.SensorLog.from_csv(path, readings={"x": ["a"]})
    np.testing.assert_array_equal(log.readings["x"][:, 0], np.arange(50) / 7)


def written(folder: Path, content: str | bytes) -> Path:
    path = folder / "log.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path
