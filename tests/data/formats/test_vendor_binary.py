"""GRAMS SPC, Bruker OPUS, PerkinElmer .sp and JASCO .jws, written here from the published layouts.

Sources: GRAMS file specification (SPC.H) of Galactic; directory and parameter blocks of OPUS as in
brukeropus; blocks of .sp as in specio; DataInfo of .jws as in jws2txt, in a compound file of MS-CFB.
"""

import struct
import sys
from itertools import pairwise

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectra, read_spectrum

pytest.importorskip("openreadout")

X = np.array([400.0, 500.0, 600.0, 700.0])
Y = np.array([0.125, 0.25, 0.375, 0.5])


def spc(spectra=(Y,), first=400.0, last=700.0, axis=3, quantity=129, x=None, points=None):
    """New format, 0x4B: a header of 512 bytes, x as float32 if uneven, subfiles with headers of 32 bytes."""
    flags = (0x80 if x is not None else 0) | (0x04 if len(spectra) > 1 else 0)
    date = (2024 << 20) | (5 << 16) | (6 << 11) | (10 << 6) | 30
    count = len(spectra[0]) if points is None else points
    numbers = (flags, 0x4B, 0, -128, count, first, last, len(spectra), axis, quantity, 0, 0, date, b"")
    numbers += (b"Lambda 9", 0, b"", b"oxide", b"", *(0,) * 5, 0.0, b"", 0.0, 0, 0.0, 0, b"")
    content = struct.pack("<BBBbIddIBBBBI9s9sH32s130s30sIIBBHf48sfIfB187s", *numbers)
    assert len(content) == 512
    content += b"" if x is None else np.asarray(x, "<f4").tobytes()
    for i, y in enumerate(spectra):
        content += struct.pack("<BbHfffIIf4s", 0, -128, i, i, i + 1, 0, 0, 1, 0, b"")
        content += np.asarray(y, "<f4").tobytes()
    return content


def old_spc(exponent=1):
    """Old format, 0x4D: a header of 256 bytes, then integers whose halves are exchanged."""
    numbers = (0, 0x4D, exponent, 4.0, 400.0, 700.0, 3, 128, 1994, 2, 3, 4, 5, b"", 0, 1, b"", b"", b"", b"")
    content = struct.pack("<BBhfffBBHBBBB8sHH28s130s30s32s", *numbers)
    assert len(content) == 256
    numbers = [round(y * 2 ** (32 - exponent)) for y in Y]
    return content + b"".join(struct.pack("<HH", n >> 16, n & 0xFFFF) for n in numbers)


def parameters(**values):
    """A parameter block of OPUS: a name, a type, a length in halves of words, and a value."""
    content = b""
    for name, value in values.items():
        if isinstance(value, int):
            kind, packed = 0, struct.pack("<i", value)
        elif isinstance(value, float):
            kind, packed = 1, struct.pack("<d", value)
        else:
            kind, packed = 2, value.encode("latin-1").ljust(len(value) // 2 * 2 + 2, b"\0")
        content += name.encode() + b"\0" + struct.pack("<hh", kind, len(packed) // 2) + packed
    return content + b"END\0\0\0\0\0"


ABSORBANCE, TRANSMITTANCE, KUBELKA, REFLECTANCE, SINGLE = 4, 5, 6, 12, 1
RATIOED, SAMPLE = 3, 1


def opus(*kinds, unit="WN", points=4, scale=1.0):
    """An OPUS file with a data block and its parameters for each (type of data, role)."""
    stated = parameters(DPF=1, NPT=points, FXV=4000.0, LXV=1000.0, CSF=scale, MXY=0.5, MNY=0.1, DXU=unit)
    blocks = [(2 << 4, parameters(INS="Vertex 70")), (10 << 4, parameters(SNM="wafer 3"))]
    for kind, role in kinds:
        code = 3 | role << 2 | kind << 10
        blocks += [(code | 1 << 4, stated), (code, Y.astype("<f4").tobytes())]
    room, content, at = 40, b"", 24 + 12 * 40
    entries = struct.pack("<iii", 13 << 10, 3 * room, 24)
    for code, block in blocks:
        block += bytes(-len(block) % 4)
        entries += struct.pack("<iii", code, len(block) // 4, at + len(content))
        content += block
    head = b"\n\n\xfe\xfe" + struct.pack("<diii", 920622.0, 24, room, len(blocks) + 1)
    return head + entries.ljust(12 * room, b"\0") + content


def sp(axis="cm-1", quantity="%T", points=4):
    """A .sp file: block 120 with typed members for ranges, number, labels and data."""

    def member(number, kind, content):
        return struct.pack("<HiH", number, len(content) + 2, kind) + content

    def text(number, string):
        return member(number, 29987, struct.pack("<h", len(string)) + string.encode())

    data = (100 * Y).astype("<f8").tobytes()
    members = (
        member(35698, 29981, struct.pack("<dd", 4000.0, 1000.0))
        + member(35699, 29981, struct.pack("<dd", 12.5, 50.0))
        + member(35700, 29979, struct.pack("<d", -1000.0))
        + member(35701, 29995, struct.pack("<i", points))
        + text(35703, axis)
        + text(35704, quantity)
        + member(35708, 29974, struct.pack("<i", len(data)) + data)
        + text(35709, "wafer 3")
    )
    head = b"PEPE" + b"2D constant interval DataSet file".ljust(40)
    return head + struct.pack("<Hi", 120, len(members)) + members


def compound_file(streams):
    """A compound file (MS-CFB, version 3) of streams below 4096 bytes, in a chain of directory entries."""
    sector, unused, end = 512, 0xFFFFFFFF, 0xFFFFFFFE
    small, chain, entries = b"", [], []
    for name, data in streams.items():
        first, count = len(small) // 64, -(-len(data) // 64)
        small += data.ljust(64 * count, b"\0")
        chain += [*range(first + 1, first + count), end]
        entries.append((name, first, len(data)))
    sizes = [-(-(len(entries) + 1) * 128 // sector), -(-4 * len(chain) // sector), -(-len(small) // sector)]
    table, starts = [0xFFFFFFFD], []  # the table of sectors is the first of them
    for size in sizes:
        starts.append(len(table))
        table += [*range(starts[-1] + 1, starts[-1] + size), end]

    def entry(name, kind, start, size, right=unused, child=unused):
        text = (name + "\0").encode("utf-16-le")
        head = text.ljust(64, b"\0") + struct.pack("<HBBIII", len(text), kind, 1, unused, right, child)
        return head + bytes(36) + struct.pack("<IQ", start, size)

    order = sorted(range(len(entries)), key=lambda i: (len(entries[i][0]), entries[i][0].upper()))
    following = {i: j + 1 for i, j in pairwise(order)}
    directory = entry("Root Entry", 5, starts[2], len(small), child=order[0] + 1)
    for i, (name, first, size) in enumerate(entries):
        directory += entry(name, 2, first, size, right=following.get(i, unused))
    head = bytes.fromhex("d0cf11e0a1b11ae1") + bytes(16)
    places = (0, 1, starts[0], 0, 4096, starts[1], sizes[1], end, 0)
    head += struct.pack("<HHHHH6xIIIIIIIII", 0x3E, 3, 0xFFFE, 9, 6, *places)
    head += struct.pack("<I", 0) + struct.pack("<I", unused) * 108
    parts = [
        struct.pack(f"<{len(table)}I", *table).ljust(sector, b"\xff"),
        directory.ljust(sizes[0] * sector, b"\0"),
        struct.pack(f"<{len(chain)}I", *chain).ljust(sizes[1] * sector, b"\xff"),
        small.ljust(sizes[2] * sector, b"\0"),
    ]
    return head + b"".join(parts)


NM, WAVENUMBER, RAMAN = 0x10000103, 0x10000100, 0x10000101
JWS_TRANSMITTANCE, JWS_REFLECTANCE, JWS_ABSORBANCE, JWS_SINGLE = 0, 2, 3, 8


def jws(axis=NM, quantity=JWS_REFLECTANCE, y=100 * Y, points=None):
    """A .jws file: its header, the axis and codes of the channel in DataInfo, float32 in Y-Data."""
    count = len(y) if points is None else points
    codes, limits = (axis, quantity) * 2, (400.0, 12.5, 700.0, 50.0)
    info = struct.pack("<LLLLLLdddLLLLdddd", 3, 1, 0, 1, 1, count, 400.0, 700.0, 100.0, *codes, *limits)
    header = "L~S ".encode("utf-16-le") + "SPCMAN".encode("utf-16-le") + bytes(60)
    return compound_file({"Header": header, "DataInfo": info, "Y-Data": np.asarray(y, "<f4").tobytes()})


WAVENUMBERS = np.array([4000.0, 3000.0, 2000.0, 1000.0])
READ = {
    "SPC, R against nm": (spc(), "R", X, Y),
    "SPC, T against cm-1": (spc(axis=1, quantity=128), "T", 1e7 / X[::-1], Y[::-1]),
    "SPC, absorbance against um": (spc(axis=2, quantity=2), "T", 1e3 * X, 10**-Y),
    "SPC, log(1/R) against eV": (
        spc(axis=14, quantity=10, first=1.0, last=4.0), "R", 1239.8419843 / np.arange(4, 0, -1),
        10 ** -Y[::-1],
    ),
    "SPC, uneven x": (spc(x=[400, 500, 650, 700]), "R", [400, 500, 650, 700], Y),
    "SPC, old format": (old_spc(), "T", X, Y),
    "OPUS, T": (opus((TRANSMITTANCE, RATIOED)), "T", 1e7 / WAVENUMBERS, Y),
    "OPUS, R": (opus((REFLECTANCE, RATIOED)), "R", 1e7 / WAVENUMBERS, Y),
    "OPUS, absorbance": (opus((ABSORBANCE, RATIOED)), "T", 1e7 / WAVENUMBERS, 10**-Y),
    "OPUS, scaled": (opus((TRANSMITTANCE, RATIOED), scale=2.0), "T", 1e7 / WAVENUMBERS, 2 * Y),
    "OPUS, single beam beside": (
        opus((SINGLE, SAMPLE), (TRANSMITTANCE, RATIOED)), "T", 1e7 / WAVENUMBERS, Y,
    ),
    ".sp, %T": (sp(), "T", 1e7 / WAVENUMBERS, Y),
    ".sp, %R": (sp(quantity="%R"), "R", 1e7 / WAVENUMBERS, Y),
    ".sp, words": (sp(axis="Nanometers", quantity="%T"), "T", WAVENUMBERS[::-1], Y[::-1]),
    ".sp, A": (sp(axis="nm", quantity="A"), "T", WAVENUMBERS[::-1], 10 ** (-100 * Y[::-1])),
    ".jws, R": (jws(), "R", X, Y),
    ".jws, T against cm-1": (jws(WAVENUMBER, JWS_TRANSMITTANCE), "T", 1e7 / X[::-1], Y[::-1]),
    ".jws, absorbance": (jws(quantity=JWS_ABSORBANCE, y=Y), "T", X, 10**-Y),
}  # fmt: skip
SAMPLES = {name: case[0] for name, case in READ.items()}  # for `make fuzz`


@pytest.mark.parametrize("name", READ)
def test_quantity_axis_and_values(name, write):
    content, signal, wavelength, values = READ[name]
    found = read_spectrum(write(content, "renamed"))
    assert found.signal == signal
    np.testing.assert_allclose(found.wavelength, wavelength, rtol=1e-7)
    np.testing.assert_allclose(found.values, values, rtol=1e-6)


def test_facts_are_kept(write):
    facts = dict(read_spectrum(write(opus((TRANSMITTANCE, RATIOED)))).declared)
    assert facts == {"format": "Bruker OPUS", "instrument": "Vertex 70", "sample": "wafer 3"}
    facts = dict(read_spectrum(write(spc())).declared)
    assert (facts["format"], facts["instrument"]) == ("GRAMS SPC", "Lambda 9")
    assert facts["date"].startswith("2024-05-06T10:30")


def test_percent_without_a_quantity_asks_for_the_signal(write, refused):
    content = spc((100 * Y,), quantity=11)
    refused(content, 'signal="R"', "%")
    np.testing.assert_allclose(read_spectrum(write(content), signal="T").values, Y, rtol=1e-6)


def test_several_spectra_are_chosen_by_name(write, refused):
    content = spc((Y, Y / 2))
    message = refused(content, "has 2 spectra")
    names = [one.name for one in read_spectra(write(content), spectrum="all")]
    assert len(set(names)) == 2
    assert all(name in message for name in names)
    np.testing.assert_allclose(read_spectrum(write(content), spectrum=names[1]).values, Y / 2, rtol=1e-6)


def test_points_that_jasco_marks_as_not_measured_are_left_out(write):
    found = read_spectrum(write(jws(y=[12.5, -1.1754944e-38, 37.5, 50.0])))
    np.testing.assert_allclose(found.wavelength, [400, 600, 700])


MOST_FIRST = b"\0\x4c" + struct.pack(">2xIdd", 4, 400, 700) + bytes(600)
REFUSED = {
    "SPC counts": (spc(quantity=4), "neither a reflectance nor a transmittance"),
    "SPC Kubelka-Munk": (spc(quantity=3), "neither a reflectance nor a transmittance"),
    "SPC intensity": (spc(quantity=0), 'signal="R"'),
    "SPC against time": (spc(axis=4), "'time (s)', which is no wavelength"),
    "SPC arbitrary axis": (spc(axis=0), "`wavelength_unit`"),
    "SPC most significant byte first": (MOST_FIRST, "export it as CSV"),
    "OPUS single beam": (opus((SINGLE, SAMPLE)), "'single beam' is neither"),
    "OPUS unknown axis": (opus((TRANSMITTANCE, RATIOED), unit="WL"), "`wavelength_unit`"),
    ".sp energy": (sp(quantity="EGY"), "'EGY' is neither a reflectance nor a transmittance"),
    ".sp unknown axis": (sp(axis="furlongs"), "which is no wavelength"),
    ".jws single beam": (jws(quantity=JWS_SINGLE), "'single beam' is neither"),
    ".jws unknown": (jws(quantity=77), "neither a reflectance nor a transmittance"),
    ".jws Raman": (jws(axis=RAMAN), "no wavelength"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_other_quantities_and_axes_are_refused(name, refused):
    content, words = REFUSED[name]
    refused(content, words)


DAMAGED = {
    "SPC cut short": spc()[:-6],
    "SPC without its values": spc()[:512],
    "SPC of 10^9 points": spc(points=1_000_000_000),
    "OPUS cut short": opus((TRANSMITTANCE, RATIOED))[:-6],
    "OPUS of 10^9 points": opus((TRANSMITTANCE, RATIOED), points=1_000_000_000),
    "OPUS without blocks": opus((TRANSMITTANCE, RATIOED))[:24],
    ".sp cut short": sp()[:-80],
    ".sp of 10^9 points": sp(points=1_000_000_000),
    ".jws cut short": jws()[:-700],
    ".jws of 10^9 points": jws(points=1_000_000_000),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_are_refused(name, refused):
    refused(DAMAGED[name], "export")


@pytest.mark.parametrize("content", [spc(), opus((TRANSMITTANCE, RATIOED)), sp(), jws()])
def test_the_extra_is_named(content, refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "openreadout", None)
    refused(content, "openreadout", "pip install 'pellicle[formats]'")


def test_text_whose_second_letter_is_a_version_of_spc_is_text(write):
    text = "AKLM\0\0\0\0 padded\nwavelength_nm,R\n400,0.1\n500,0.2\n" + " " * 600
    np.testing.assert_allclose(read_spectrum(write(text)).values, [0.1, 0.2])


def test_binary_files_that_are_not_read_are_named(refused):
    refused(b"AVS84\x00\x01\x02" + bytes(400), "AvaSoft 8", "export it as text")
    refused(b"Spectral Data File\x00" + bytes(400), "OMNIC", "JCAMP-DX")
