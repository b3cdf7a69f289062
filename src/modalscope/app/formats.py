"""What can be exported."""

__all__ = ["FORMATS"]

#: The suffix, and what is told of it.
FORMATS = {
    ".json": "modes with everything that is known of them, and the analysis",
    ".csv": "a table of the modes",
    ".uff": "universal file, dataset 55",
    ".unv": "universal file, dataset 55",
    ".npz": "NumPy arrays",
    ".mat": "MATLAB arrays",
    ".h5": "HDF5 arrays",
    ".html": "the report: one file, pictures and all",
    ".analysis.json": "the document: every choice, to do it again",
}
