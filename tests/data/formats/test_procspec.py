"""ProcSpec files of Ocean Optics in the layout that lightr and Veusz read, and hostile zips and XML."""

import io
import sys
import zipfile

import numpy as np
import pytest

from pellicle.data.read_spectrum import read_spectrum
from pellicle.errors import DataError
from tests.data.tables import assert_read

pytest.importorskip("defusedxml")

ROOT = "com.oceanoptics.spectrasuite.processors.ProcessedSpectrum"
WAVELENGTH, COUNTS, PERCENT = [400.5, 410.25, 420.0], [1000.0, 2000.0, 1500.0], [30.5, 40.25, 45.0]


def doubles(tag, values):
    return f"<{tag}>{''.join(f'<double>{value}</double>' for value in values)}</{tag}>"


def document(processed=PERCENT, processor="ReflectionProcessor", wavelength=WAVELENGTH, head=""):
    """A spectrum as SpectraSuite writes it, with a sample and a dark spectrum and bytes that XML forbids."""
    counts = doubles("channelWavelengths", wavelength) + doubles("pixelValues", COUNTS)
    facts = (
        "<spectrometerClass>com.oceanoptics.omnidriver.spectrometer.usb.USB2000Plus</spectrometerClass>"
        "<spectrometerSerialNumber>U12</spectrometerSerialNumber><userName>Ren\xe9\x01</userName>"
        "<acquisitionTime><milliTime>1577836800000</milliTime></acquisitionTime>"
    )
    values = doubles("processedPixels", processed) if processed else "<processedPixels/>"
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n{head}<{ROOT}>'
        f"<sourceSpectra>{counts}{facts}</sourceSpectra>"
        f"<darkSpectrum>{doubles('pixelValues', [9.0, 9.0, 9.0])}</darkSpectrum>"
        f'<processor class="com.oceanoptics.spectrasuite.processors.{processor}"/>{values}</{ROOT}>'
    )


def procspec(*documents, names=None):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("OOISignatures.xml", "<signatures/>")
        archive.writestr("OOIVersion.txt", "2.0")
        for i, text in enumerate(documents):
            archive.writestr(names[i] if names else f"ps_{i}.xml", text.encode("latin-1"))
    return buffer.getvalue()


def test_the_processed_spectrum_is_read(write):
    found = read_spectrum(write(procspec(document())), signal_unit="percent")
    assert_read(found, signal="R", wavelength=WAVELENGTH, values=np.array(PERCENT) / 100)
    facts = dict(found.declared)
    assert facts["instrument"] == "USB2000Plus U12"
    assert facts["date"] == "2020-01-01 00:00:00 UTC"


def test_modes(write):
    content = procspec(document(processor="TransmissionProcessor"))
    assert read_spectrum(write(content), signal_unit="percent").signal == "T"
    content = procspec(document(processed=[0.5, 1.0, 2.0], processor="AbsorbanceProcessor"))
    np.testing.assert_allclose(read_spectrum(write(content)).values, [10**-0.5, 0.1, 0.01])


def test_a_mode_that_the_file_does_not_state_is_asked_for(write, refused):
    content = procspec(document(processor="Processor7"))
    refused(content, 'signal="R"')
    found = read_spectrum(write(content), signal="T", signal_unit="percent")
    np.testing.assert_allclose(found.values, np.array(PERCENT) / 100)


def test_counts_and_irradiance_are_named(refused):
    refused(procspec(document(processed=None)), "counts", "neither a reflectance nor a transmittance")
    refused(procspec(document(processor="IrradianceProcessor")), "irradiance", "neither")


def test_several_spectra(write):
    content = procspec(document(), document(processed=[1.0, 2.0, 3.0]))
    second = read_spectrum(write(content), spectrum="R (not stated) (2)", signal_unit="percent")
    np.testing.assert_allclose(second.values, [0.01, 0.02, 0.03])


ENTITIES = '<!DOCTYPE a [<!ENTITY x "xxxxxxxxxx"><!ENTITY y "&x;&x;&x;&x;&x;&x;&x;"><!ENTITY z "&y;&y;">]>'
OUTSIDE = '<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/hostname">]>'


@pytest.mark.parametrize("head", [ENTITIES, OUTSIDE, "<!DOCTYPE a>"])
def test_entities_and_document_types_are_refused(head, refused):
    refused(procspec(document(head=head)), "DTDForbidden", "export the spectrum as text")


def test_zip_bombs_are_refused_before_they_are_unpacked(refused, monkeypatch):
    content = procspec(document() + " " * (17 << 20))
    monkeypatch.setattr(zipfile.ZipFile, "open", lambda *arguments: pytest.fail("unpacked"))
    refused(content, "bytes, which no spectrum has")


def test_a_size_that_is_a_lie_does_not_unpack_more(write, refuses):
    """The size in the directory of the zip is smaller than what the data unpack to."""
    text = document() + " " * (17 << 20)
    content = procspec(text)
    lie = content.replace(len(text).to_bytes(4, "little"), (5000).to_bytes(4, "little"))
    assert lie != content
    refuses(DataError, r"is an Ocean Optics ProcSpec file", read_spectrum, write(lie), signal_unit="percent")


DAMAGED = {
    "cut short": procspec(document())[:-40],
    "damaged": procspec(document()).replace(b"ps_0.xml", b"ps_0.xmk", 1),
    "no XML": procspec("nothing"),
    "no closing tag": procspec(document().removesuffix(f"</{ROOT}>")),
    "no values": procspec(f"<{ROOT}/>"),
    "other lengths": procspec(document(wavelength=WAVELENGTH[:2])),
    "no number": procspec(document(processed=["1,5", "2", "3"])),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_are_refused(name, refused):
    refused(DAMAGED[name], "Optics ProcSpec file" if name != "no number" else "processedPixels has no number")


def test_the_extra_is_named(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "defusedxml.ElementTree", None)
    refused(procspec(document()), "defusedxml", "pip install 'pellicle[formats]'")
