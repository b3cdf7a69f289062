"""Hold the residual terms of a band: what the data contain besides the modes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from modalscope.numerics import documents
from modalscope.numerics.checks import (
    ComplexArray,
    RealArray,
    check_count,
    check_kind,
    check_number,
    check_positive,
    check_shape,
    complex_array,
    freeze,
    real_array,
    stays_locked,
)
from modalscope.numerics.errors import DataError
from modalscope.numerics.functions.pole_functions import line_functions, sample_functions

#: Largest power of the frequency.
_MAX_POWER = 100


@stays_locked
@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class ResidualTerms:
    """What the data of one band contain besides the modes, free in every channel: sum_j R_j g(s_j) + sum_p T_p (j f / top)^p.

    The terms belong to the data that they were fitted to, and mean nothing outside their band: the powers may go up to 20.

    Parameters
    ----------
    poles : array of complex, (k,)
        rad/s, as the modes have them: computational poles, and those that stand for modes outside the band.
    residues : array of complex, (k, l, m + R)
        R of every pole, of any rank; of records R ends of runs stand behind the inputs.
    powers : tuple of int, (t,)
        Of the frequency on lines; none of samples.
    terms : array, (t, l, m)
        Their real coefficients T.
    ends : array, (e, l, R)
        The same of the ends of runs, which act through one power less of every positive power; (0, l, 0) of responses.
    top : float
        Hz: where the powers are one.
    rate : float, optional
        Sampling rate of the plane of the poles; None on lines of a continuous structure.
    band : (float, float)
        Lowest and highest frequency that was fitted, Hz.
    """

    poles: ComplexArray
    residues: ComplexArray
    powers: tuple[int, ...]
    terms: RealArray
    ends: RealArray
    top: float
    rate: float | None
    band: tuple[float, float]

    def __post_init__(self) -> None:
        poles = complex_array("poles of residual terms", self.poles, "(poles,)", 1)
        terms = real_array("terms", self.terms, "(powers, outputs, inputs)", 3)
        l, m = terms.shape[1:]
        residues = complex_array("residues of residual terms", self.residues, "(poles, outputs, drives)", 3)
        ends = real_array("ends", self.ends, "(powers, outputs, ends)", 3)
        check_shape(
            "residues of residual terms", residues, "(poles, outputs, drives)", (len(poles), l, m + ends.shape[2])
        )
        powers = tuple(check_count("each power", p, least=-_MAX_POWER, most=_MAX_POWER) for p in self.powers)
        of_ends = int(np.count_nonzero(powers)) if ends.shape[2] else 0
        for name, array, count in (("terms", terms, len(powers)), ("ends", ends, of_ends)):
            check_shape(name, array, "(powers, outputs, channels)", (count, l, None))
        freeze(
            self,
            poles=poles,
            residues=residues,
            powers=powers,
            terms=terms,
            ends=ends,
            top=check_positive("top", self.top),
            rate=None if self.rate is None else check_positive("rate", self.rate),
            band=tuple(check_number("each end of the band", end) for end in self.band),
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as the JSON module writes them; `channels`: numbers of outputs, inputs and ends of runs."""
        whole = {each.name: getattr(self, each.name) for each in fields(self)}
        for name in ("poles", "residues"):
            whole[name] = {"real": whole[name].real.tolist(), "imag": whole[name].imag.tolist()}
        lists = {name: whole[name].tolist() for name in ("terms", "ends")}
        return {**whole, **lists, "channels": [*self.channels, int(self.ends.shape[2])]}

    @classmethod
    def from_dict(cls, entries: Mapping[str, Any]) -> ResidualTerms:
        """Take back what `to_dict` gave.

        Raises `DataError`: an entry that is missing or of another kind.
        """
        check_kind("an entry of the residual terms", entries, Mapping)
        try:
            l, m, R = (int(documents.number(count)) for count in documents.entries(entries["channels"]))
            parts = [documents.mapping(entries[name]) for name in ("poles", "residues")]
            poles, residues = (documents.numbers(z["real"]) + 1j * documents.numbers(z["imag"]) for z in parts)
            return cls(
                poles=poles,
                residues=residues.reshape(poles.size, l, m + R),
                powers=tuple(documents.entries(entries["powers"])),
                terms=documents.numbers(entries["terms"]).reshape(-1, l, m),
                ends=documents.numbers(entries["ends"]).reshape(-1, l, R) if R else np.zeros((0, l, 0)),
                **{name: entries[name] for name in ("top", "rate", "band")},
            )
        except (KeyError, ValueError) as error:
            raise DataError(
                "residual terms:", f"their entries are damaged ({error})", "Write the file again."
            ) from error

    @classmethod
    def of_columns(
        cls,
        coefficients: RealArray,
        poles: ComplexArray,
        powers: tuple[int, ...],
        channels: tuple[int, int],
        drives: int | None,
        **where: Any,
    ) -> ResidualTerms:
        """Return what real coefficients (columns, channels) of `Response.whole_basis(poles, powers)` stand for.

        `channels`: numbers of outputs and inputs. `drives`: of records inputs and ends of runs; None of responses, whose columns serve all
        inputs alike. `where`: top, rate and band.
        """
        (l, m), k = channels, len(poles)
        if drives is None:
            t, ends = len(coefficients) - 2 * k, np.zeros((0, l, 0))
            terms, parts = coefficients[:t].reshape(t, l, m), coefficients[t:].reshape(k, 2, l, m)
        else:
            t, e = len(powers), np.count_nonzero(powers)
            inner, outer = t * m, t * m + e * (drives - m)
            terms = coefficients[:inner].reshape(t, m, l).transpose(0, 2, 1)
            ends = coefficients[inner:outer].reshape(e, drives - m, l).transpose(0, 2, 1)
            parts = coefficients[outer:].reshape(drives, k, 2, l).transpose(1, 2, 3, 0)
        residues = parts[:, 0] + 1j * parts[:, 1]
        return cls(poles=poles, residues=residues, powers=powers if t else (), terms=terms, ends=ends, **where)

    @property
    def channels(self) -> tuple[int, int]:
        """Numbers of outputs and inputs."""
        return int(self.terms.shape[1]), int(self.terms.shape[2])

    @property
    def unknowns(self) -> int:
        """Number of real coefficients."""
        return 2 * self.residues.size + self.terms.size + self.ends.size

    def outside(self) -> ComplexArray:
        """Return the poles that lie outside the band: they stand for modes there, never for one inside."""
        f = np.abs(self.poles) / (2 * np.pi)
        return self.poles[(f < self.band[0]) | (f > self.band[1])]

    def shifted(self, rate: float) -> ResidualTerms:
        """Return the same with all poles moved along the real axis, rad/s, as an exponential window moves them."""
        return replace(self, poles=self.poles + rate)

    def select(self, outputs: Sequence[int], inputs: Sequence[int]) -> ResidualTerms:
        """Return some channels, by index."""
        rows, columns, m = np.asarray(outputs, int), np.asarray(inputs, int), self.channels[1]
        drives = np.concatenate([columns, np.arange(m, self.residues.shape[2])])
        return replace(
            self,
            residues=self.residues[:, rows][:, :, drives],
            terms=self.terms[:, rows][:, :, columns],
            ends=self.ends[:, rows],
        )

    def on_lines(self, frequencies: RealArray) -> ComplexArray:
        """Return its frequency responses to the inputs (F, l, m) on lines in Hz; zero outside the band."""
        l, m = self.channels
        values = np.zeros((len(frequencies), l, m), complex)
        inside = (frequencies >= self.band[0]) & (frequencies <= self.band[1])
        f = frequencies[inside]
        rows = line_functions(f, self.rate, self.poles) @ _real(self.residues[:, :, :m])
        relative = 1j * f / self.top
        powers = np.stack([relative**p for p in self.powers], axis=1) if self.powers else np.zeros((f.size, 0))
        flat = rows[: f.size] + 1j * rows[f.size :] + powers @ self.terms.reshape(len(self.terms), l * m)
        values[inside] = flat.reshape(f.size, l, m)
        return values

    def on_samples(self, samples: int, rate: float, first_sample: int) -> RealArray:
        """Return its impulse responses (N, l, m) at samples counted from the impulse; zero at another rate than that of the data."""
        if self.rate is None or not np.isclose(rate, self.rate, rtol=1e-9):
            return np.zeros((samples, *self.channels))
        flat = sample_functions(rate, first_sample, samples, self.poles) @ _real(self.residues)
        return np.asarray(flat.reshape(samples, *self.channels))

    def packed(self, drives: int, top: float) -> RealArray:
        """Return the coefficients (columns, l) of `whole_basis` of records with so many drives, for powers that are one at `top` Hz.

        Records with other runs than those that were fitted have other ends: these are left at zero.
        """
        l, m = self.channels
        residues, ends = self.residues, self.ends
        if drives != residues.shape[2]:
            residues = np.concatenate([residues[:, :, :m], np.zeros((len(residues), l, drives - m))], axis=2)
            ends = np.zeros((len(ends), l, drives - m))
        scale = (top / self.top) ** np.array(self.powers, dtype=float)
        of_ends = (top / self.top) ** (np.array([p for p in self.powers if p], dtype=float) - 1)
        parts = np.stack([residues.real, residues.imag], axis=1).transpose(3, 0, 1, 2)
        return np.concatenate(
            [
                (self.terms * scale[:, None, None]).transpose(0, 2, 1).reshape(-1, l),
                (ends * of_ends[:, None, None]).transpose(0, 2, 1).reshape(-1, l),
                parts.reshape(-1, l),
            ]
        )


def _real(residues: ComplexArray) -> RealArray:
    """Return residues (k, l, m) as real coefficients of the two functions of every pole, (2 k, l m)."""
    return np.asarray(
        np.stack([residues.real, residues.imag], axis=1).reshape(
            2 * len(residues), residues.shape[1] * residues.shape[2]
        )
    )
