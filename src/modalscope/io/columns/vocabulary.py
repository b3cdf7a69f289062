"""Words of exports and what they mean: one table for names of columns, one for statements of a header, in eight languages.

The languages are English, German, French, Italian, Spanish, Portuguese, Dutch and Swedish. Words stand without accents and in small
letters. One that ends in `-` may go on (`beschleunig-`), one that begins with it may be the end of a compound (`-kraft`). Statements are
compared without blanks and signs: `Sampling Rate(Hz)`, `sampling_rate` and `SamplingRate` are one.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from functools import cache

#: Meaning of a column -> words of its name.
COLUMNS = {
    "time": "time times zeit temps tiempo tempo tid tijd elapsed timestamp timestamps datetime seconds",
    "clock": "date datum fecha clock uhrzeit heure hora",
    "frequency": (
        "frequency frequencies freq freqs frequenz frequence frecuencia frequenza frequencia frequentie "
        "frekvens hz"
    ),
    "index": (
        "index idx sample samples no nr row line point count counter scan # id record frame frames packet "
        "echantillon campione muestra"
    ),
    "force": (
        "force forces hammer -hammer shaker input inputs exc excit excitation exciter kraft -kraft kraft- "
        "impact load loadcell stinger fuerza forza forca actuator marteau martello martillo martelo "
        "hamer kracht kracht- eccitazione excitacion excitacao excitatie hammare"
    ),
    "drive": "drive driver source generator siggen dac ao command demand setpoint ansteuerung generateur generador gerador quelle",
    "trigger": "trigger trig tacho tach tachometer keyphasor",
    "sensor": (
        "acc accel- acceleration beschleunigung- vel velocity disp displacement response output out "
        "versnelling- aceleracion aceleracao verschiebung- geschwindigkeit- geophone reponse risposta "
        "respuesta"
    ),
    "other": (
        "temperature temp temperatur temperatura ambient ambiant ambiente umgebung humidity humidite humedad umidita "
        "rh rpm speed voltage supply battery batterie batt battv bat vbat vbatt comment remark status kommentar drehzahl "
        "commentaire luftfeuchte feature features matching matches inliers confidence likelihood quality rssi satellites "
        "latitude longitude lux"
    ),
    "spectrum": (
        "fft psd csd spec spectrum spectra autospectrum autospectra spektrum autopower crosspower apsd spectre espectro spettro "
        "correlation autocorrelation crosscorrelation"
    ),
    "real": "realteil real reelle reel reell reale reele re",
    "imag": "imaginary imaginarteil imaginaire immaginaria imaginaria imaginair imaginardel imagin imag img im",
    "mag": "magnitude db mag abs absolute amplitude amp modulus module modulo modul betrag gain ampiezza amplitud",
    "phase": "phasenwinkel phase phas phi fase arg argument angle winkel",
    "coh": "coherence coherencia coerenza coerencia coherentie koharenz koherens coh gamma2",
}  # fmt: skip
#: Meaning of a statement -> its keys. Short ones (up to four letters) are whole words.
STATEMENTS = {
    "rate": (
        "samplerate samplingrate sampfreq samplefrequency samplingfrequency samplefreq samplingfreq fsamp fsampling "
        "datarate scanrate acquisitionrate acqrate abtastrate abtastfrequenz messrate "
        "frequencedechantillonnage frequenzadicampionamento frecuenciademuestreo taxadeamostragem "
        "frequenciadeamostragem bemonsteringsfrequentie samplingsfrekvens samplespersec samplessec fs rate sr "
        "srate"
    ),
    "frequency step": (
        "frequencystep frequencyresolution frequencyincrement linespacing deltaf df frequenzschritt "
        "pasdefrequence"
    ),
    "step": (
        "deltat deltax deltatime timestep timeincrement timeinterval timeresolution xincrement xresolution "
        "xinterval xstep sampleinterval samplinginterval sampleperiod samplingperiod sampletime samplingtime "
        "xaxisdelta increment delta abtastintervall abtastzeit zeitschritt pasdetemps periodedechantillonnage "
        "passodicampionamento passotemporale intervallodicampionamento intervalodemuestreo pasodetiempo "
        "tijdstap intervalodeamostragem passodetempo tidssteg dt ts dx"
    ),
    "first": (
        "xaxisfirstvalue firstvalue first startvalue startofaxis startfrequency startfrequenz firstfrequency "
        "frequenceinitiale frequenzainiziale frecuenciainicial startfrequentie frequenciainicial x0 f0 fmin"
    ),
    "count": (
        "numberofsamples numberofvalues numberofpoints datapoints npts ndata ndat datanum xaxissize "
        "anzahlmesswerte nombredepoints numerodicampioni numerodemuestras aantalmonsters numerodeamostras"
    ),
    "form": "datatype dataformat valuetype datentyp typededonnees function functiontype",
    "axis unit": "xaxisunit xunit xunits xunitlabel",
    "unit": "yunit yunits yaxisunit yunitlabel unit units einheit unite unita unidad unidade eenheid enhet",
    "reference": "refsignal reference refpoint referencepoint referencesignal drivepoint",
    "channel": "channel channels name names kanal label title voie canale canal kanaal chno chname channelname",
    "place": "signal signalname point location loclbl dof scnl node",
}  # fmt: skip
#: Words of names that say the side of a channel, a voltage, that or a number alone, an output, maybe of a generator, of columns that name
#: the sensor of a row, and of runs.
INPUTS = {"input", "inputs", "excitation", "anregung", "eccitazione", "excitacion", "excitacao", "excitatie"}
VOLTS = {"voltage", "voltages", "volt", "volts", "spannung", "tension"}
VOLTAGES = {*VOLTS, "ch", "channel", "kanal", "voie", "canal", "ai"}
OUTPUTS = {"output", "out", "ausgang", "sortie", "salida", "uscita"}
SENSORS = {"sensor", "sensors", "node", "board", "channel", "ch", "device", "id", "mac", "unit", "kanal", "knoten", "capteur"}  # fmt: skip
_RUN = "run|test|trial|hit|setup|repeat|exp|experiment|meas|measurement|messung|versuch|essai|prova|ensayo"
RUNS = re.compile(rf"(?<![a-z])(?:{_RUN})(?![a-z])", re.IGNORECASE)
#: Words of a file's name before the number of a place, and of one that is driven; blows ("impact 3") are none: they may be repeated.
COUNTED = {
    "": "p pt pts point points pos position loc location place dof node nodes nodo noeud knoten mp punkt messpunkt punto ponto stelle",
    "input": f"in exc ref reference {' '.join(sorted(INPUTS))}",
}
#: Letters that are whole names, and what they name.
LETTERS = {"t": "time", "T": "time", "X_Value": "time", "x_value": "time", "f": "frequency", "F": "force"}
LETTERS |= dict.fromkeys(("n", "N", "k", "i"), "index")

_DIRECTION = r"R?[XYZxyz](?![^\W_])"
#: A hyphen straight between number and direction, which parts them or is a sign; a direction that has none; hyphens that part more of a
#: name; and a sign in brackets.
_HYPHEN, _WITHOUT = re.compile(rf"(?<=\d)-(?=({_DIRECTION}))"), re.compile(rf"\d(?:[\s_:+]+-?)?{_DIRECTION}")
_PARTS, _BRACKETS = re.compile(rf"[^\W_]-\d+-{_DIRECTION}"), re.compile(rf"(?<=\d)\s*\(([+-]{_DIRECTION})\)")

_WORD = re.compile(r"[A-ZÀ-Þ]?[a-zà-ÿ]+|[A-ZÀ-Þ]+(?![a-zà-ÿ])|\d+|#")
_WORDS = {word: meaning for meaning, words in COLUMNS.items() for word in words.split()}
_KEYS = sorted(
    ((key, meaning) for meaning, keys in STATEMENTS.items() for key in keys.split()), key=lambda pair: -len(pair[0])
)
_MAX_LETTERS_OF_WORD = 4
#: Characters of a name that are examined: none is longer, and patterns take time that grows with a text.
MAX_CHARACTERS = 400


def folded(text: str) -> str:
    """Return a text of the same length in small letters without accents.

    Examples
    --------
    >>> folded("Kohärenz É")
    'koharenz e'
    """
    return "".join((unicodedata.normalize("NFKD", letter)[:1] or letter).lower()[:1] or letter for letter in text)


def parted(names: Sequence[str]) -> tuple[list[str], bool]:
    """Return names with a colon before directions whose hyphen parts them from a number, or which stand in brackets; and a doubt.

    Hyphens part where they part more of every name (`sensor-3-Z`), or several axes are named and all have one (`1-X`, `1-Y`). They are
    signs where a direction has none (`1Z`), another sign or another separator. Else they are taken as signs, in doubt.

    Examples
    --------
    >>> parted(["1-X", "1-Y"]), parted(["P1Z", "P2-Z"]), parted(["P1-Z", "P2-Z"]), parted(["1(-Z)"])
    ((['1:X', '1:Y'], False), (['P1Z', 'P2-Z'], False), (['P1-Z', 'P2-Z'], True), (['1:-Z'], False))
    """
    names = [_BRACKETS.sub(r":\1", name[:MAX_CHARACTERS]) for name in names]
    axes = {axis.upper() for name in names for axis in _HYPHEN.findall(name)}
    if not axes or any(_WITHOUT.search(name) for name in names):
        return names, False
    if len(axes) > 1 or all(_PARTS.search(name) for name in names):
        return [_HYPHEN.sub(":", name) for name in names], False
    return names, True


@cache
def words_of(name: str) -> tuple[str, ...]:
    """Return the words of a name in small letters and without accents, also those that capitals part.

    Examples
    --------
    >>> words_of("InputForce_1"), words_of("AccA"), words_of("Température")
    (('input', 'force', '1'), ('acc', 'a'), ('temperature',))
    """
    return tuple(folded(word) for word in _WORD.findall(name[:MAX_CHARACTERS].replace("dB", "db")))


@cache
def meanings_of(name: str) -> tuple[tuple[str, str], ...]:
    """Return what the words of a column's name mean, each with its word.

    Examples
    --------
    >>> meanings_of("Hammerkraft 1"), meanings_of("Acc Real"), meanings_of("F"), meanings_of("Zeit")
    ((('force', 'hammerkraft'),), (('sensor', 'acc'), ('real', 'real')), (('force', 'F'),), (('time', 'zeit'),))
    """
    whole = name.strip()
    if whole in LETTERS:
        return ((LETTERS[whole], whole),)
    found = []
    for word in words_of(whole):
        meaning = _WORDS.get(word)
        if meaning is None and len(word) > _MAX_LETTERS_OF_WORD:
            ends = (key for n in range(3, len(word)) for key in (f"-{word[n:]}", f"{word[:-n]}-") if key in _WORDS)
            meaning = next((_WORDS[key] for key in (f"{word}-", *ends) if key in _WORDS), None)
        found += [(meaning, word)] if meaning else []
    return tuple(found)


@cache
def key_meaning(key: str) -> str:
    """Return what a key of a header states; nothing where it is not known.

    Examples
    --------
    >>> [key_meaning(key) for key in ("Sampling Rate(Hz)", "X-Axis delta", "Fréquence d'échantillonnage", "Operator")]
    ['rate', 'step', 'rate', '']
    """
    words = words_of(key)
    joined = "".join(words)
    if words and len(words) > 1 and words[-1] in STATEMENTS["unit"].split():
        return "axis unit" if joined in STATEMENTS["axis unit"].split() else "unit"
    for known, meaning in _KEYS:
        if (known in joined) if len(known) > _MAX_LETTERS_OF_WORD else (known in words or known == joined):
            return meaning
    return ""
