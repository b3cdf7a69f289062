"""Words of exports in two halves, each from documents of makers and from public files; the reader's words come from elsewhere.

The halves share no value of a dimension. "near" may be looked at while the reader is made; of "far" the total is looked at alone.

Sources, near: National Instruments, Specification for the LabVIEW Measurement File; Kyowa, DCS-100A and PCD-400A manuals (CSV of a
measurement); Bruel & Kjaer, PULSE LabShop, "ASCII file format" (X-Axis unit, X-Axis delta, Data Type); HBM, catman Easy manual (Export
ASCII, German); Gulf Coast Data Concepts, X2-2 user manual; PLab-SI/PicoQuake, docs/acquisition_data.md; phyphox, CSV export; Pico
Technology, PicoScope 6 user's guide; OROS, NVGate manual (French); Arduino sketches that print `millis`.
Sources, far: Dewesoft, X3 manual (Export, Text/CSV); Polytec, PSV ASCII export; Siemens, Testlab "ASCII export"; Engineering Strong
Motion database, header of DYNA 1.2; EarthScope, "ASCII SLIST / TSPAIR"; Campbell Scientific, LoggerNet manual (TOA5); MTS, Station Manager
data files; MSR Electronics loggers (`*TIME`); Crystal Instruments, EDM; Dytran VibraScout; BrainVision, header file 2.0; Beiwe
accelerometer files; enDAQ Lab, CSV; Data Physics, SignalCalc ASCII; LMS words of Italian, Spanish and Dutch laboratories.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Maker:
    """Keys of a header in the words of one maker or language, and what else he says there."""

    rate: str
    step: str
    count: str
    unit: str
    first: str
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class Half:
    """Words of one half."""

    makers: dict[str, Maker]
    time: tuple[str, ...]
    frequency: tuple[str, ...]
    forces: tuple[str, ...]
    sensors: tuple[str, ...]
    parts: tuple[tuple[str, str], ...]
    polar: tuple[tuple[str, str], ...]
    coherence: tuple[str, ...]
    units: dict[str, tuple[tuple[str, float], ...]]
    extras: tuple[str, ...]
    oddities: tuple[str, ...]
    axes: tuple[str, ...]
    heads: tuple[str, ...]
    drives: tuple[str, ...]


NEAR = Half(
    makers={
        "English": Maker("Sampling rate [Hz]", "Time step (s)", "Number of samples", "Unit", "Start frequency (Hz)", (
            "Title: bridge deck, run 3", "Operator: J. Smith", "Date: 2021-03-14", "Time: 10:12:33", "Location: midspan", "Gain: 10",
            "Filter: 400 Hz low pass", "Comment: second try",
        )),
        "LabVIEW": Maker("Sample_Rate", "Delta_X", "Samples", "Y_Unit_Label", "X0", (
            "Writer_Version\t2", "Reader_Version\t2", "Operator\tlab", "Project\tbeam", "Date\t2019/06/04", "Time\t11:03:19,4532",
        )),
        "Kyowa": Maker("Sampling Rate(Hz)", "Sampling Interval(s)", "Data Num", "Unit", "Start(Hz)", (
            "ID,PCD-400A", "Title,imp ham", "Test Date,2018/11/26 14:23:10", "CH Num,4", "Digital Input,OFF", "Comment,none",
        )),
        "PULSE": Maker("Sample frequency", "X-Axis delta", "X-Axis size", "Y-Axis unit", "X-Axis first value", (
            "Header Size:\t21", "Version:\t10", "Date:\t14-03-2011", "Time:\t10:33:02", "Number of averages:\t10",
            "Title1:\tFrequency response H1", "Z-axis size:\t1", "Window:\tUniform",
        )),
        "German": Maker("Abtastrate", "Abtastintervall [s]", "Anzahl Messwerte", "Einheit", "Startfrequenz", (
            "Messung: Brücke 4", "Prüfer: Müller", "Datum: 14.03.2011", "Uhrzeit: 10:33:02", "Bemerkung: Wind schwach", "Kanäle: 3",
        )),
        "French": Maker("Fréquence d'échantillonnage", "Pas de temps", "Nombre de points", "Unité", "Fréquence initiale", (
            "Essai: passerelle", "Opérateur: Dupont", "Date: 14/03/2011", "Lieu: Lyon", "Remarque: vent faible",
        )),
        "logger": Maker("SampleRate", "dt", "npts", "units", "f0", (
            "Title, http://www.gcdataconcepts.com, X2-2", "Version, 1110, Build date, Sep 13 2013", "Deadband, 0, counts", "SN:CCDC123",
        )),
    },
    time=("Time", "t", "time", "Zeit", "Temps", "TIME"),
    frequency=("Frequency", "f", "Frequenz", "Fréquence", "freq"),
    forces=("Force", "Hammer", "Kraft", "Force (Trigger)", "F", "Marteau", "Input force", "Shaker"),
    sensors=("Acc {n}", "Acc{axis}", "Response {n}", "Beschleunigung {n}", "Accélération {n}", "CH{n}", "Accelerometer {n}", "a{axis}"),
    parts=(("{name} Real", "{name} Imag"), ("Re({name})", "Im({name})"), ("{name} (real)", "{name} (imaginary)"),
        ("{name} Realteil", "{name} Imaginärteil")),
    polar=(("{name} Magnitude", "{name} Phase"), ("Mag {name}", "Phase {name}"), ("{name} Betrag", "{name} Phase"),
        ("Amplitude {name}", "Phase {name}")),
    coherence=("{name} Coherence", "Coh {name}"),
    units={
        "acceleration": (("m/s^2", 1.0), ("g", 9.80665), ("m/s²", 1.0), ("", 1.0)),
        "force": (("N", 1.0), ("kN", 1e3), ("lbf", 4.4482216152605), ("", 1.0)),
        "response": (("(m/s^2)/N", 1.0), ("g/N", 9.80665), ("m/s^2/N", 1.0), ("", 1.0)),
    },
    extras=("index first", "temperature", "trigger", "comment", "battery", "generator"),
    oddities=("remark", "footer", "trailing delimiter", "byte order mark", "two header rows"),
    axes=("s", "ms", "stamps", "rate", "index and rate"),
    heads=("none", "names", "brackets", "round", "unit row"),
    drives=("Source", "Generator output", "Drive", "Shaker voltage", "Output 1"),
)  # fmt: skip

FAR = Half(
    makers={
        "Dewesoft": Maker("Sample rate", "Sample interval", "Number of values", "Units", "Start value", (
            "Data file name: beam_0003.dxd", "Start time: 5/22/2018 9:31:02 AM", "Number of channels: 4", "Setup: modal.dxs",
            "Store mode: always fast",
        )),
        "Testlab": Maker("Sampling frequency", "Increment", "Number of values", "Y-axis unit", "Start of axis", (
            "Function class: FRF", "Project: wing.lms", "Point direction: +Z", "Original run: 7", "Amplitude scaling: Peak",
        )),
        "strong motion": Maker("SAMPLING_FREQUENCY_HZ", "SAMPLING_INTERVAL_S", "NDATA", "UNITS", "FIRST_FREQUENCY_HZ", (
            "EVENT_NAME: Emilia", "EVENT_DATE_YYYYMMDD: 20120529", "MAGNITUDE_W: 6.0", "NETWORK: IT", "STATION_CODE: MRN",
            "STATION_LATITUDE_DEGREE: 44.878230", "EPICENTRAL_DISTANCE_KM: 4.1", "VS30_M/S: 208", "STREAM: HNE",
            "LOW_CUT_FREQUENCY_HZ: 0.07",            "HIGH_CUT_FREQUENCY_HZ: 40.000", "DATA_TYPE: ACCELERATION", "DURATION_S: 90.2",
        )),
        "Italian": Maker("Frequenza di campionamento", "Passo di campionamento", "Numero di campioni", "Unità", "Frequenza iniziale", (
            "Prova: ponte", "Operatore: Rossi", "Data: 14/03/2011", "Canali: 4", "Note: vento debole",
        )),
        "Spanish": Maker("Frecuencia de muestreo", "Intervalo de muestreo", "Número de muestras", "Unidad", "Frecuencia inicial", (
            "Ensayo: puente", "Operador: García", "Fecha: 14/03/2011", "Hora: 10:12:01", "Lugar: vano central",
        )),
        "Dutch": Maker("Bemonsteringsfrequentie", "Tijdstap", "Aantal monsters", "Eenheid", "Startfrequentie", (
            "Meting: brug", "Datum: 14-03-2011", "Plaats: midden", "Opmerking: geen",
        )),
        "header file": Maker("fs", "SamplingInterval", "DataPoints", "YUnits", "fmin", (
            "DataFormat=ASCII", "Codepage=UTF-8", "DataType=TIMEDOMAIN", "NumberOfChannels=4", "Averaged=NO",
        )),
    },
    time=("Elapsed Time", "Tempo", "Tiempo", "Tijd", "Timestamp", "T"),
    frequency=("Freq.", "Frequenza", "Frecuencia", "Frequentie", "FREQUENCY"),
    forces=("Impact hammer", "Load cell", "Fuerza", "Forza", "Exciter", "Krachtsensor", "Excitation", "Martillo"),
    sensors=("Accel_{n}", "a_{axis}", "{n}Z", "AI{n}", "Sensor {n}", "Accelerazione {n}", "Aceleración {n}", "Versnelling {n}"),
    parts=(("Real part {name}", "Imaginary part {name}"), ("{name}_re", "{name}_im"),
        ("Parte reale {name}", "Parte immaginaria {name}"), ("RE {name}", "IM {name}")),
    polar=(("|{name}|", "arg({name})"), ("{name} Módulo", "{name} Fase"), ("Gain {name}", "Angle {name}"), ("{name}_mag", "{name}_phase")),
    coherence=("gamma2 {name}", "{name} Coerenza"),
    units={
        "acceleration": (("mm/s2", 1e-3), ("cm/s^2", 1e-2), ("mg", 9.80665e-3), ("m*s^-2", 1.0), ("", 1.0)),
        "force": (("Newtons", 1.0), ("kgf", 9.80665), ("kip", 4448.2216152605), ("", 1.0)),
        "response": (("(mm/s2)/N", 1e-3), ("g/lbf", 9.80665 / 4.4482216152605), ("1/kg", 1.0), ("", 1.0)),
    },
    extras=("counter last", "magnitude", "temp", "tacho", "second time", "drive", "features"),
    oddities=("head again", "cut line", "unequal", "sep line", "blank lines"),
    axes=("us", "epoch", "clock", "step", "epoch ms"),
    heads=("stroke", "slash", "units above", "four rows", "quoted"),
    drives=("Drive voltage", "DAC 1", "AO0", "Command", "Amplifier input"),
)  # fmt: skip
