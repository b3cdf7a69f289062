"""Frequency responses out of columns: `--columns` decides which are a pair, whatever their names say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import modalscope as ms
from modalscope.io.columns import Column
from modalscope.io.columns.reading import causal_share, pairing_of
from tests.io.columns.test_words import FREQUENCIES, RESPONSE, write
from tests.support import refused

OTHER = 1 / (1 - (FREQUENCIES / 30) ** 2 + 0.04j)
COLUMNS = (FREQUENCIES, RESPONSE.real, RESPONSE.imag, OTHER.real, OTHER.imag)


@pytest.mark.parametrize(
    "head", ["f,a,b", "f,H1 Real,H2 Imag", "f,Re_1x,Im_1y", "f,H Mag,H Phase", "f,Imag,Real", "Zeit,Kraft,x"]
)
def test_the_users_pair_goes_before_the_header(tmp_path: Path, head: str) -> None:
    path = write(tmp_path / "a.csv", head, *COLUMNS[:3])
    found = ms.read(path, columns="frequency=1,real=2,imag=3")
    assert isinstance(found, ms.FrequencyResponse)
    np.testing.assert_allclose(found.values[:, 0, 0], RESPONSE, atol=1e-6)


@pytest.mark.parametrize("said", ["real=2,imag=3,real=4,imag=5", "real=2,4,imag=3,5", "imag=3,5,real=2,4"])
def test_the_first_real_part_goes_with_the_first_imaginary_one(tmp_path: Path, said: str) -> None:
    path = write(tmp_path / "a.csv", "f,a Real,b Imag,b Real,a Imag", *COLUMNS)
    found = ms.read(path, columns=f"frequency=1,{said}")
    np.testing.assert_allclose(found.values[:, :, 0], np.stack([RESPONSE, OTHER], axis=1), atol=1e-6)


def test_parts_and_polar_values_in_one_table_are_two_responses(tmp_path: Path) -> None:
    columns = (*COLUMNS[:3], np.abs(OTHER), np.angle(OTHER))
    path = write(tmp_path / "a.csv", "f,a,b,c,d", *columns)
    found = ms.read(path, columns="frequency=1,real=2,imag=3,mag=4,phase=5", units={"5": "rad"})
    np.testing.assert_allclose(found.values[:, :, 0], np.stack([RESPONSE, OTHER], axis=1), atol=1e-5)


def test_a_name_that_both_share_is_kept(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", "f,Re(5Z/1Z),Im(5Z/1Z),6Z/1Z,6Z/1Z", *COLUMNS)
    found = ms.read(path, columns="frequency=1,real=2,4,imag=3,5")
    assert (found.output_dofs, found.input_dofs) == (("5:+Z", "6:+Z"), ("1:+Z",))


@pytest.mark.parametrize("head", ["f,a,b", "f,Re_1x,Im_1y", "f,H1 Real,H2 Imag", "f,Mag 1,Phase A [deg]", "a,b,c"])
def test_pairs_are_found_by_their_places_where_no_name_pairs_them(tmp_path: Path, head: str) -> None:
    parts = (RESPONSE.real, RESPONSE.imag)
    if "Mag" in head:
        parts = (np.abs(RESPONSE), np.degrees(np.angle(RESPONSE)))
    path = write(tmp_path / "a.csv", head, FREQUENCIES, *parts)
    np.testing.assert_allclose(ms.read(path).values[:, 0, 0], RESPONSE, atol=1e-5)


@pytest.mark.parametrize(
    ("names", "outputs", "inputs"),
    [
        (("1-X/1-Z", "2-Z/1-Z"), ("1:+X", "2:+Z"), ("1:+Z",)),
        (("1-Z/1Z", "2-Z/1Z"), ("1:-Z", "2:-Z"), ("1:+Z",)),
        (("1-X", "1-Y"), ("1:+X", "1:+Y"), ("u1",)),
        (("1-X", "P-1-Y"), ("1:+X", "P-1-Y"), ("u1",)),  # a name stays as it is written
    ],
)
def test_hyphens_are_signs_or_part_names_by_all_names_together(
    tmp_path: Path, names: tuple[str, str], outputs: tuple[str, ...], inputs: tuple[str, ...]
) -> None:
    head = ",".join(["f", *(f"{part} {name}" for name in names for part in ("Real", "Imag"))])
    found = ms.read(write(tmp_path / "a.csv", head, *COLUMNS))
    assert (found.output_dofs, found.input_dofs) == (outputs, inputs)


@pytest.mark.parametrize(
    ("heads", "labels"),
    [
        ("1-X,1-Y,1-Z", ("1:+X", "1:+Y", "1:+Z")),
        ("1-Z,2Z,3Z", ("1:-Z", "2:+Z", "3:+Z")),
        ("1-Z,2-Z,3-Z", ("1:-Z", "2:-Z", "3:-Z")),
        ("1 -X,1 -Y,1:-Z", ("1:-X", "1:-Y", "1:-Z")),
    ],
)
def test_hyphens_of_channels_part_names_where_several_axes_have_them(
    tmp_path: Path, heads: str, labels: tuple[str, ...]
) -> None:
    noise = np.random.default_rng(0).standard_normal((3, 400))
    found = ms.read(write(tmp_path / "a.csv", f"Time [s],{heads}", np.arange(400) / 100, *noise))
    assert found.output_dofs == labels


def test_two_records_are_no_pair_of_parts() -> None:
    """A causal response has its energy at positive times; of two records half lies on either side."""
    rng = np.random.default_rng(0)
    assert causal_share(RESPONSE) > 0.95
    assert causal_share(rng.standard_normal(400) + 1j * rng.standard_normal(400)) < 0.6


def test_two_columns_that_are_never_negative_are_no_parts() -> None:
    parts = [Column(number=k, values=1e4 * part) for k, part in enumerate((RESPONSE.real, RESPONSE.imag), 1)]
    sizes = [Column(number=column.number, values=np.abs(column.values)) for column in parts]
    assert set(pairing_of(parts[:1], parts[1:])[1].values()) == {"real", "imag"}
    assert pairing_of(sizes[:1], sizes[1:])[1] == {}


def test_a_part_without_its_other_may_be_left_where_whole_responses_are(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", "f,Re(a),Im(a),Re(b)", *COLUMNS[:4])
    refused(r"leave the column out: ignore=\['Re\(b\)'\]", ms.read, path)
    assert ms.read(path, ignore="Re(b)").output_dofs == ("a",)
    refused("Name as many columns imag= as real=", ms.read, path, columns="frequency=1,real=2,4,imag=3")


def test_of_spectra_no_pair_is_made(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", "f,PSD 1,PSD 2", FREQUENCIES, np.abs(RESPONSE), np.abs(OTHER))
    error = refused("spectra alone hold no phases", ms.read, path)
    assert "--columns" not in error.args[0]
