"""Text of models in the layout of CompleteEASE's `.mod` files, written here from numbers."""

import base64
import gzip

import numpy as np

TAIL = "F\tF\t0.0\t0.0\t100000.0\tF\t100.0\t"


def line(name, value, free=False, lower=-10.0, upper=100000.0):
    """The line of a parameter."""
    return f"{value}\t{'T' if free else 'F'}\t{lower}\t{upper}\tF\t'{name}'\t{TAIL}"


def block(name, *rows):
    """Rows between the first and the last line of a block."""
    return [f"start_{name}", *rows, "", f"end_{name}"]


def array(values):
    """Numbers of a table as base64 of gzip of four bytes each, the most significant first."""
    return f"'{base64.b64encode(gzip.compress(np.asarray(values, '>f4').tobytes(), mtime=0)).decode()}'"


def table(name, angstroms, index):
    """The medium of a layer that is a table."""
    eps = np.asarray(index) ** 2
    columns = zip(("Wvl", "e1", "e2"), (angstroms, eps.real, eps.imag), strict=True)
    arrays = [x for word, values in columns for x in block(f"{word} Array", array(values))]
    return [
        f"'Layer'\t'{name}'\t'EV'\t''\t'{name}'",
        *block("File Info", "'measured here'", "1"),
        *block("Mat Table", str(len(angstroms)), *arrays),
        *block(f"{name} Fit Parms"),
    ]


def cauchy(name, *numbers, edge=4000.0):
    """A Cauchy layer from the lines of A, B, C, the amplitude and the exponent of k."""
    return [f"'Layer'\t'{name}'\t'CAUCHY'\t''\t'{name}'", *block(f"{name} Fit Parms", *numbers, str(edge))]


def oscillators(name, einf, *terms, poles=(0.0, 11.0, 0.0), grade="F", used=None):
    """A Gen-Osc layer; each of `terms` is a name, its lines, and whether a flag follows."""
    rows = [f"{len(terms)}\t{einf}"]
    for kind, lines, flag in terms:
        rows += [f"'{kind}'", *lines, *(["F"] if flag else [])]
    words = ("UV Pole Amp.", "UV Pole En.", "IR Pole Amp.")
    lines = [line(word, x, False, -1000, 1000) for word, x in zip(words, poles, strict=True)]
    return [
        f"'Layer'\t'{name}'\t'GENOSC'\t''\t'{name}'",
        *block(f"{name} Misc Parms", "1\tT"),
        *block(f"{name} Fit Parms", *rows),
        *block(f"{name} Grade Parms", grade, line("Grade 1", 0.0)),
        *block(f"{name} Energy Units", "F\t'eV'"),
        *block(f"{name} Permanent Poles", *lines, "F", line("Urbach Transition Energy", 2.0)),
        *block(f"{name}Enabled Oscillators", *([] if used is None else ["\t".join(used)])),
    ]


def model(substrate, *layers, rough=None, offset=0.0, back=None, calculation="Ideal", more=()):
    """A model; each of `layers`, from the substrate up, is its line of thickness and its medium."""
    back_lines = back or (line("# Back Reflections", 5.0), line("% 1st Reflection", 100.0))
    head = [
        f"{1 + len(layers)}\t0",
        line("Angle Offset", offset, bool(offset), -5.0, 5.0),
        *("F" if rough is None else "T", line("Roughness", 0.0) if rough is None else rough),
        *("F", "100", "''", "NaN", "NaN", "-1", ""),
        *("T" if back else "F", *back_lines),
        *("T", "2000.0\t18000.0", "F", "'N,C,S'"),
        f"'{calculation}'",
        line("% Thickness Non-uniformity", 0.0),
        *block("Ambient", "F", "'(Not Specified)'"),
        *block("MultiSamp", "0\t0"),
        *block("Multiple Angle Offsets", "1", f"50.0\t{line('50.0° Angle Offset', 0.1)}", "F"),
        *more,
    ]
    every = [[line("Substrate Thickness", 1e7), *substrate], *([size, *medium] for size, medium in layers)]
    stack = [x for i, rows in enumerate(every) for x in block(f"Layer{i}", *rows, *block("SL Parms", "0\t1"))]
    rows = [
        *("", "ALPHA_MULTILAYER", "", *block("Model Version", "4\t6"), *block("Model Parms", *head)),
        *block("Derived Parms", "F"),
        *block("Model Structure", *stack),
    ]
    return "\ufeff" + "\r\n".join("\t" + row for row in rows)
